// Which points of the lattice are inside, as bits: 32 points along x in a word, ROW_WORDS words a row. Behind the end of a row
// its last point stands again, so that no edge crosses the surface there.

fn at(index: i32) -> u32 {
    let row = index / ROW_WORDS;
    let first = vec3i(index % ROW_WORDS * 32, row % params.points.y, row / params.points.y);
    var bits = 0u;
    for (var b = 0; b < 32; b++) {
        let p = vec3i(min(first.x + b, params.points.x - 1), first.yz);
        bits |= select(0u, 1u << u32(b), load_volume(p - PAD).r >= params.iso);
    }
    return bits;
}
