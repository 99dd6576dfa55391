// Lets threads take more pixels.

fn each(i: i32) {
    store_score(LIMIT, min(load_score(LIMIT) + params.slice, params.pixels));
}
