// The summed-area table along the upper edge of every row of tiles: the prefix sums, along x, of what lies above.
//
// One workgroup a row of tiles. Each thread sums a run of LENGTH/256 columns, the runs are scanned in workgroup
// memory, then each thread walks its run again.

import package::lib::wide::sum_error;

var<workgroup> runs: array<Texel, 256>;

@compute @workgroup_size(256, 1, 1)
fn main(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
    let length = (LENGTH + 255) / 256;
    let first = i32(lane) * length;
    let last = min(first + length, LENGTH);
    let row = i32(group.x) * LENGTH;
    var sum = Texel();
    for (var x = first; x < last; x++) {
        sum += above_at(row + x);
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
    for (var x = first; x < last; x++) {
        let term = above_at(row + x);
        error += lost_in(sum, term);
        sum += term;
        put_edges(row + x, sum + error);
    }
}
