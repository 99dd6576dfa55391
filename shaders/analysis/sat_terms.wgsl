// What a summed-area table sums: the value, or the logarithm of what is above 0; 0 for NaN and infinity.

fn apply(image: vec4f) -> vec4f {
    let finite = (bitcast<vec4u>(image) & vec4u(0x7f800000u)) != vec4u(0x7f800000u);
    var term = image;
    if LOGARITHM {
        term = log(params.epsilon + max(image, vec4f()));
    }
    return select(vec4f(), term, finite);
}
