// The density of the port `volume` and its gradient, at points of the unit cube.

fn density(p: vec3f) -> f32 {
    return sample_volume(p).r;
}

fn difference(i: vec3i) -> vec3f {
    return vec3f(
        load_volume(i + vec3i(1, 0, 0)).r - load_volume(i - vec3i(1, 0, 0)).r,
        load_volume(i + vec3i(0, 1, 0)).r - load_volume(i - vec3i(0, 1, 0)).r,
        load_volume(i + vec3i(0, 0, 1)).r - load_volume(i - vec3i(0, 0, 1)).r,
    );
}

fn difference_row(i: vec3i, f: f32) -> vec3f {
    return mix(difference(i), difference(i + vec3i(1, 0, 0)), f);
}

/// Central differences over two voxels, interpolated trilinearly, in density per length of the cube. Interpolating
/// differences, not subtracting interpolated values, it is exactly 0 where the density is constant.
fn gradient(p: vec3f) -> vec3f {
    let size = vec3f(size_volume());
    let at = p * size - 0.5;
    let whole = floor(at);
    let f = at - whole;
    let i = vec3i(whole);
    let near = mix(difference_row(i, f.x), difference_row(i + vec3i(0, 1, 0), f.x), f.y);
    let far = mix(difference_row(i + vec3i(0, 0, 1), f.x), difference_row(i + vec3i(0, 1, 1), f.x), f.y);
    return mix(near, far, f.z) * 0.5 * size;
}

/// The direction that a surface of this gradient faces; no direction where the density is constant.
fn facing(g: vec3f) -> vec3f {
    let length = length(g);
    return select(vec3f(0.0), -g / length, length > 0.0);
}
