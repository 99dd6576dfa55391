// The summed-area table of a tile of SIDE×SIDE pixels, from its pixels, what lies to the left of each of its rows,
// and the table along its upper edge. `Texel` and the reading of tables stand behind this file.

import package::lib::wide::sum_error;

var<workgroup> tile: array<Texel, SIDE * SIDE>;

fn cell(x: i32, y: i32) -> i32 {
    return y * SIDE + (x ^ y);
}

@compute @workgroup_size(8, 8, 1)
fn main(
    @builtin(workgroup_id) group: vec3u,
    @builtin(local_invocation_id) local: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let size = size_image();
    let origin = vec2i(group.xy) * SIDE;
    for (var y = i32(local.y); y < SIDE; y += 8) {
        for (var x = i32(local.x); x < SIDE; x += 8) {
            let xy = origin + vec2i(x, y);
            var t = Texel();
            if all(xy < size) {
                t = texel_of(load_image(xy));
            }
            tile[cell(x, y)] = t;
        }
    }
    workgroupBarrier();
    let i = i32(lane);
    if i < SIDE && origin.y + i < size.y {
        let left = left_at(i32(group.x) * size.y + origin.y + i);
        var sum = Texel();
        for (var x = 0; x < SIDE; x++) {
            sum += tile[cell(x, i)];
            tile[cell(x, i)] = sum + left;
        }
    }
    workgroupBarrier();
    if i < SIDE && origin.x + i < size.x {
        var sum = edges_at(i32(group.y) * size.x + origin.x + i);
        var error = Texel();
        for (var y = 0; y < SIDE; y++) {
            let term = tile[cell(i, y)];
            error += lost_in(sum, term);
            sum += term;
            tile[cell(i, y)] = sum + error;
        }
    }
    workgroupBarrier();
    for (var y = i32(local.y); y < SIDE; y += 8) {
        for (var x = i32(local.x); x < SIDE; x += 8) {
            let xy = origin + vec2i(x, y);
            if all(xy < size) {
                store_out(xy, pixel_of(tile[cell(x, y)]));
            }
        }
    }
}
