// The summed-area table along the upper edge of every row of tiles: the prefix sums, along x, of what lies above.
//
// One workgroup a row of tiles. Each thread sums a run of LENGTH/256 columns, the runs are scanned in workgroup
// memory, then each thread walks its run again.

/// Terms that a thread asks for at once, lest it wait for each.
const AHEAD = 16;

var<workgroup> runs: array<Texel, 256>;

/// The terms from `first` on, with nothing from `last` on.
fn terms_of(row: i32, first: i32, last: i32) -> array<Texel, AHEAD> {
    var terms = array<Texel, AHEAD>();
    for (var n = 0; n < AHEAD; n++) {
        let x = first + n;
        terms[n] = select(Texel(), above_at(row + min(x, LENGTH - 1)), x < last);
    }
    return terms;
}

@compute @workgroup_size(256, 1, 1)
fn main(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
    let length = (LENGTH + 255) / 256;
    let first = i32(lane) * length;
    let last = min(first + length, LENGTH);
    let row = i32(group.x) * LENGTH;
    var sum = Texel();
    for (var x = first; x < last; x += AHEAD) {
        var terms = terms_of(row, x, last);
        for (var n = 0; n < AHEAD; n++) {
            sum += terms[n];
        }
    }
    runs[lane] = sum;
    for (var stride = 1u; stride < 256u; stride *= 2u) {
        workgroupBarrier();
        var before = Texel();
        if lane >= stride {
            before = runs[lane - stride];
        }
        workgroupBarrier();
        runs[lane] += before;
    }
    workgroupBarrier();
    sum = Texel();
    if lane > 0u {
        sum = runs[lane - 1u];
    }
    var error = Texel();
    for (var x = first; x < last; x += AHEAD) {
        var terms = terms_of(row, x, last);
        for (var n = 0; n < AHEAD; n++) {
            error += lost_in(sum, terms[n]);
            sum += terms[n];
            if x + n < last {
                put_edges(row + x + n, sum + error);
            }
        }
    }
}
