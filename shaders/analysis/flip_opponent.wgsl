// Linear sRGB within 0..1 → achromatic, red–green and blue–yellow: linear relatives of L*, a* and b*.

import package::lib::number::is_nan;

fn shown(v: f32) -> f32 {
    return select(clamp(v, 0.0, 1.0), 0.0, is_nan(v));
}

fn apply(image: vec4f) -> vec4f {
    let c = vec3f(shown(image.r), shown(image.g), shown(image.b));
    // XYZ relative to its white.
    let x = dot(vec3f(0.43389539, 0.37624237, 0.18986224), c);
    let y = dot(vec3f(0.21263682, 0.71518298, 0.07218020), c);
    let z = dot(vec3f(0.01775242, 0.10946563, 0.87278195), c);
    return vec4f(116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z), 1.0);
}
