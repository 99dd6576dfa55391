// (I, I²), where I is the luminance of the guide

import package::lib::color::luminance;

fn apply(guide: vec4f) -> vec4f {
    let y = luminance(guide.rgb);
    return vec4f(y, y * y, 0.0, 1.0);
}
