// The luminances of both images side by side.

import package::lib::wide::grey_luminance;

fn apply(a: vec4f, b: vec4f) -> vec4f {
    return vec4f(grey_luminance(a.rgb), grey_luminance(b.rgb), 0.0, 1.0);
}
