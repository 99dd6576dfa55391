// What both walks of marching cubes share. A thread walks the points (x, y, z) of one row along x; its cells lie between
// four rows, numbered by y + 2z: 0 its own. To know the edges that the voxels of these four own, it also looks at the
// rows behind them: 4 (y+2, z), 5 (y+2, z+1), 6 (y, z+2), 7 (y+1, z+2).

fn row_place(row: i32) -> vec2i {
    return vec2i(row % params.points.y, row / params.points.y);
}

/// Whether a point is inside, as bit `number`.
fn inside(x: i32, yz: vec2i, number: u32) -> u32 {
    let p = vec3i(min(x, params.points.x - 1), min(yz, params.points.yz - 1));
    return select(0u, 1u << number, load_volume(p - PAD).r >= params.iso);
}

/// The inside points of rows 0 to 3 at x, as bits. Beyond the last point or row the last one stands again, so that no
/// edge crosses the surface there.
fn near_insides(x: i32, yz: vec2i) -> u32 {
    return inside(x, yz, 0u) | inside(x, yz + vec2i(1, 0), 1u) | inside(x, yz + vec2i(0, 1), 2u) | inside(x, yz + vec2i(1, 1), 3u);
}

/// The same of all eight rows.
fn insides(x: i32, yz: vec2i) -> u32 {
    let near = near_insides(x, yz);
    let high = inside(x, yz + vec2i(2, 0), 4u) | inside(x, yz + vec2i(2, 1), 5u);
    return near | high | inside(x, yz + vec2i(0, 2), 6u) | inside(x, yz + vec2i(1, 2), 7u);
}

/// For the points of rows 0 to 3 at some x: which of their edges along x, y, z cross the surface, as bits.
fn owned(here: u32, next: u32) -> vec4u {
    let own = vec4u(here, here >> 1u, here >> 2u, here >> 3u);
    let along_x = own ^ vec4u(next, next >> 1u, next >> 2u, next >> 3u);
    let along_y = own ^ vec4u(here >> 1u, here >> 4u, here >> 3u, here >> 5u);
    let along_z = own ^ vec4u(here >> 2u, here >> 3u, here >> 6u, here >> 7u);
    return (along_x & vec4u(1u)) | ((along_y & vec4u(1u)) << vec4u(1u)) | ((along_z & vec4u(1u)) << vec4u(2u));
}

/// Bits 0 to 3 at places 0, 2, 4 and 6.
fn spread(bits: u32) -> u32 {
    let pairs = ((bits & 0xfu) | (bits << 2u)) & 0x33u;
    return (pairs | (pairs << 1u)) & 0x55u;
}

/// Where the case of the cell between two points begins in the table: bit x + 2·row of the case is a corner.
fn case_at(here: u32, next: u32) -> i32 {
    return i32(spread(here) | (spread(next) << 1u)) * STRIDE;
}

/// Whether a row has cells.
fn has_cells(yz: vec2i) -> bool {
    return all(yz + 1 < params.points.yz);
}
