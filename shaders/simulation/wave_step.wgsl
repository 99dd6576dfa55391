// The single passes of `WaveStep`; METHOD is the position in its enum.

fn at(xy: vec2i) -> vec4f {
    let s = load_state(xy);
    let g = resistance(xy);
    let h = params.dt;
    switch METHOD {
        case 0: {
            return vec4f(s.x + h * s.y, s.y + h * (curvature(xy).x - g * s.y), s.zw);
        }
        case 1: {
            return vec4f(s.xy, s.x + 0.5 * h * s.y, s.y + 0.5 * h * (curvature(xy).x - g * s.y));
        }
        default: {
            return vec4f(s.x + h * s.w, s.y + h * (curvature(xy).z - g * s.w), s.zw);
        }
    }
}
