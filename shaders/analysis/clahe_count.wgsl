// The histogram of every tile: a workgroup counts every n-th row of its tile. Constants: TILES_X, TILES_Y, BINS.

import package::lib::wide::bin_of_pixel;

var<workgroup> tallies: array<atomic<u32>, BINS>;

@compute @workgroup_size(64, 1, 1)
fn main(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    for (var i = i32(lane); i < BINS; i += 64) {
        atomicStore(&tallies[i], 0u);
    }
    workgroupBarrier();
    let tiles = vec2i(TILES_X, TILES_Y);
    let first = vec2i(group.xy) * size_image() / tiles;
    let last = (vec2i(group.xy) + 1) * size_image() / tiles;
    for (var y = first.y + i32(group.z); y < last.y; y += i32(groups.z)) {
        for (var x = first.x + i32(lane); x < last.x; x += 64) {
            let bin = bin_of_pixel(load_image(vec2i(x, y)), 0, params.low, params.high, BINS, true);
            if bin >= 0 {
                atomicAdd(&tallies[bin], 1u);
            }
        }
    }
    workgroupBarrier();
    let table = (i32(group.y) * TILES_X + i32(group.x)) * BINS;
    for (var i = i32(lane); i < BINS; i += 64) {
        let n = atomicLoad(&tallies[i]);
        if n > 0u {
            add_counts(table + i, n);
        }
    }
}
