// What both walks of marching cubes share. A thread walks the words of one row (y, z), 32 points along x at a time; its cells
// lie between four rows, numbered by y + 2z: 0 its own. To know the edges that the points of these four own, it also looks
// at the rows behind them: 4 (y+2, z), 5 (y+2, z+1), 6 (y, z+2), 7 (y+1, z+2).

/// The inside points of the eight rows in one word of each.
struct Words {
    near: vec4u,
    high: vec2u,
    deep: vec2u,
}

fn row_place(row: i32) -> vec2i {
    return vec2i(row % params.points.y, row / params.points.y);
}

/// A word of a row. Behind the last row it stands again, behind the last word of a row its last point.
fn word(w: i32, yz: vec2i) -> u32 {
    let at = min(yz, params.points.yz - 1);
    let bits = load_inside((at.y * params.points.y + at.x) * ROW_WORDS + min(w, ROW_WORDS - 1));
    return select(u32(bitcast<i32>(bits) >> 31u), bits, w < ROW_WORDS);
}

fn near_words(w: i32, yz: vec2i) -> vec4u {
    return vec4u(word(w, yz), word(w, yz + vec2i(1, 0)), word(w, yz + vec2i(0, 1)), word(w, yz + vec2i(1, 1)));
}

fn words(w: i32, yz: vec2i) -> Words {
    let high = vec2u(word(w, yz + vec2i(2, 0)), word(w, yz + vec2i(2, 1)));
    return Words(near_words(w, yz), high, vec2u(word(w, yz + vec2i(0, 2)), word(w, yz + vec2i(1, 2))));
}

/// The points one further along x.
fn shifted(here: vec4u, next: vec4u) -> vec4u {
    return (here >> vec4u(1u)) | (next << vec4u(31u));
}

/// The lowest `n` bits, all for 32 and more.
fn lowest(n: i32) -> u32 {
    return select((1u << u32(clamp(n, 0, 31))) - 1u, 0xffffffffu, n > 31);
}

/// The points of a word that there are.
fn points_of(w: i32) -> u32 {
    return lowest(params.points.x - 32 * w);
}

/// The cells that begin in a word, and that the surface crosses: their corners are not all alike.
fn crossed_cells(w: i32, yz: vec2i, near: vec4u, far: vec4u) -> u32 {
    if any(yz + 1 >= params.points.yz) {
        return 0u;
    }
    let differs = (near ^ vec4u(near.x)) | (far ^ vec4u(near.x));
    return (differs.x | differs.y | differs.z | differs.w) & lowest(params.points.x - 1 - 32 * w);
}

/// Where the case of a cell begins in the table: bit x + 2·row of the case is a corner.
fn case_at(near: vec4u, far: vec4u, bit: u32) -> i32 {
    let n = (near >> vec4u(bit)) & vec4u(1u);
    let f = (far >> vec4u(bit)) & vec4u(1u);
    let corners = (n << vec4u(0u, 2u, 4u, 6u)) | (f << vec4u(1u, 3u, 5u, 7u));
    return i32(corners.x | corners.y | corners.z | corners.w) * STRIDE;
}
