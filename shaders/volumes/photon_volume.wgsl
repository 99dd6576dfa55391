// Counts as a volume. WHAT: 0 fluence, 1 its standard error, 2 deposited weight.

fn wide(at: i32) -> f32 {
    return f32(load_tallies(at + 1)) * 4294967296.0 + f32(load_tallies(at));
}

fn at(xyz: vec3i) -> vec4f {
    let size = size_out();
    let voxel = (xyz.z * size.y + xyz.y) * size.x + xyz.x;
    let voxels = f32(size.x * size.y * size.z);
    let photons = f32(load_tallies(PHOTONS));
    if WHAT == 2 {
        return vec4f(wide(VOXELS + 4 * voxel + 2) / 268435456.0 / photons);
    }
    let overflows = load_tallies(OVERFLOWS);
    if overflows > 0u {
        // NaN, by a value that is not known when the shader is compiled: sums that are wrong must not look right.
        return vec4f(bitcast<f32>(0x7fc00000u | min(overflows, 1u)));
    }
    // A collision counts 1/σt, in units of the smallest 1/σt; a path its length, in units of the shortest side of a voxel.
    let unit = select(params.majorant, f32(max(size.x, max(size.y, size.z))), TRACK);
    let scale = select(0.0, voxels / 16777216.0 / unit, unit > 0.0);
    if WHAT == 0 {
        return vec4f(wide(VOXELS + 4 * voxel) / photons * scale);
    }
    let batches = load_tallies(BATCHES);
    if batches < 2u {
        // Unknown: as large as the value.
        return vec4f(wide(VOXELS + 4 * voxel) / photons * scale);
    }
    let squares = bitcast<f32>(load_tallies(VOXELS + 4 * size.x * size.y * size.z + voxel));
    return vec4f(sqrt(squares / f32(batches - 1u) / photons) * scale);
}
