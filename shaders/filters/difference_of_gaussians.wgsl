// The finer less the coarser blur.

fn apply(fine: vec4f, coarse: vec4f) -> vec4f {
    return vec4f(fine.rgb - coarse.rgb, 1.0);
}
