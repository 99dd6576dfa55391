// The summed-area table of a tile of SIDE×SIDE pixels, from its pixels, what lies to the left of each of its rows,
// and the table along its upper edge. `Texel` and the reading of tables stand behind this file.
//
// 256 threads share the lines: each holds RUN pixels of one and adds what stands at the ends of the runs before its own.

const STEPS = SIDE / 16;
const RUN = STEPS * STEPS;

var<workgroup> tile: array<Texel, SIDE * SIDE>;

/// Columns are exchanged with the row's number, and every other row's halves: so neither a row, nor a column, nor two rows
/// of 16 threads meet in one bank of workgroup memory.
fn cell(x: i32, y: i32) -> i32 {
    return y * SIDE + (x ^ y ^ ((y & 1) * 16));
}

/// The n-th of a thread's pixels when threads form a square.
fn spread(at: vec2i, n: i32) -> vec2i {
    return at + 16 * vec2i(n % STEPS, n / STEPS);
}

@compute @workgroup_size(16, 16, 1)
fn main(
    @builtin(workgroup_id) group: vec3u,
    @builtin(local_invocation_id) local: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let size = size_image();
    let tile_at = block(group);
    let origin = tile_at * SIDE;
    let at = vec2i(local.xy);
    let line = i32(lane) % SIDE;
    let first = i32(lane) / SIDE * RUN;
    var left = Texel();
    if origin.y + line < size.y {
        left = left_at(tile_at.x * size.y + origin.y + line);
    }
    var above = Texel();
    if origin.x + line < size.x {
        above = edges_at(tile_at.y * size.x + origin.x + line);
    }
    var run = array<Texel, RUN>();
    for (var n = 0; n < RUN; n++) {
        let xy = origin + spread(at, n);
        run[n] = select(Texel(), texel_of(load_image(xy)), all(xy < size));
    }
    for (var n = 0; n < RUN; n++) {
        let xy = spread(at, n);
        tile[cell(xy.x, xy.y)] = run[n];
    }
    workgroupBarrier();

    var sum = Texel();
    for (var n = 0; n < RUN; n++) {
        sum += tile[cell(first + n, line)];
        run[n] = sum;
    }
    tile[cell(first + RUN - 1, line)] = sum;
    workgroupBarrier();
    for (var x = RUN - 1; x < first; x += RUN) {
        left += tile[cell(x, line)];
    }
    workgroupBarrier();
    for (var n = 0; n < RUN; n++) {
        tile[cell(first + n, line)] = run[n] + left;
    }
    workgroupBarrier();

    sum = Texel();
    for (var n = 0; n < RUN; n++) {
        sum += tile[cell(line, first + n)];
        run[n] = sum;
    }
    tile[cell(line, first + RUN - 1)] = sum;
    workgroupBarrier();
    for (var y = RUN - 1; y < first; y += RUN) {
        above += tile[cell(line, y)];
    }
    workgroupBarrier();
    for (var n = 0; n < RUN; n++) {
        tile[cell(line, first + n)] = run[n] + above;
    }
    workgroupBarrier();
    for (var n = 0; n < RUN; n++) {
        let xy = spread(at, n);
        store_out(origin + xy, pixel_of(tile[cell(xy.x, xy.y)]));
    }
}
