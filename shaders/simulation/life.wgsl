// One generation in each colour channel; bit n of `birth` and `survival` stands for n living neighbours.

fn living(xy: vec2i) -> vec3u {
    return select(vec3u(0u), vec3u(1u), load_image(xy).rgb > vec3f(0.5));
}

fn at(xy: vec2i) -> vec4f {
    let here = load_image(xy);
    let above = living(xy + vec2i(-1, -1)) + living(xy + vec2i(0, -1)) + living(xy + vec2i(1, -1));
    let below = living(xy + vec2i(-1, 1)) + living(xy + vec2i(0, 1)) + living(xy + vec2i(1, 1));
    let n = above + below + living(xy - vec2i(1, 0)) + living(xy + vec2i(1, 0));
    let rule = select(vec3u(params.birth), vec3u(params.survival), here.rgb > vec3f(0.5));
    return vec4f(vec3f((rule >> n) & vec3u(1u)), here.a);
}
