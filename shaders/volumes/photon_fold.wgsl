// Adds a batch to the photons so far: one call for each voxel, and one more for what is counted of all.

fn wide(sum: vec2u) -> f32 {
    return f32(sum.y) * 4294967296.0 + f32(sum.x);
}

/// p + q of integers of two words.
fn add(p: vec2u, q: vec2u) -> vec2u {
    let low = p.x + q.x;
    let carry = q.y + select(0u, 1u, low < p.x);
    let high = p.y + carry;
    if high < carry {
        store_tallies(OVERFLOWS, 1u);
    }
    return vec2u(low, high);
}

/// What the batch counted at an entry of a voxel.
fn counted(entry: i32) -> vec2u {
    var sum = vec2u();
    for (var bank = 0; bank < BANKS; bank++) {
        let at = entry + 4 * params.voxels * bank;
        sum = add(sum, vec2u(load_score(at), load_score(at + 1)));
    }
    return sum;
}

fn so_far(at: i32) -> vec2u {
    return vec2u(load_tallies(at), load_tallies(at + 1));
}

fn add_wide(at: i32, more: vec2u) {
    let sum = add(so_far(at), more);
    store_tallies(at, sum.x);
    store_tallies(at + 1, sum.y);
}

/// Σ n·(x − mean)² over batches of n photons and mean x: D. West, Updating Mean and Variance Estimates, 1979.
fn add_square(voxel: i32, fluence: vec2u) {
    let count = f32(load_score(COUNT));
    let before = f32(load_score(FIRST));
    if before > 0.0 && count > 0.0 {
        let apart = wide(fluence) / count - wide(so_far(VOXELS + 4 * voxel)) / before;
        let square = VOXELS + 4 * params.voxels + voxel;
        let sum = bitcast<f32>(load_tallies(square)) + apart * apart * (count * (before / (before + count)));
        store_tallies(square, bitcast<u32>(sum));
    }
}

fn each(i: i32) {
    if i < params.voxels {
        let at = VOXELS + 4 * i;
        let fluence = counted(at);
        add_square(i, fluence);
        add_wide(at, fluence);
        add_wide(at + 2, counted(at + 2));
        return;
    }
    store_tallies(PHOTONS, load_tallies(PHOTONS) + load_score(COUNT));
    store_tallies(BATCHES, load_tallies(BATCHES) + min(load_score(COUNT), 1u));
    if load_score(OVERFLOWS) > 0u {
        store_tallies(OVERFLOWS, 1u);
    }
    for (var pair = ALIVE; pair < VOXELS; pair += 2) {
        add_wide(pair, vec2u(load_score(pair), load_score(pair + 1)));
    }
}
