// One step of an explicit integrator. ∇² is linear, so ∇² of a state half a step ahead is a sum of those of u and v,
// and every integrator needs one pass. METHOD is the position in the enum of wave_equation.rs.

fn at(xy: vec2i) -> vec4f {
    let u = load_state(xy).x;
    let v = load_state(xy).y;
    let l = curvature(xy);
    let g = resistance(xy);
    let h = params.dt;
    let a = l.x - g * v;
    switch METHOD {
        case 0: {
            return vec4f(u + h * v, v + h * a, 0.0, 1.0);
        }
        case 1: {
            let next = v + h * a;
            return vec4f(u + h * next, next, 0.0, 1.0);
        }
        case 2: {
            let middle = v + 0.5 * h * a;
            return vec4f(u + h * middle, v + h * (l.x + 0.5 * h * l.y - g * middle), 0.0, 1.0);
        }
        default: {
            let end = v + h * a;
            return vec4f(u + 0.5 * h * (v + end), v + 0.5 * h * (a + (l.x + h * l.y - g * end)), 0.0, 1.0);
        }
    }
}
