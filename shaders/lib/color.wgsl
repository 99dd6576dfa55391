// Luminance and transfer functions of linear Rec.709 light.

/// Y = 0.2126 R + 0.7152 G + 0.0722 B (ITU-R BT.709-6).
fn luminance(c: vec3f) -> f32 {
    return 0.2126 * c.r + 0.7152 * c.g + 0.0722 * c.b;
}
