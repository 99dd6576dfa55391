// The vertices of each row's own edges, and the triangles of its cells. `vertex_sums` and `triangle_sums` count all rows up
// to and including each.

fn place(p: vec3i) -> vec3f {
    return (vec3f(p - PAD) + 0.5) / vec3f(size_volume());
}

fn store_vertex(number: u32, p: vec3i, axis: i32) {
    var q = p;
    q[axis]++;
    let a = load_volume(p - PAD).r;
    let b = load_volume(q - PAD).r;
    let vertex = mix(place(p), place(q), clamp((params.iso - a) / (b - a), 0.0, 1.0));
    var normal = facing(gradient(vertex) / params.extent);
    if all(normal == vec3f(0.0)) {
        normal[axis] = sign(a - b);
    }
    for (var i = 0; i < 3; i++) {
        store_vertices(i32(6u * number) + i, vertex[i] * params.extent[i]);
        store_vertices(i32(6u * number) + 3 + i, normal[i]);
    }
}

/// The first vertex of a row, which may have no points.
fn first_vertex(yz: vec2i) -> u32 {
    let row = yz.y * params.points.y + yz.x;
    return select(0u, load_vertex_sums(row - 1), row > 0 && all(yz < params.points.yz));
}

/// Whether the surface does not come near a row.
fn is_empty(row: i32) -> bool {
    if row == 0 {
        return load_vertex_sums(0) == 0u && load_triangle_sums(0) == 0u;
    }
    return load_vertex_sums(row) == load_vertex_sums(row - 1) && load_triangle_sums(row) == load_triangle_sums(row - 1);
}

fn each(row: i32) {
    if is_empty(row) {
        return;
    }
    let yz = row_place(row);
    var first = vec4u(first_vertex(yz), first_vertex(yz + vec2i(1, 0)), first_vertex(yz + vec2i(0, 1)), first_vertex(yz + vec2i(1, 1)));
    var triangle = select(0u, load_triangle_sums(row - 1), row > 0);
    var here = insides(0, yz);
    var next = insides(1, yz);
    var edges = owned(here, next);
    for (var x = 0; x < params.points.x; x++) {
        let beyond = insides(x + 2, yz);
        let next_edges = owned(next, beyond);
        let next_first = first + countOneBits(edges);
        var number = first.x;
        for (var axis = 0; axis < 3; axis++) {
            if ((edges.x >> u32(axis)) & 1u) == 1u {
                store_vertex(number, vec3i(x, yz), axis);
                number++;
            }
        }
        if has_cells(yz) && x + 1 < params.points.x {
            let cell = case_at(here, next);
            let corners = 3 * i32(load_cases(cell));
            for (var i = 0; i < corners; i++) {
                // An edge: axis, far along x, row.
                let edge = load_cases(cell + 1 + i);
                let edge_row = edge >> 3u;
                let far = ((edge >> 2u) & 1u) == 1u;
                let before = select(edges[edge_row], next_edges[edge_row], far) & ((1u << (edge & 3u)) - 1u);
                let vertex = select(first[edge_row], next_first[edge_row], far) + countOneBits(before);
                store_triangles(i32(3u * triangle) + i, vertex);
            }
            triangle += u32(corners) / 3u;
        }
        here = next;
        next = beyond;
        edges = next_edges;
        first = next_first;
    }
}
