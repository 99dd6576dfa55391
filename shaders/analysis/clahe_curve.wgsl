// The curve of a tile from its histogram: clipped, what is cut off spread over all bins, cumulated. One workgroup a
// tile; each thread has a run of BINS/64 bins.

var<workgroup> sums: array<f32, 64>;
var<workgroup> totals: array<u32, 64>;

@compute @workgroup_size(64, 1, 1)
fn main(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
    let length = (BINS + 63) / 64;
    let table = i32(group.x) * BINS;
    let first = i32(lane) * length;
    let last = min(first + length, BINS);
    var total = 0u;
    for (var i = first; i < last; i++) {
        total += load_counts(table + i);
    }
    totals[lane] = total;
    workgroupBarrier();
    total = 0u;
    for (var i = 0; i < 64; i++) {
        total += totals[i];
    }
    let limit = max(params.clip * f32(total) / f32(BINS), 1.0);
    var kept = 0.0;
    for (var i = first; i < last; i++) {
        kept += min(f32(load_counts(table + i)), limit);
    }
    sums[lane] = kept;
    workgroupBarrier();
    var sum = 0.0;
    var all_kept = 0.0;
    for (var i = 0; i < 64; i++) {
        if i == i32(lane) {
            sum = all_kept;
        }
        all_kept += sums[i];
    }
    let share = (f32(total) - all_kept) / f32(BINS);
    for (var i = first; i < last; i++) {
        sum += min(f32(load_counts(table + i)), limit);
        store_curves(table + i, (sum + share * f32(i + 1)) / max(f32(total), 1.0));
    }
}
