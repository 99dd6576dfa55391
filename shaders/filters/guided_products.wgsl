// p·I, where I is the luminance of the guide

import package::lib::color::luminance;

fn apply(image: vec4f, guide: vec4f) -> vec4f {
    return image * luminance(guide.rgb);
}
