// Σ w(k)·in(x − k, y): a workgroup loads WIDTH × HEIGHT pixels and RADIUS more to both sides, and a thread makes four
// neighbours of them.

// Every fourth pixel of a row stands together, so that threads whose pixels are four apart read neighbouring places.
var<workgroup> tile: array<vec4f, 4 * QUADS * HEIGHT>;

const LANES: i32 = WIDTH / 4;

/// Where pixel i of a row of the tile stands.
fn place(row: i32, i: i32) -> i32 {
    return (4 * row + (i & 3)) * QUADS + (i >> 2u);
}

@compute @workgroup_size(LANES, HEIGHT)
fn main(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_id) local: vec3u) {
    let origin = block(group) * vec2i(WIDTH, HEIGHT);
    let lane = i32(local.x);
    let row = i32(local.y);
    for (var i = lane; i < WIDTH + 2 * RADIUS; i += LANES) {
        tile[place(row, i)] = load_image(origin + vec2i(i - RADIUS, row));
    }
    workgroupBarrier();

    // Tap n lies under weight 2·RADIUS − n of the first pixel, and under one more of each further one. The first three taps
    // are left of some of the four, the last three right of some.
    let last = 2 * RADIUS;
    var a = vec4f();
    var b = vec4f();
    var c = vec4f();
    var d = vec4f();
    for (var n = 0; n < 3; n++) {
        let v = tile[place(row, 4 * lane + n)];
        a += load_weights(last - n) * v;
        if n > 0 {
            b += load_weights(last - n + 1) * v;
        }
        if n > 1 {
            c += load_weights(last) * v;
        }
    }
    var w = vec4f(load_weights(last - 2), load_weights(last - 1), load_weights(last), 0.0);
    for (var n = 3; n <= last; n++) {
        let v = tile[place(row, 4 * lane + n)];
        w = vec4f(load_weights(last - n), w.xyz);
        a += w.x * v;
        b += w.y * v;
        c += w.z * v;
        d += w.w * v;
    }
    for (var n = 1; n <= 3; n++) {
        let v = tile[place(row, 4 * lane + last + n)];
        d += load_weights(3 - n) * v;
        if n < 3 {
            c += load_weights(2 - n) * v;
        }
        if n < 2 {
            b += load_weights(0) * v;
        }
    }

    // Stored as they were loaded: neighbouring threads write neighbouring pixels.
    workgroupBarrier();
    tile[place(row, 4 * lane)] = a;
    tile[place(row, 4 * lane + 1)] = b;
    tile[place(row, 4 * lane + 2)] = c;
    tile[place(row, 4 * lane + 3)] = d;
    workgroupBarrier();
    for (var i = lane; i < WIDTH; i += LANES) {
        store_out(origin + vec2i(i, row), tile[place(row, i)]);
    }
}
