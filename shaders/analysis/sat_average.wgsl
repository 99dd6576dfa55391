// The last sum of a summed-area table over the number of values in it; its exponential for the geometric mean.

@compute @workgroup_size(1, 1, 1)
fn main() {
    let count = load_count();
    let sum = load_sums(size_sums() - vec2i(1));
    var mean = sum / max(count, vec4f(1.0));
    if GEOMETRIC {
        mean = exp(mean);
    }
    store_out(select(vec4f(), mean, count > vec4f()));
}
