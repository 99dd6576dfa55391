// Begins where an earlier result ended; with nothing when there is none (a table of one 0).

fn at(i: i32) -> u32 {
    let before = load_earlier(i);
    let last = load_earlier(PHOTONS) + params.photons;
    if i == LAST {
        return last;
    }
    if i == OVERFLOWS && last < params.photons {
        // More photons than can be counted.
        return before + 1u;
    }
    return before;
}
