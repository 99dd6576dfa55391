// Voxels as floats in memory, x fastest → a volume.

fn at(xyz: vec3i) -> vec4f {
    let size = size_out();
    let index = ((xyz.z * size.y + xyz.y) * size.x + xyz.x) * CHANNELS;
    if CHANNELS == 1 {
        return vec4f(vec3f(bitcast<f32>(load_words(index))), 1.0);
    }
    return vec4f(
        bitcast<f32>(load_words(index)),
        bitcast<f32>(load_words(index + 1)),
        bitcast<f32>(load_words(index + 2)),
        bitcast<f32>(load_words(index + 3)),
    );
}
