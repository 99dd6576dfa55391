// a·I + b, where I is the luminance of the guide

import package::lib::color::luminance;

fn apply(guide: vec4f, slope: vec4f, offset: vec4f) -> vec4f {
    return slope * luminance(guide.rgb) + offset;
}
