// (A·in + B)^(1/gamma), A = multiply·(gain − lift), B = offset + lift; power = 1/gamma

fn raise(v: f32, p: f32) -> f32 {
    // NaN and what is not above 0 stay.
    if v > 0.0 {
        return pow(v, p);
    }
    return v;
}

fn apply(image: vec4f) -> vec4f {
    let a = params.multiply * (params.gain - params.lift);
    let v = a * image.rgb + params.offset + params.lift;
    let p = params.power;
    return vec4f(raise(v.r, p.r), raise(v.g, p.g), raise(v.b, p.b), image.a);
}
