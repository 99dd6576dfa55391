// The operations of `Math`; OP is the position in the enum of math.rs.

import package::lib::extremes::{minimum, maximum};
import package::lib::power::real_power;
import package::lib::remainder::floor_remainder;

const LEAST: f32 = 1.17549435e-38;
const LARGEST: f32 = 3.40282347e38;

fn operation(a: vec4f, b: vec4f) -> vec4f {
    switch OP {
        case 0: { return a + b; }
        case 1: { return a - b; }
        case 2: { return a * b; }
        case 3: {
            let nan = (bitcast<vec4u>(a) & vec4u(0x7fffffffu)) > vec4u(0x7f800000u);
            let zero = b == vec4f(0.0);
            return select(a / select(b, vec4f(1.0), zero), vec4f(0.0), zero & !nan);
        }
        case 4: { return vec4f(power(a.r, b.r), power(a.g, b.g), power(a.b, b.b), a.a); }
        case 5: { return minimum(a, b); }
        case 6: { return maximum(a, b); }
        case 7: { return abs(a); }
        case 8: { return sqrt(maximum(a, vec4f(0.0))); }
        case 9: { return select(exp(minimum(a, vec4f(88.0))), a, a > vec4f(LARGEST)); }
        case 10: { return log(maximum(a, vec4f(LEAST))); }
        default: {
            return vec4f(floor_remainder(a.r, b.r), floor_remainder(a.g, b.g), floor_remainder(a.b, b.b), a.a);
        }
    }
}

fn power(x: f32, y: f32) -> f32 {
    if (x == 0.0 && y < 0.0) || (x < 0.0 && y != trunc(y)) {
        return 0.0;
    }
    return real_power(x, y);
}
