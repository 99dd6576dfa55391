fn at(xyz: vec3i) -> vec4f {
    let difference = vec3f(
        load_volume(xyz + vec3i(1, 0, 0)).r - load_volume(xyz - vec3i(1, 0, 0)).r,
        load_volume(xyz + vec3i(0, 1, 0)).r - load_volume(xyz - vec3i(0, 1, 0)).r,
        load_volume(xyz + vec3i(0, 0, 1)).r - load_volume(xyz - vec3i(0, 0, 1)).r,
    );
    let g = difference * 0.5 * vec3f(size_volume());
    return vec4f(g, length(g));
}
