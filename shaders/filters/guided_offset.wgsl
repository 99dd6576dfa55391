// b = mean(p) − a·mean(I)

fn apply(image: vec4f, powers: vec4f, slope: vec4f) -> vec4f {
    return image - slope * powers.x;
}
