// The extents of all tiles → smallest, largest, NaN and infinity counts of the image. Without any finite value
// smallest and largest are 0.

const LANES = 256u;
const LARGEST = 3.4028234663852886e38;

var<workgroup> low: array<vec4f, LANES>;
var<workgroup> high: array<vec4f, LANES>;
var<workgroup> nans: array<vec4f, LANES>;
var<workgroup> infs: array<vec4f, LANES>;

@compute @workgroup_size(256, 1, 1)
fn main(@builtin(local_invocation_index) lane: u32) {
    let n = count_of_partials();
    var a = vec4f(LARGEST);
    var b = vec4f(-LARGEST);
    var nan = vec4f();
    var inf = vec4f();
    for (var i = i32(lane); i < n; i += i32(LANES)) {
        a = min(a, run_of(0, i));
        b = max(b, run_of(1, i));
        nan += run_of(2, i);
        inf += run_of(3, i);
    }
    low[lane] = a;
    high[lane] = b;
    nans[lane] = nan;
    infs[lane] = inf;
    for (var half = LANES / 2u; half > 0u; half /= 2u) {
        workgroupBarrier();
        if lane < half {
            low[lane] = min(low[lane], low[lane + half]);
            high[lane] = max(high[lane], high[lane + half]);
            nans[lane] += nans[lane + half];
            infs[lane] += infs[lane + half];
        }
    }
    if lane == 0u {
        let some = low[0] <= high[0];
        store_smallest(select(vec4f(), low[0], some));
        store_largest(select(vec4f(), high[0], some));
        store_nan(nans[0]);
        store_inf(infs[0]);
    }
}
