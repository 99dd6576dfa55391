// The vertices of each row's own edges, and the triangles of its cells. `vertex_sums` and `triangle_sums` count all rows up
// to and including each.

/// The edges along x, y, z that cross the surface, of the points of rows 0 to 3 in one word of each.
struct Edges {
    x: vec4u,
    y: vec4u,
    z: vec4u,
}

fn edges_of(w: i32, here: Words, next: vec4u) -> Edges {
    let near = here.near;
    let points = vec4u(points_of(w));
    return Edges(
        (near ^ shifted(near, next)) & points,
        (near ^ vec4u(near.y, here.high.x, near.w, here.high.y)) & points,
        (near ^ vec4u(near.z, near.w, here.deep)) & points,
    );
}

/// How many edges the points below a mask own in each row.
fn owned(edges: Edges, mask: u32) -> vec4u {
    let m = vec4u(mask);
    return countOneBits(edges.x & m) + countOneBits(edges.y & m) + countOneBits(edges.z & m);
}

/// How many edges a point owns along axes before this one.
fn owned_before(edges: Edges, row: u32, bit: u32, axis: u32) -> u32 {
    let x = (edges.x[row] >> bit) & 1u;
    let y = (edges.y[row] >> bit) & 1u;
    return select(0u, x, axis > 0u) + select(0u, y, axis > 1u);
}

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
    let seen = vertex * params.extent;
    let first = i32(6u * number);
    store_vertices(first, seen.x);
    store_vertices(first + 1, seen.y);
    store_vertices(first + 2, seen.z);
    store_vertices(first + 3, normal.x);
    store_vertices(first + 4, normal.y);
    store_vertices(first + 5, normal.z);
}

/// The vertices of row 0 in one word.
fn store_word(w: i32, yz: vec2i, edges: Edges, first: u32) {
    var number = first;
    var points = edges.x.x | edges.y.x | edges.z.x;
    while points != 0u {
        let bit = firstTrailingBit(points);
        let crossed = (vec3u(edges.x.x, edges.y.x, edges.z.x) >> vec3u(bit)) & vec3u(1u);
        for (var axis = 0; axis < 3; axis++) {
            if crossed[axis] == 1u {
                store_vertex(number, vec3i(32 * w + i32(bit), yz), axis);
                number++;
            }
        }
        points &= points - 1u;
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
    var here = words(0, yz);
    var next = words(1, yz);
    var edges = edges_of(0, here, next.near);
    for (var w = 0; w < ROW_WORDS; w++) {
        let beyond = words(w + 2, yz);
        let next_edges = edges_of(w + 1, next, beyond.near);
        store_word(w, yz, edges, first.x);
        let far = shifted(here.near, next.near);
        var cells = crossed_cells(w, yz, here.near, far);
        while cells != 0u {
            let bit = firstTrailingBit(cells);
            // The first vertices of the points at the cell's near and far end along x, and where the far ones stand.
            let near_first = first + owned(edges, (1u << bit) - 1u);
            let far_first = first + owned(edges, lowest(i32(bit) + 1));
            let far_bit = (bit + 1u) & 31u;
            let cell = case_at(here.near, far, bit);
            let corners = 3 * i32(load_cases(cell));
            for (var i = 0; i < corners; i++) {
                // An edge: axis, far along x, row.
                let edge = load_cases(cell + 1 + i);
                let axis = edge & 3u;
                let edge_row = edge >> 3u;
                var vertex = near_first[edge_row] + owned_before(edges, edge_row, bit, axis);
                if ((edge >> 2u) & 1u) == 1u {
                    let before = owned_before(edges, edge_row, far_bit, axis);
                    let before_behind = owned_before(next_edges, edge_row, far_bit, axis);
                    vertex = far_first[edge_row] + select(before, before_behind, bit == 31u);
                }
                store_triangles(i32(3u * triangle) + i, vertex);
            }
            triangle += u32(corners) / 3u;
            cells &= cells - 1u;
        }
        first += owned(edges, 0xffffffffu);
        here = next;
        next = beyond;
        edges = next_edges;
    }
}
