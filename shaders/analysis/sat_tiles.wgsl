// The summed-area table of a tile of SIDE×SIDE pixels, from its pixels, what lies to the left of each of its rows,
// and the table along its upper edge. `Texel` and the reading of tables stand behind this file.
//
// Four threads share a line: each sums a quarter of it in place, then adds what stands at the ends of the quarters
// before its own. Sums of columns carry what rounding loses.

import package::lib::wide::sum_error;

const QUARTER = SIDE / 4;
const LANES_Y = SIDE / 4;

var<workgroup> tile: array<Texel, SIDE * SIDE>;

fn cell(x: i32, y: i32) -> i32 {
    return y * SIDE + (x ^ y);
}

@compute @workgroup_size(16, LANES_Y, 1)
fn main(
    @builtin(workgroup_id) group: vec3u,
    @builtin(local_invocation_id) local: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let size = size_image();
    let tile_at = block(group);
    let origin = tile_at * SIDE;
    for (var y = i32(local.y); y < SIDE; y += LANES_Y) {
        for (var x = i32(local.x); x < SIDE; x += 16) {
            let xy = origin + vec2i(x, y);
            var t = Texel();
            if all(xy < size) {
                t = texel_of(load_image(xy));
            }
            tile[cell(x, y)] = t;
        }
    }
    workgroupBarrier();
    let i = i32(lane) % SIDE;
    let first = i32(lane) / SIDE * QUARTER;

    var sum = Texel();
    for (var x = first; x < first + QUARTER; x++) {
        sum += tile[cell(x, i)];
        tile[cell(x, i)] = sum;
    }
    workgroupBarrier();
    var before = Texel();
    if origin.y + i < size.y {
        before = left_at(tile_at.x * size.y + origin.y + i);
    }
    for (var x = QUARTER - 1; x < first; x += QUARTER) {
        before += tile[cell(x, i)];
    }
    workgroupBarrier();
    for (var x = first; x < first + QUARTER; x++) {
        tile[cell(x, i)] += before;
    }
    workgroupBarrier();

    sum = Texel();
    var error = Texel();
    for (var y = first; y < first + QUARTER; y++) {
        let term = tile[cell(i, y)];
        error += lost_in(sum, term);
        sum += term;
        tile[cell(i, y)] = sum + error;
    }
    workgroupBarrier();
    before = Texel();
    if origin.x + i < size.x {
        before = edges_at(tile_at.y * size.x + origin.x + i);
    }
    error = Texel();
    for (var y = QUARTER - 1; y < first; y += QUARTER) {
        let term = tile[cell(i, y)];
        error += lost_in(before, term);
        before += term;
    }
    workgroupBarrier();
    for (var y = first; y < first + QUARTER; y++) {
        let term = tile[cell(i, y)];
        let lost = lost_in(before, term);
        tile[cell(i, y)] = before + term + (error + lost);
    }
    workgroupBarrier();
    for (var y = i32(local.y); y < SIDE; y += LANES_Y) {
        for (var x = i32(local.x); x < SIDE; x += 16) {
            let xy = origin + vec2i(x, y);
            if all(xy < size) {
                store_out(xy, pixel_of(tile[cell(x, y)]));
            }
        }
    }
}
