// Begins a batch: no photons in the lanes, nothing counted.

fn each(i: i32) {
    store_lanes(i, 0u);
    let done = load_tallies(PHOTONS);
    var word = 0u;
    if i == COUNT {
        word = min(params.batch, load_tallies(LAST) - done);
    } else if i == FIRST {
        word = done;
    }
    store_score(i, word);
}
