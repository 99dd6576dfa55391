// equation(src·src_factor, dst·dst_factor); the numbers are the positions in the enums of blend.rs.

import package::lib::extremes::{minimum, maximum};

fn factor(kind: i32, s: vec4f, d: vec4f) -> vec4f {
    switch kind {
        case 0: { return vec4f(0.0); }
        case 1: { return vec4f(1.0); }
        case 2: { return s; }
        case 3: { return 1.0 - s; }
        case 4: { return d; }
        case 5: { return 1.0 - d; }
        case 6: { return vec4f(s.a); }
        case 7: { return vec4f(1.0 - s.a); }
        case 8: { return vec4f(d.a); }
        case 9: { return vec4f(1.0 - d.a); }
        case 10: { return params.constant; }
        case 11: { return 1.0 - params.constant; }
        case 12: { return vec4f(params.constant.a); }
        case 13: { return vec4f(1.0 - params.constant.a); }
        default: { return vec4f(vec3f(min(s.a, 1.0 - d.a)), 1.0); }
    }
}

fn apply(src: vec4f, dst: vec4f) -> vec4f {
    switch EQUATION {
        case 0: { return src * factor(SRC_FACTOR, src, dst) + dst * factor(DST_FACTOR, src, dst); }
        case 1: { return src * factor(SRC_FACTOR, src, dst) - dst * factor(DST_FACTOR, src, dst); }
        case 2: { return dst * factor(DST_FACTOR, src, dst) - src * factor(SRC_FACTOR, src, dst); }
        case 3: { return minimum(src, dst); }
        default: { return maximum(src, dst); }
    }
}
