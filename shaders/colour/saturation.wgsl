// Y + factor·(c − Y)

import package::lib::color::luminance;

fn apply(image: vec4f) -> vec4f {
    let y = luminance(image.rgb);
    return vec4f(y + params.factor * (image.rgb - y), image.a);
}
