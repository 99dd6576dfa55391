fn sigma_t(p: vec3f) -> f32 {
    let v = sample_medium(p).r;
    // A comparison with NaN is false.
    return min(params.sigma_t * select(0.0, v, v > 0.0), MOST);
}
