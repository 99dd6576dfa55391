// Squares whose column and row are both even or both odd are of the first colour.

fn apply() -> vec4f {
    let square = pixel() / params.cell;
    return select(params.b, params.a, ((square.x + square.y) & 1) == 0);
}
