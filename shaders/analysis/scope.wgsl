// The counts of a scope → its picture, by the logarithm of each count. Rows of cells go up.
//
// Constants: WIDTH and HEIGHT of a panel in cells, LAYOUT 0 grey, 1 three panels above each other, 2 three panels
// side by side, 3 in the colour of the chroma.

fn shown(panel: i32, x: i32, y: i32) -> f32 {
    let largest = load_largest(0);
    if largest == 0u {
        return 0.0;
    }
    let n = load_counts((panel * HEIGHT + HEIGHT - 1 - y) * WIDTH + x);
    return log2(1.0 + f32(n)) / log2(1.0 + f32(largest));
}

fn at(xy: vec2i) -> vec4f {
    if LAYOUT == 1 {
        return vec4f(shown(0, xy.x, xy.y), shown(1, xy.x, xy.y), shown(2, xy.x, xy.y), 1.0);
    }
    if LAYOUT == 2 {
        let panel = xy.x / WIDTH;
        let v = shown(panel, xy.x % WIDTH, xy.y);
        return vec4f(select(vec3f(), vec3f(v), vec3i(0, 1, 2) == vec3i(panel)), 1.0);
    }
    let v = shown(0, xy.x, xy.y);
    if LAYOUT == 3 {
        // BT.709: R = Y + 1.5748 Cr, B = Y + 1.8556 Cb, at Y = 0.5.
        let cb = (f32(xy.x) + 0.5) / f32(WIDTH) - 0.5;
        let cr = (f32(HEIGHT - 1 - xy.y) + 0.5) / f32(HEIGHT) - 0.5;
        let r = 0.5 + 1.5748 * cr;
        let b = 0.5 + 1.8556 * cb;
        let g = (0.5 - 0.2126 * r - 0.0722 * b) / 0.7152;
        return vec4f(clamp(vec3f(r, g, b), vec3f(), vec3f(1.0)) * v, 1.0);
    }
    return vec4f(v);
}
