// The sums of every row and of every column of a tile of SIDE×SIDE pixels.
//
// Sums of rows lie tile column after tile column, sums of columns tile row after tile row, so that the carrying
// passes read runs. `Texel` and the writing of tables stand behind this file. A thread adds up its own pixels, which lie
// 16 apart, before others see them: little goes through workgroup memory.

const STEPS = SIDE / 16;

var<workgroup> rows: array<Texel, SIDE * 16>;
var<workgroup> columns: array<Texel, 16 * SIDE>;

/// Where the part x of a row stands: exchanged with the row's number, so that threads of neighbouring rows do not meet in
/// one bank of workgroup memory.
fn part(x: i32, y: i32) -> i32 {
    return y * 16 + (x ^ (y & 15));
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
    var pixels = array<Texel, STEPS * STEPS>();
    for (var k = 0; k < STEPS * STEPS; k++) {
        let xy = origin + at + 16 * vec2i(k % STEPS, k / STEPS);
        pixels[k] = select(Texel(), texel_of(load_image(xy)), all(xy < size));
    }
    var down = array<Texel, STEPS>();
    for (var j = 0; j < STEPS; j++) {
        var across = Texel();
        for (var i = 0; i < STEPS; i++) {
            across += pixels[STEPS * j + i];
            down[i] += pixels[STEPS * j + i];
        }
        rows[part(at.x, at.y + 16 * j)] = across;
    }
    for (var i = 0; i < STEPS; i++) {
        columns[at.y * SIDE + at.x + 16 * i] = down[i];
    }
    workgroupBarrier();
    let line = i32(lane) % 128;
    if line >= SIDE {
        return;
    }
    var sum = Texel();
    if lane < 128u {
        for (var x = 0; x < 16; x++) {
            sum += rows[part(x, line)];
        }
        if origin.y + line < size.y {
            put_rows(tile_at.x * size.y + origin.y + line, sum);
        }
    } else {
        for (var y = 0; y < 16; y++) {
            sum += columns[y * SIDE + line];
        }
        if origin.x + line < size.x {
            put_columns(tile_at.y * size.x + origin.x + line, sum);
        }
    }
}
