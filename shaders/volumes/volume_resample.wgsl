// AXIS: 0 x, 1 y, 2 z. LINEAR: a tent as wide as two voxels of the coarser side; otherwise the nearest voxel.

fn at(xyz: vec3i) -> vec4f {
    let ratio = f32(size_volume()[AXIS]) / f32(size_out()[AXIS]);
    let place = (f32(xyz[AXIS]) + 0.5) * ratio;
    var voxel = xyz;
    if !LINEAR {
        voxel[AXIS] = i32(place);
        return load_volume(voxel);
    }
    let half = max(ratio, 1.0);
    let last = i32(floor(place - 0.5 + half));
    var sum = vec4f();
    var weights = 0.0;
    for (var i = i32(ceil(place - 0.5 - half)); i <= last; i++) {
        let weight = 1.0 - abs(f32(i) + 0.5 - place) / half;
        voxel[AXIS] = i;
        sum += weight * load_volume(voxel);
        weights += weight;
    }
    return sum / weights;
}
