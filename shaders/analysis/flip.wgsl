// Along columns, then the perceived difference: of what the eye sees of the colours, raised where features differ.

struct Seen {
    lab: vec3f,
    edge: f32,
    dot_like: f32,
}

fn lightness_curve(t: f32) -> f32 {
    let d = 6.0 / 29.0;
    if t > d * d * d {
        return pow(t, 1.0 / 3.0);
    }
    return t / (3.0 * d * d) + 4.0 / 29.0;
}

/// CIELAB of linear sRGB, with Hunt's adjustment: chroma shrinks with lightness.
fn hunt_lab(c: vec3f) -> vec3f {
    let x = lightness_curve(dot(vec3f(0.43389539, 0.37624237, 0.18986224), c));
    let y = lightness_curve(dot(vec3f(0.21263682, 0.71518298, 0.07218020), c));
    let z = lightness_curve(dot(vec3f(0.01775242, 0.10946563, 0.87278195), c));
    let lightness = 116.0 * y - 16.0;
    return vec3f(lightness, 0.01 * lightness * 500.0 * (x - y), 0.01 * lightness * 200.0 * (y - z));
}

fn colour_seen(v: vec4f) -> vec3f {
    let y = (v.x + 16.0) / 116.0;
    let xyz = vec3f(y + v.y / 500.0, y, y - (v.z + v.w) / 200.0);
    let r = dot(vec3f(3.08034199, -1.53739897, -0.54294302), xyz);
    let g = dot(vec3f(-0.92117840, 1.87592998, 0.04524841), xyz);
    let b = dot(vec3f(0.05288129, -0.20401121, 1.15112991), xyz);
    return hunt_lab(clamp(vec3f(r, g, b), vec3f(), vec3f(1.0)));
}

fn seen_a(xy: vec2i) -> Seen {
    let n = 2 * RADIUS + 1;
    var colour = vec4f();
    var edge = vec2f();
    var dots = vec2f();
    for (var k = 0; k < n; k++) {
        let place = xy + vec2i(0, k - RADIUS);
        let f = load_features_a(place);
        let smooth_weight = load_weights(4 * n + k);
        colour += vec4f(load_weights(k), load_weights(n + k), load_weights(2 * n + k), load_weights(3 * n + k)) * load_colours_a(place);
        edge += vec2f(f.y * smooth_weight, f.x * load_weights(5 * n + k));
        dots += vec2f(f.z * smooth_weight, f.x * load_weights(6 * n + k));
    }
    return Seen(colour_seen(colour), length(edge) / 116.0, length(dots) / 116.0);
}

fn seen_b(xy: vec2i) -> Seen {
    let n = 2 * RADIUS + 1;
    var colour = vec4f();
    var edge = vec2f();
    var dots = vec2f();
    for (var k = 0; k < n; k++) {
        let place = xy + vec2i(0, k - RADIUS);
        let f = load_features_b(place);
        let smooth_weight = load_weights(4 * n + k);
        colour += vec4f(load_weights(k), load_weights(n + k), load_weights(2 * n + k), load_weights(3 * n + k)) * load_colours_b(place);
        edge += vec2f(f.y * smooth_weight, f.x * load_weights(5 * n + k));
        dots += vec2f(f.z * smooth_weight, f.x * load_weights(6 * n + k));
    }
    return Seen(colour_seen(colour), length(edge) / 116.0, length(dots) / 116.0);
}

fn at(xy: vec2i) -> vec4f {
    let a = seen_a(xy);
    let b = seen_b(xy);
    let d = a.lab - b.lab;
    let raised = pow(abs(d.x) + length(d.yz), 0.7);
    // The larger part of the range is given to small differences.
    let knee = 0.4 * params.most;
    var colour = 0.95 + (raised - knee) / (params.most - knee) * 0.05;
    if raised < knee {
        colour = 0.95 / knee * raised;
    }
    let feature = sqrt(max(abs(a.edge - b.edge), abs(a.dot_like - b.dot_like)) / sqrt(2.0));
    return vec4f(pow(colour, 1.0 - feature));
}
