// The vertices and triangles of each row.

fn each(row: i32) {
    let yz = row_place(row);
    var here = near_insides(0, yz);
    var vertices = 0u;
    var triangles = 0u;
    for (var x = 0; x < params.points.x; x++) {
        let next = near_insides(x + 1, yz);
        // The first row's own edges need no row behind these four.
        vertices += countOneBits(owned(here, next).x);
        if has_cells(yz) && x + 1 < params.points.x {
            triangles += load_cases(case_at(here, next));
        }
        here = next;
    }
    store_vertices(row, vertices);
    store_triangles(row, triangles);
}
