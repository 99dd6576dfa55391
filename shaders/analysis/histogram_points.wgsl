// One point a pixel, blended additively into the pixel of its bin.
//
// The target holds bins in rows of WIDTH, and as many sets of ROWS rows as it takes for no set to count more than
// 2^24 pixels, up to which a float counts exactly. Constants beside those: SETS, BINS, CHANNEL, CLAMPED.

import package::lib::wide::bin_of_pixel;

fn vertex(index: u32) -> vec4f {
    let width = u32(size_image().x);
    let pixel = load_image(vec2i(vec2u(index % width, index / width)));
    let bin = bin_of_pixel(pixel, CHANNEL, params.low, params.high, BINS, CLAMPED);
    if bin < 0 {
        return vec4f();
    }
    let set_index = i32(index >> 24u);
    let place = vec2f(vec2i(bin % WIDTH, bin / WIDTH + set_index * ROWS)) + 0.5;
    let clip = place / vec2f(f32(WIDTH), f32(ROWS * SETS)) * 2.0 - 1.0;
    return vec4f(clip.x, -clip.y, 0.0, 1.0);
}

fn fragment() -> vec4f {
    return vec4f(1.0);
}
