// Constants RED, GREEN, BLUE, ALPHA: 0..3 a channel, 4 zero, 5 one.

fn pick(image: vec4f, from_channel: i32) -> f32 {
    if from_channel == 4 {
        return 0.0;
    }
    if from_channel == 5 {
        return 1.0;
    }
    return image[from_channel];
}

fn apply(image: vec4f) -> vec4f {
    return vec4f(pick(image, RED), pick(image, GREEN), pick(image, BLUE), pick(image, ALPHA));
}
