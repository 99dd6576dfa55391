// Both gradients from the same eight pixels.

fn each(xy: vec2i) {
    let a = load_image(xy + vec2i(-1, -1)).rgb;
    let b = load_image(xy + vec2i(0, -1)).rgb;
    let c = load_image(xy + vec2i(1, -1)).rgb;
    let d = load_image(xy + vec2i(-1, 0)).rgb;
    let e = load_image(xy + vec2i(1, 0)).rgb;
    let f = load_image(xy + vec2i(-1, 1)).rgb;
    let g = load_image(xy + vec2i(0, 1)).rgb;
    let h = load_image(xy + vec2i(1, 1)).rgb;
    let gx = (c - a) + 2.0 * (e - d) + (h - f);
    let gy = (f - a) + 2.0 * (g - b) + (h - c);
    store_out(xy, vec4f(sqrt(gx * gx + gy * gy), 1.0));
    store_gx(xy, vec4f(gx, 1.0));
    store_gy(xy, vec4f(gy, 1.0));
}
