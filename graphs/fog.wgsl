// Fog that lies on the ground: noise, thinner with height.

fn at(xyz: vec3i) -> vec4f {
    let height = (f32(xyz.y) + 0.5) / f32(size_noise().y);
    let patchy = smoothstep(0.35, 0.75, load_noise(xyz).r);
    return vec4f(params.density * (0.15 + patchy) * exp(-3.0 * height));
}
