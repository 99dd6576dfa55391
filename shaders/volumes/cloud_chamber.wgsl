fn sigma_t(p: vec3f) -> f32 {
    let aside = p.xz - 0.5;
    let roof = p.y > 0.78 && p.y < 0.83 && dot(aside, aside) >= 0.001;
    if roof || p.x < 0.02 || p.y < 0.02 || p.z > 0.98 {
        return params.wall;
    }
    return select(0.5 * params.density_scale, (1.0 - p.y) * 5.0, p.y < 0.2);
}
