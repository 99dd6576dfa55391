// a·(1 − t) + b·t with t = factor · luminance of the mask (a grey mask has equal channels)

import package::lib::color::luminance;

fn apply(a: vec4f, b: vec4f, mask: vec4f) -> vec4f {
    let t = params.factor * luminance(mask.rgb);
    return a * (1.0 - t) + b * t;
}
