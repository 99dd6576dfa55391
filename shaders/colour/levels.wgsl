// out_low + (out_high − out_low)·t^(1/gamma)

import package::lib::number::signed_pow;

fn apply(image: vec4f) -> vec4f {
    let width = params.in_high - params.in_low;
    let t = (image.rgb - params.in_low) / select(width, 1.0, width == 0.0);
    let p = vec3f(signed_pow(t.r, params.power), signed_pow(t.g, params.power), signed_pow(t.b, params.power));
    return vec4f(params.out_low + (params.out_high - params.out_low) * p, image.a);
}
