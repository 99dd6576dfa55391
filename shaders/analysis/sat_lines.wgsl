// The prefix sums of whole lines, one thread a line: rows (AXIS 0) or columns. Compensated. `Texel` stands behind
// this file.

@compute @workgroup_size(64, 1, 1)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let size = size_sums();
    let line = i32(id.x);
    if line >= size[1 - AXIS] {
        return;
    }
    var sum = Texel();
    var error = Texel();
    for (var i = 0; i < size[AXIS]; i++) {
        let place = select(vec2i(i, line), vec2i(line, i), AXIS == 1);
        let term = texel_of(load_sums(place));
        error += lost_in(sum, term);
        sum += term;
        store_out(place, pixel_of(sum + error));
    }
}
