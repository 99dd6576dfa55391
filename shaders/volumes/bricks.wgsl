// The extreme density of each brick of 8³ cells; a cell lies between voxel centres, the first one before the first voxel.

fn at(xyz: vec3i) -> vec4f {
    let first = xyz * 8 - 1;
    var extreme = select(3.4e38, -3.4e38, GREATEST);
    for (var z = 0; z <= 8; z++) {
        for (var y = 0; y <= 8; y++) {
            for (var x = 0; x <= 8; x++) {
                let v = load_volume(first + vec3i(x, y, z)).r;
                extreme = select(extreme, v, select(extreme > v, extreme < v, GREATEST));
            }
        }
    }
    return vec4f(extreme);
}
