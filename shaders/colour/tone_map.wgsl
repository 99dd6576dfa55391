// OPERATOR: 0 Reinhard, 1 ReinhardSimple, 2 Hable, 3 AcesFit, 4 AgX, 5 Linear.

import package::lib::color::luminance;
import package::lib::number::is_nan;

/// Hable's curve over x, brought over one denominator: the difference of two fractions would cancel near 0.
fn hable_gain(x: f32) -> f32 {
    return (0.042 * x + 0.005) / (0.3 * (x * (0.15 * x + 0.5) + 0.06));
}

fn aces_curve(c: vec3f) -> vec3f {
    // Beyond 10^6 the curve is at its end, and squares would overflow.
    let x = clamp(c, vec3f(0.0), vec3f(1e6));
    return clamp((x * (2.51 * x + 0.03)) / (x * (2.43 * x + 0.59) + 0.14), vec3f(0.0), vec3f(1.0));
}

fn agx_curve(c: vec3f) -> vec3f {
    let inset = vec3f(
        dot(vec3f(0.842479062253094, 0.0784335999999992, 0.0792237451477643), c),
        dot(vec3f(0.0423282422610123, 0.878468636469772, 0.0791661274605434), c),
        dot(vec3f(0.0423756549057051, 0.0784336, 0.879142973793104), c),
    );
    let stops = clamp(log2(max(inset, vec3f(1e-10))), vec3f(-12.47393), vec3f(4.026069));
    let x = (stops + 12.47393) / 16.499999;
    let x2 = x * x;
    let x4 = x2 * x2;
    let s = 15.5 * x4 * x2 - 40.14 * x4 * x + 31.96 * x4 - 6.868 * x2 * x + 0.4298 * x2 + 0.1191 * x - 0.00232;
    let outset = vec3f(
        dot(vec3f(1.19687900512017, -0.0980208811401368, -0.0990297440797205), s),
        dot(vec3f(-0.0528968517574562, 1.15190312990417, -0.0989611768448433), s),
        dot(vec3f(-0.0529716355144438, -0.0980434501171241, 1.15107367264116), s),
    );
    return pow(max(outset, vec3f(0.0)), vec3f(2.2));
}

/// The curve's value over its argument.
fn gain(yr: f32) -> f32 {
    // The pole at -1, where only noise and interpolation lead, stays finite.
    let one = 1.0 + yr;
    let denominator = select(one, select(1e-6, -1e-6, one < 0.0), abs(one) < 1e-6);
    if OPERATOR == 0 {
        return (1.0 + yr / (params.white * params.white)) / denominator;
    }
    if OPERATOR == 1 {
        return 1.0 / denominator;
    }
    if OPERATOR == 2 {
        return hable_gain(abs(yr)) / (hable_gain(params.white) * params.white);
    }
    return 1.0;
}

fn apply(image: vec4f) -> vec4f {
    let y = luminance(image.rgb);
    if y == 0.0 {
        return vec4f(0.0, 0.0, 0.0, image.a);
    }
    if is_nan(y) {
        return vec4f(vec3f(y), image.a);
    }
    let scale = params.key / max(params.average, 1e-30);
    if OPERATOR == 3 {
        return vec4f(aces_curve(image.rgb * scale), image.a);
    }
    if OPERATOR == 4 {
        return vec4f(agx_curve(image.rgb * scale), image.a);
    }
    return vec4f(image.rgb * (scale * gain(y * scale)), image.a);
}
