// max(in·slope + offset, 0)^power, then saturation

import package::lib::color::luminance;
import package::lib::number::safe_pow;

fn apply(image: vec4f) -> vec4f {
    let v = image.rgb * params.slope + params.offset;
    let c = vec3f(safe_pow(v.r, params.power.r), safe_pow(v.g, params.power.g), safe_pow(v.b, params.power.b));
    let y = luminance(c);
    return vec4f(y + params.saturation * (c - y), image.a);
}
