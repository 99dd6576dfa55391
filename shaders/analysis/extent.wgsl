// Smallest and largest finite value over tiles, and how many values are NaN or infinite: 16 runs of as many floats
// as there are partials. Constants: the walk (LANES, TILE, SERIAL), VIEW (0 channels, 1 luminance, 2 colour and
// luminance).

import package::lib::wide::viewed;

const LARGEST = 3.4028234663852886e38;

var<workgroup> low: array<vec4f, LANES_X * LANES_Y>;
var<workgroup> high: array<vec4f, LANES_X * LANES_Y>;
var<workgroup> nans: array<vec4f, LANES_X * LANES_Y>;
var<workgroup> infs: array<vec4f, LANES_X * LANES_Y>;

fn leave(index: i32, a: vec4f, b: vec4f, nan: vec4f, inf: vec4f) {
    let n = size_partials() / 16;
    for (var c = 0; c < 4; c++) {
        store_partials(c * n + index, a[c]);
        store_partials((4 + c) * n + index, b[c]);
        store_partials((8 + c) * n + index, nan[c]);
        store_partials((12 + c) * n + index, inf[c]);
    }
}

@compute @workgroup_size(LANES_X, LANES_Y, 1)
fn main(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_id) local: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let first = vec2i(group.xy) * vec2i(TILE_X, TILE_Y);
    let last = min(first + vec2i(TILE_X, TILE_Y), size_image());
    var a = vec4f(LARGEST);
    var b = vec4f(-LARGEST);
    var nan = vec4f();
    var inf = vec4f();
    for (var y = first.y + i32(local.y); y < last.y; y += LANES_Y) {
        for (var x = first.x + i32(local.x); x < last.x; x += LANES_X) {
            let v = viewed(load_image(vec2i(x, y)), VIEW);
            let magnitude = bitcast<vec4u>(v) & vec4u(0x7fffffffu);
            let finite = magnitude < vec4u(0x7f800000u);
            a = select(a, min(a, v), finite);
            b = select(b, max(b, v), finite);
            nan += select(vec4f(), vec4f(1.0), magnitude > vec4u(0x7f800000u));
            inf += select(vec4f(), vec4f(1.0), magnitude == vec4u(0x7f800000u));
        }
    }
    let index = i32(group.y * groups.x + group.x);
    if SERIAL {
        leave(index * LANES_X * LANES_Y + i32(lane), a, b, nan, inf);
        return;
    }
    low[lane] = a;
    high[lane] = b;
    nans[lane] = nan;
    infs[lane] = inf;
    for (var half = u32(LANES_X * LANES_Y) / 2u; half > 0u; half /= 2u) {
        workgroupBarrier();
        if lane < half {
            low[lane] = min(low[lane], low[lane + half]);
            high[lane] = max(high[lane], high[lane + half]);
            nans[lane] += nans[lane + half];
            infs[lane] += infs[lane + half];
        }
    }
    if lane == 0u {
        leave(index, low[0], high[0], nans[0], infs[0]);
    }
}
