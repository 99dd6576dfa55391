// The blended target → counts: the sets of a bin add up. Constants: WIDTH, ROWS, SETS.

fn at(bin: i32) -> u32 {
    var n = 0u;
    for (var i = 0; i < SETS; i++) {
        n += u32(load_blended(vec2i(bin % WIDTH, bin / WIDTH + i * ROWS)).x);
    }
    return n;
}
