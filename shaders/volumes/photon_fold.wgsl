// Adds a batch to the photons so far: one call for each voxel, and one more for what is counted of all.

fn wide(low: u32, high: u32) -> f32 {
    return f32(high) * 4294967296.0 + f32(low);
}

fn add_wide(at: i32) {
    let before = load_tallies(at);
    let low = before + load_score(at);
    let carry = load_score(at + 1) + select(0u, 1u, low < before);
    let above = load_tallies(at + 1) + carry;
    if above < carry {
        store_tallies(OVERFLOWS, 1u);
    }
    store_tallies(at, low);
    store_tallies(at + 1, above);
}

/// Σ n·(x − mean)² over batches of n photons and mean x: D. West, Updating Mean and Variance Estimates, 1979.
fn add_square(voxel: i32) {
    let at = VOXELS + 4 * voxel;
    let count = f32(load_score(COUNT));
    let before = f32(load_score(FIRST));
    if before > 0.0 && count > 0.0 {
        let apart = wide(load_score(at), load_score(at + 1)) / count - wide(load_tallies(at), load_tallies(at + 1)) / before;
        let square = VOXELS + 4 * params.voxels + voxel;
        let sum = bitcast<f32>(load_tallies(square)) + apart * apart * (count * (before / (before + count)));
        store_tallies(square, bitcast<u32>(sum));
    }
}

fn each(i: i32) {
    if i < params.voxels {
        add_square(i);
        add_wide(VOXELS + 4 * i);
        add_wide(VOXELS + 4 * i + 2);
        return;
    }
    store_tallies(PHOTONS, load_tallies(PHOTONS) + load_score(COUNT));
    store_tallies(BATCHES, load_tallies(BATCHES) + min(load_score(COUNT), 1u));
    if load_score(OVERFLOWS) > 0u {
        store_tallies(OVERFLOWS, 1u);
    }
    for (var pair = ALIVE; pair < VOXELS; pair += 2) {
        add_wide(pair);
    }
}
