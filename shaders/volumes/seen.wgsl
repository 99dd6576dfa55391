// A picture from (radiance, optical depth).

import package::lib::attenuation::stopped;

fn apply(state: vec4f) -> vec4f {
    return vec4f(vec3f(state.x), stopped(state.y));
}
