// The largest of every stride-th entry.

fn strided_maximum(first: i32) -> f32 {
    var most = 0.0;
    for (var i = first; i < size_terms(); i += params.stride) {
        most = max(most, load_terms(i));
    }
    return most;
}
