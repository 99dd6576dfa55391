fn fetch(p: vec3i) -> vec4f {
    let first = params.offset + p.z * params.slice_pitch + p.y * params.row_pitch + p.x * CHANNELS;
    var v = vec4f(0.0, 0.0, 0.0, 1.0);
    for (var c = 0; c < CHANNELS; c++) {
        v[c] = f32(load_src(first + c));
    }
    return v;
}
