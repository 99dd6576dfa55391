// Σ k(i, j)·in(x − i, y − j)

fn at(xy: vec2i) -> vec4f {
    var sum = vec4f();
    for (var j = -RY; j <= RY; j++) {
        for (var i = -RX; i <= RX; i++) {
            let k = load_kernel((j + RY) * (2 * RX + 1) + i + RX);
            sum += k * load_image(xy - vec2i(i, j));
        }
    }
    return sum;
}
