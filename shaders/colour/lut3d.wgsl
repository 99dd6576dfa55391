// Tetrahedral interpolation: from black over the corner along the largest fraction, then along the middle one, to white.

import package::lib::number::is_nan;

fn corner(at: vec3i) -> vec3f {
    let i = 3 * (at.r + SIZE * (at.g + SIZE * at.b));
    return vec3f(load_cube(i), load_cube(i + 1), load_cube(i + 2));
}

fn apply(image: vec4f) -> vec4f {
    let t = clamp((image.rgb - params.low) * params.scale, vec3f(0.0), vec3f(f32(SIZE - 1)));
    let base = min(vec3i(t), vec3i(SIZE - 2));
    let f = t - vec3f(base);
    let large = max(f.r, max(f.g, f.b));
    let small = min(f.r, min(f.g, f.b));
    let middle = max(min(f.r, f.g), min(max(f.r, f.g), f.b));
    // Where fractions are equal, the corner that is picked has no weight.
    let along_large = select(select(vec3i(0, 0, 1), vec3i(0, 1, 0), f.g >= f.b), vec3i(1, 0, 0), f.r >= max(f.g, f.b));
    let along_small = select(select(vec3i(1, 0, 0), vec3i(0, 1, 0), f.g < f.r), vec3i(0, 0, 1), f.b < min(f.r, f.g));
    let c = corner(base) * (1.0 - large) + corner(base + along_large) * (large - middle)
        + corner(base + 1 - along_small) * (middle - small) + corner(base + 1) * small;
    let nan = is_nan(image.r) || is_nan(image.g) || is_nan(image.b);
    return vec4f(select(c, vec3f(image.r + image.g + image.b), nan), image.a);
}
