fn sigma_t(p: vec3f) -> f32 {
    return params.sigma_t;
}
