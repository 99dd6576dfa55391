// Phase functions. PHASE: 0 isotropic, 1 Rayleigh, 2 Henyey–Greenstein of mean cosine params.g.

/// The density of scattered directions per steradian, by the cosine of their angle to the old one.
fn phase_density(cosine: f32) -> f32 {
    if PHASE == 1 {
        return 0.0596831037 * (1.0 + cosine * cosine);
    }
    if PHASE == 2 {
        let g = params.g;
        // 1 + g² − 2gμ, without the cancellation at |g| ≈ 1.
        let s = (1.0 - abs(g)) * (1.0 - abs(g)) + 2.0 * (abs(g) - g * cosine);
        return 0.0795774715 * (1.0 - g * g) / (s * sqrt(s));
    }
    return 0.0795774715;
}

/// x^⅓ of 1 ≤ x ≤ 5.
fn cube_root(x: f32) -> f32 {
    let guess = exp2(log2(x) / 3.0);
    return guess - (guess * guess * guess - x) / (3.0 * guess * guess);
}

/// The cosine below which the share u of scattered light lies.
fn phase_cosine(u: f32) -> f32 {
    let t = 2.0 * u - 1.0;
    if PHASE == 1 {
        // The root of μ³ + 3μ = 4t, by Cardano.
        let half = abs(2.0 * t);
        let root = cube_root(half + sqrt(half * half + 1.0));
        return select(root - 1.0 / root, 1.0 / root - root, t < 0.0);
    }
    if PHASE == 2 {
        // (1 + g² − ((1 − g²)/(1 + gt))²)/2g, multiplied out: nothing cancels where g is small.
        let g = params.g;
        let a = 1.0 + g * g;
        return (t * a + 0.5 * g * (t * t * a + 3.0 - g * g)) / ((1.0 + g * t) * (1.0 + g * t));
    }
    return t;
}

/// The direction of light that came along `direction` and is scattered: u is the share of directions with smaller
/// cosines, `turn` the angle around the old direction in turns.
fn scatter(direction: vec3f, u: f32, turn: f32) -> vec3f {
    let cosine = clamp(phase_cosine(u), -1.0, 1.0);
    let sine = sqrt(1.0 - cosine * cosine);
    let n = direction;
    // T. Duff et al., Building an Orthonormal Basis, Revisited, 2017.
    let side = select(-1.0, 1.0, n.z >= 0.0);
    let a = -1.0 / (side + n.z);
    let b = n.x * n.y * a;
    let tangent = vec3f(1.0 + side * n.x * n.x * a, side * b, -side * n.x);
    let bitangent = vec3f(b, side + n.y * n.y * a, -n.y);
    return normalize(sine * (sin_pi(2.0 * turn + 0.5) * tangent + sin_pi(2.0 * turn) * bitangent) + cosine * n);
}
