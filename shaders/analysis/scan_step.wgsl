// One step of a prefix sum: RADIX entries, STRIDE apart, ending at this one (or at the one before, SHIFT = 1).
//
// The type `Entry` of the table stands behind this file.

fn at(i: i32) -> Entry {
    var total = Entry();
    for (var k = RADIX - 1; k >= 0; k--) {
        let j = i - SHIFT - k * STRIDE;
        if j >= 0 {
            total += load_table(j);
        }
    }
    return total;
}
