// A run of a table into another table; entries are not rounded on the way.

fn at(i: i32) -> Entry {
    let k = i - params.dst_origin.x;
    if k < 0 || k >= params.extent.x {
        return load_dst(i);
    }
    return entry(load_src(params.src_origin.x + k));
}
