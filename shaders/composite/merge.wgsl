// a layered onto b; OP is the position in the enum of merge.rs.

import package::lib::extremes::{minimum, maximum};

fn merged(a: vec4f, b: vec4f) -> vec4f {
    switch OP {
        case 0: { return a + b * (1.0 - a.a); }
        case 1: { return a * (1.0 - b.a) + b; }
        case 2: { return a * b.a; }
        case 3: { return a * (1.0 - b.a); }
        case 4: { return a * b.a + b * (1.0 - a.a); }
        case 5: { return a * (1.0 - b.a) + b * (1.0 - a.a); }
        case 6: { return a + b; }
        case 7: { return a - b; }
        case 8: { return abs(a - b); }
        case 9: { return select(a * b, a, (a < vec4f(0.0)) & (b < vec4f(0.0))); }
        case 10: {
            let within = (a >= vec4f(0.0)) & (a <= vec4f(1.0)) & (b >= vec4f(0.0)) & (b <= vec4f(1.0));
            return select(maximum(a, b), a + b - a * b, within);
        }
        case 11: { return select(1.0 - 2.0 * (1.0 - a) * (1.0 - b), 2.0 * a * b, b < vec4f(0.5)); }
        case 12: { return select(2.0 * a * b, b * (2.0 * a + b * (1.0 - a * b)), a * b < vec4f(1.0)); }
        case 13: {
            let zero = (b == vec4f(0.0)) | ((a < vec4f(0.0)) & (b < vec4f(0.0)));
            return select(a / select(b, vec4f(1.0), zero), vec4f(0.0), zero);
        }
        case 14: { return maximum(a, b); }
        default: { return minimum(a, b); }
    }
}

fn apply(a: vec4f, b: vec4f) -> vec4f {
    let full = merged(a, b);
    if WHOLE {
        return full;
    }
    return b * (1.0 - params.mix) + full * params.mix;
}
