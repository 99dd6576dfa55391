// One step of Gray & Scott's model; the state is (U, V).

fn at(xy: vec2i) -> vec4f {
    let s = load_state(xy).xy;
    let across = (load_state(xy - vec2i(1, 0)).xy - s) + (load_state(xy + vec2i(1, 0)).xy - s);
    let down = (load_state(xy - vec2i(0, 1)).xy - s) + (load_state(xy + vec2i(0, 1)).xy - s);
    let reacted = s.x * s.y * s.y;
    let gain = vec2f(params.feed * (1.0 - s.x) - reacted, reacted - (params.feed + params.kill) * s.y);
    return vec4f(s + params.dt * (params.diffusivity * (across + down) + gain), 0.0, 1.0);
}
