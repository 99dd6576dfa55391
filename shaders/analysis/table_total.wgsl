// The sum of a table of u32, in one workgroup.

const LANES = 256u;

var<workgroup> sums: array<u32, LANES>;

@compute @workgroup_size(256, 1, 1)
fn main(@builtin(local_invocation_index) lane: u32) {
    var sum = 0u;
    for (var i = i32(lane); i < size_table(); i += i32(LANES)) {
        sum += load_table(i);
    }
    sums[lane] = sum;
    for (var half = LANES / 2u; half > 0u; half /= 2u) {
        workgroupBarrier();
        if lane < half {
            sums[lane] += sums[lane + half];
        }
    }
    if lane == 0u {
        store_out(0, sums[0]);
    }
}
