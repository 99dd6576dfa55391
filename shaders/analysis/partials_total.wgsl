// What `partials.wgsl` left, for the pass that adds it up: `count_of_partials()`, and the vector `part` of partial `index`.

fn count_of_partials() -> i32 {
    return size_partials() / (4 * PARTS);
}

fn run_of(part: i32, index: i32) -> vec4f {
    let n = count_of_partials();
    let first = part * 4 * n + index;
    return vec4f(load_partials(first), load_partials(first + n), load_partials(first + 2 * n), load_partials(first + 3 * n));
}
