// The means of a difference image → one number. METRIC: 0 mean square, 1 PSNR, 2 structural similarity, 3 FLIP.

@compute @workgroup_size(1, 1, 1)
fn main() {
    let means = load_mean();
    var mean = 0.0;
    for (var c = 0; c < CHANNELS; c++) {
        mean += means[c];
    }
    mean /= f32(CHANNELS);
    var value = mean;
    if METRIC == 1 {
        value = params.most;
        if mean > 0.0 {
            // 20·log10(peak) − 10·log10(mean), with log10 from log2.
            value = min(3.0102999566 * (2.0 * log2(params.peak) - log2(mean)), params.most);
        }
    } else if METRIC == 2 {
        value = 1.0 - mean;
    }
    store_out(vec4f(value));
}
