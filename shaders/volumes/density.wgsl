// The density of the port `volume` and its gradient, at points of the unit cube.

fn density(p: vec3f) -> f32 {
    return sample_volume(p).r;
}

fn voxel(x: i32, y: i32, z: i32) -> f32 {
    return load_volume(vec3i(x, y, z)).r;
}

/// The density on the line along x through voxels (y, z), and the difference over two voxels there.
fn line(i: vec3i, f: f32) -> vec2f {
    let a = voxel(i.x - 1, i.y, i.z);
    let b = voxel(i.x, i.y, i.z);
    let c = voxel(i.x + 1, i.y, i.z);
    let d = voxel(i.x + 2, i.y, i.z);
    return vec2f(mix(b, c, f), mix(c - a, d - b, f));
}

/// The density alone.
fn between(i: vec3i, f: f32) -> f32 {
    return mix(voxel(i.x, i.y, i.z), voxel(i.x + 1, i.y, i.z), f);
}

/// Central differences over two voxels, interpolated trilinearly, in density per length of the cube. Equal densities are
/// interpolated alike, so the gradient is exactly 0 where the density is constant. Reads the 32 voxels that it needs once.
fn gradient(p: vec3f) -> vec3f {
    let size = vec3f(size_volume());
    let at = p * size - 0.5;
    let whole = floor(at);
    let f = at - whole;
    let i = vec3i(whole);
    let y = vec3i(0, 1, 0);
    let z = vec3i(0, 0, 1);
    let low = line(i, f.x);
    let high = line(i + y, f.x);
    let low_behind = line(i + z, f.x);
    let high_behind = line(i + y + z, f.x);
    let along_x = mix(mix(low.y, high.y, f.y), mix(low_behind.y, high_behind.y, f.y), f.z);
    let along_y = mix(
        mix(high.x - between(i - y, f.x), between(i + 2 * y, f.x) - low.x, f.y),
        mix(high_behind.x - between(i - y + z, f.x), between(i + 2 * y + z, f.x) - low_behind.x, f.y),
        f.z,
    );
    let along_z = mix(
        mix(low_behind.x - between(i - z, f.x), between(i + 2 * z, f.x) - low.x, f.z),
        mix(high_behind.x - between(i + y - z, f.x), between(i + y + 2 * z, f.x) - high.x, f.z),
        f.y,
    );
    return vec3f(along_x, along_y, along_z) * 0.5 * size;
}

/// The direction that a surface of this gradient faces; no direction where the density is constant.
fn facing(g: vec3f) -> vec3f {
    let length = length(g);
    return select(vec3f(0.0), -g / length, length > 0.0);
}
