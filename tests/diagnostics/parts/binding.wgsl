@group(0) @binding(0) var image: texture_2d<f32>;

fn at(xy: vec2i) -> vec4f {
    return textureLoad(image, xy, 0);
}
