// Several steps of a 5-point stencil in one pass. A workgroup loads a square of 64×64 pixels, steps it in registers, and
// stores the middle: in each step the outermost ring goes stale, for its neighbours are not there. A thread holds 16
// rows of one column as four quads, so neighbours above and below are mostly its own; those to the sides, and at the
// ends of the 16 rows, pass through workgroup memory, one field at a time.

const SIDE: i32 = 64;

// Quad q of column x stands at q·64 + x.
var<workgroup> field: array<vec4f, 1024>;

/// Four rows of the two channels of a state.
struct Quad {
    u: vec4f,
    v: vec4f,
}

/// What the edge pixel sees beyond the edge.
fn ghost(edge: vec4f) -> vec4f {
    return select(edge, vec4f(0.0), FIXED);
}

/// c²∇² of the field at quad q of column x, which lies at `at` in the image.
fn bend(q: i32, x: i32, at: vec2i) -> vec4f {
    let here = field[q * SIDE + x];
    let above = field[max(q - 1, 0) * SIDE + x].w;
    let below = field[min(q + 1, 15) * SIDE + x].x;
    var left = field[q * SIDE + max(x - 1, 0)];
    var right = field[q * SIDE + min(x + 1, SIDE - 1)];
    var up = vec4f(above, here.xyz);
    var down = vec4f(here.yzw, below);
    if !PERIODIC {
        let last = size_state() - 1;
        let rows = vec4i(at.y) + vec4i(0, 1, 2, 3);
        let beyond = ghost(here);
        left = select(left, beyond, at.x == 0);
        right = select(right, beyond, at.x == last.x);
        up = select(up, beyond, rows == vec4i(0));
        down = select(down, beyond, rows == vec4i(last.y));
    }
    return params.stiffness * (((left - here) + (right - here)) + ((up - here) + (down - here)));
}

/// γ: an absorbing edge adds to it for each open side of the pixel.
fn resistance(at: vec2i) -> vec4f {
    if !ABSORBING {
        return vec4f(params.damping);
    }
    let last = size_state() - 1;
    let rows = vec4i(at.y) + vec4i(0, 1, 2, 3);
    let across = select(0.0, 1.0, at.x == 0) + select(0.0, 1.0, at.x == last.x);
    let down = select(vec4f(0.0), vec4f(1.0), rows == vec4i(0)) + select(vec4f(0.0), vec4f(1.0), rows == vec4i(last.y));
    return params.damping + params.opening * (across + down);
}

/// Puts a thread's four quads of one field where its neighbours see them.
fn publish(q: i32, x: i32, a: vec4f, b: vec4f, c: vec4f, d: vec4f) {
    field[q * SIDE + x] = a;
    field[(q + 1) * SIDE + x] = b;
    field[(q + 2) * SIDE + x] = c;
    field[(q + 3) * SIDE + x] = d;
    workgroupBarrier();
}

fn load_quad(at: vec2i) -> Quad {
    let a = load_state(at);
    let b = load_state(at + vec2i(0, 1));
    let c = load_state(at + vec2i(0, 2));
    let d = load_state(at + vec2i(0, 3));
    return Quad(vec4f(a.x, b.x, c.x, d.x), vec4f(a.y, b.y, c.y, d.y));
}

/// Stores what is not stale of a quad whose first row is y in the square.
fn store_quad(s: Quad, y: i32, at: vec2i) {
    for (var i = 0; i < 4; i++) {
        if y + i >= STEPS && y + i < SIDE - STEPS {
            store_out(at + vec2i(0, i), vec4f(s.u[i], s.v[i], 0.0, 1.0));
        }
    }
}
