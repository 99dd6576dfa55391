// AXIS: 0 x, 1 y, 2 z.

fn voxel(xy: vec2i, slice: i32) -> vec4f {
    if AXIS == 0 {
        return load_volume(vec3i(slice, xy));
    }
    if AXIS == 1 {
        return load_volume(vec3i(xy.x, slice, xy.y));
    }
    return load_volume(vec3i(xy, slice));
}

fn at(xy: vec2i) -> vec4f {
    let place = params.position * f32(size_volume()[AXIS]) - 0.5;
    let slice = floor(place);
    return mix(voxel(xy, i32(slice)), voxel(xy, i32(slice) + 1), place - slice);
}
