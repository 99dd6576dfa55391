// The vertices and triangles of each row.

fn each(row: i32) {
    let yz = row_place(row);
    var near = near_words(0, yz);
    var vertices = 0u;
    var triangles = 0u;
    for (var w = 0; w < ROW_WORDS; w++) {
        let next = near_words(w + 1, yz);
        let far = shifted(near, next);
        let edges = (vec3u(near.x) ^ vec3u(far.x, near.y, near.z)) & vec3u(points_of(w));
        let owned = countOneBits(edges);
        vertices += owned.x + owned.y + owned.z;
        var cells = crossed_cells(w, yz, near, far);
        while cells != 0u {
            triangles += load_cases(case_at(near, far, firstTrailingBit(cells)));
            cells &= cells - 1u;
        }
        near = next;
    }
    store_vertices(row, vertices);
    store_triangles(row, triangles);
}
