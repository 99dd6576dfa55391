// a = cov(I, p)/(var(I) + ε), from the means of p, p·I and (I, I²)

fn apply(image: vec4f, products: vec4f, powers: vec4f) -> vec4f {
    let variance = max(powers.y - powers.x * powers.x, 0.0);
    return (products - powers.x * image) / (variance + params.eps);
}
