// A volume → voxels as floats in memory, x fastest. FIRST_SLICE is the first slice of this part.

fn each(index: i32) {
    let size = size_volume();
    let x = index % size.x;
    let y = (index / size.x) % size.y;
    let z = FIRST_SLICE + index / (size.x * size.y);
    let v = load_volume(vec3i(x, y, z));
    for (var c = 0; c < CHANNELS; c++) {
        store_words(index * CHANNELS + c, bitcast<u32>(v[c]));
    }
}
