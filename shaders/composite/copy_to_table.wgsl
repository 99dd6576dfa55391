// Pixels into a table; `fetch` comes from the kind of the source, `Entry` and `entry` from the table.

fn at(i: i32) -> Entry {
    let k = i - params.offset;
    if k < 0 {
        return load_dst(i);
    }
    let in_slice = k % params.slice_pitch;
    let in_row = in_slice % params.row_pitch;
    let p = vec3i(in_row / CHANNELS, in_slice / params.row_pitch, k / params.slice_pitch);
    if any(p >= params.extent) {
        return load_dst(i);
    }
    return entry(fetch(p)[in_row % CHANNELS]);
}
