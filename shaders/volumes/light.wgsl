// Lights of power 1. LIGHT: 0 a point, 1 a beam, 2 a rectangle with sides light_right and light_up that shines along
// light_direction.

/// Where a photon begins, from two numbers in 0..1.
fn emitted_place(u: vec2f) -> vec3f {
    return params.light_origin + (u.x - 0.5) * params.light_right + (u.y - 0.5) * params.light_up;
}

/// Where it goes, from the same numbers.
fn emitted_direction(u: vec2f) -> vec3f {
    if LIGHT != 0 {
        return params.light_direction;
    }
    let z = 2.0 * u.x - 1.0;
    let r = sqrt(1.0 - z * z);
    return vec3f(r * sin_pi(2.0 * u.y + 0.5), r * sin_pi(2.0 * u.y), z);
}
