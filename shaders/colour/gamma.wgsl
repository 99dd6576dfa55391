// |c|^(1/gamma) with the sign of c

import package::lib::number::signed_pow;

fn apply(image: vec4f) -> vec4f {
    let c = image.rgb;
    return vec4f(signed_pow(c.r, params.power), signed_pow(c.g, params.power), signed_pow(c.b, params.power), image.a);
}
