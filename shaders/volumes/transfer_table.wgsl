fn entry(i: i32) -> vec4f {
    return vec4f(load_transfer(4 * i), load_transfer(4 * i + 1), load_transfer(4 * i + 2), load_transfer(4 * i + 3));
}

fn emptiness(p: vec3f, direction: vec3f) -> f32 {
    let here = brick(p, direction);
    return select(0.0, here.length, here.extreme <= load_threshold().r);
}

fn transfer(p: vec3f) -> vec4f {
    let last = size_transfer() / 4 - 1;
    let place = clamp(sample_volume(p).r, 0.0, 1.0) * f32(last);
    let first = i32(place);
    let v = mix(entry(first), entry(min(first + 1, last)), place - f32(first));
    return vec4f(v.rgb, clamp(v.a, 0.0, 1.0));
}
