// The sums of every row and of every column of a tile of SIDE×SIDE pixels, one thread a line.
//
// Sums of rows lie tile column after tile column, sums of columns tile row after tile row, so that the carrying
// passes read runs. `Texel` and the writing of tables stand behind this file. Columns of the tile are exchanged
// with the row's number, so that neither a row nor a column of threads meets in one bank of workgroup memory.

import package::lib::wide::sum_error;

const LANES_Y = SIDE / 8;

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
    var sum = Texel();
    if i32(lane) < SIDE {
        for (var x = 0; x < SIDE; x++) {
            sum += tile[cell(x, i)];
        }
        if origin.y + i < size.y {
            put_rows(tile_at.x * size.y + origin.y + i, sum);
        }
    } else {
        for (var y = 0; y < SIDE; y++) {
            sum += tile[cell(i, y)];
        }
        if origin.x + i < size.x {
            put_columns(tile_at.y * size.x + origin.x + i, sum);
        }
    }
}
