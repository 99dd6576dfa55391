// Sums of a measure over tiles: for each partial the sum, what its rounding lost, and how many values took part.
//
// Partials lie component after component: 12 runs of as many floats as there are partials. Constants: the walk
// (LANES, TILE, SERIAL), VIEW (0 channels, 1 luminance, 2 colour and luminance), MEASURE (0 value, 1 logarithm,
// 2 squared distance from `centre()`, which stands behind this file).

import package::lib::wide::{sum_error, viewed};

var<workgroup> sums: array<vec4f, LANES_X * LANES_Y>;
var<workgroup> errors: array<vec4f, LANES_X * LANES_Y>;
var<workgroup> counts: array<vec4f, LANES_X * LANES_Y>;

fn measure(v: vec4f, middle: vec4f) -> vec4f {
    if MEASURE == 1 {
        return log(params.epsilon + max(v, vec4f(0.0)));
    }
    if MEASURE == 2 {
        let d = v - middle;
        return d * d;
    }
    return v;
}

fn leave(index: i32, sum: vec4f, error: vec4f, count: vec4f) {
    let n = size_partials() / 12;
    for (var c = 0; c < 4; c++) {
        store_partials(c * n + index, sum[c]);
        store_partials((4 + c) * n + index, error[c]);
        store_partials((8 + c) * n + index, count[c]);
    }
}

@compute @workgroup_size(LANES_X, LANES_Y, 1)
fn main(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_id) local: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let size = size_image();
    let first = vec2i(group.xy) * vec2i(TILE_X, TILE_Y);
    let last = min(first + vec2i(TILE_X, TILE_Y), size);
    let middle = centre();
    var sum = vec4f();
    var error = vec4f();
    var count = vec4f();
    for (var y = first.y + i32(local.y); y < last.y; y += LANES_Y) {
        for (var x = first.x + i32(local.x); x < last.x; x += LANES_X) {
            let v = viewed(load_image(vec2i(x, y)), VIEW);
            let finite = (bitcast<vec4u>(v) & vec4u(0x7f800000u)) != vec4u(0x7f800000u);
            let term = select(vec4f(), measure(v, middle), finite);
            error += sum_error(sum, term);
            sum += term;
            count += select(vec4f(), vec4f(1.0), finite);
        }
    }
    let index = i32(group.y * groups.x + group.x);
    if SERIAL {
        leave(index * LANES_X * LANES_Y + i32(lane), sum, error, count);
        return;
    }
    sums[lane] = sum;
    errors[lane] = error;
    counts[lane] = count;
    for (var half = u32(LANES_X * LANES_Y) / 2u; half > 0u; half /= 2u) {
        workgroupBarrier();
        if lane < half {
            let other = sums[lane + half];
            let mine = sums[lane];
            errors[lane] += errors[lane + half] + sum_error(mine, other);
            sums[lane] = mine + other;
            counts[lane] += counts[lane + half];
        }
    }
    if lane == 0u {
        leave(index, sums[0], errors[0], counts[0]);
    }
}
