// (A·in + B)^(1/gamma), A = multiply·(gain − lift), B = offset + lift

import package::lib::number::signed_pow;

fn apply(image: vec4f) -> vec4f {
    let a = params.multiply * (params.gain - params.lift);
    let v = a * image.rgb + params.offset + params.lift;
    let p = 1.0 / params.gamma;
    return vec4f(signed_pow(v.r, p.r), signed_pow(v.g, p.g), signed_pow(v.b, p.b), image.a);
}
