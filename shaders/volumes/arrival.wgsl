// The light that arrives at a point when nothing is in its way. LIGHT: 0 a point, 2 a rectangle.

struct Arrival {
    /// Where it comes from, and how far away that is.
    towards: vec3f,
    distance: f32,
    /// Power per area across its direction; 0 where none arrives.
    irradiance: f32,
}

fn arrival(p: vec3f) -> Arrival {
    let aside = p - params.light_origin;
    if LIGHT == 0 {
        let distance = max(length(aside), 1e-6);
        return Arrival(-aside / distance, distance, 0.0795774715 / (distance * distance));
    }
    let squares = vec2f(dot(params.light_right, params.light_right), dot(params.light_up, params.light_up));
    let across = abs(vec2f(dot(aside, params.light_right), dot(aside, params.light_up)));
    let distance = dot(aside, params.light_direction);
    let lit = all(across <= 0.5 * squares) && distance > 0.0;
    return Arrival(-params.light_direction, distance, select(0.0, inverseSqrt(squares.x) * inverseSqrt(squares.y), lit));
}
