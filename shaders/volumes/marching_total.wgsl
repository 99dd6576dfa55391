// How many vertices and triangles there are: the last sums.

fn at(i: i32) -> u32 {
    if i == 0 {
        return load_vertex_sums(size_vertex_sums() - 1);
    }
    return load_triangle_sums(size_triangle_sums() - 1);
}
