// floor(v·steps + t)/steps, t from a tile of SIDE×SIDE thresholds

import package::lib::color::keep_nan;

fn apply(image: vec4f) -> vec4f {
    let place = pixel() % SIDE;
    let t = load_thresholds(place.y * SIDE + place.x);
    let v = clamp(image.rgb, vec3f(0.0), vec3f(1.0));
    // Of many levels the sum may round up to one more.
    let level = min(floor(v * params.steps + t), vec3f(params.steps));
    return vec4f(keep_nan(level / params.steps, image.rgb), image.a);
}
