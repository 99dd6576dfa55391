// How a fold comes from its lanes to what it leaves: PARTS vectors for each partial, component after component, each a run
// of as many floats as there are partials. Stands behind a fold that has `part(i)`, the i-th of its vectors, and
// `absorb(at)`, which takes in another lane's from the scratch. Constants: PARTS, LEFT (partials that a group leaves: 1, or
// one a lane).

fn end() {
    for (var half = LANES / 2; half >= LEFT; half /= 2) {
        if lane() >= half && lane() < 2 * half {
            for (var i = 0; i < PARTS; i++) {
                scratch_store(PARTS * (lane() - half) + i, part(i));
            }
        }
        workgroupBarrier();
        if lane() < half {
            absorb(PARTS * lane());
        }
        workgroupBarrier();
    }
    if lane() < LEFT {
        let index = group() * LEFT + lane();
        let n = size_partials() / (4 * PARTS);
        for (var i = 0; i < PARTS; i++) {
            let v = part(i);
            for (var c = 0; c < 4; c++) {
                store_partials((4 * i + c) * n + index, v[c]);
            }
        }
    }
}
