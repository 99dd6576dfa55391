// STEPS time steps in one pass. A workgroup loads a square of 64×64 pixels, steps it in registers, and stores the middle:
// in each step the outermost ring goes stale, for its neighbours are not there. A thread holds 16 rows of one column as
// four quads, so neighbours above and below are its own; those to the sides, and at the ends of the 16 rows, pass
// through workgroup memory.
// METHOD 0: Euler; 1: symplectic Euler; 4: Verlet between half steps (see wave_verlet.wgsl).

const SIDE: i32 = 64;

// Quad q of column x stands at q·64 + x.
var<workgroup> field: array<vec4f, 1024>;

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

fn drift(s: Quad) -> Quad {
    if METHOD == 4 {
        return Quad(s.u + params.dt * s.v, s.v);
    }
    return s;
}

fn kick(s: Quad, q: i32, x: i32, at: vec2i) -> Quad {
    let h = params.dt;
    let g = resistance(at);
    let pull = bend(q, x, at);
    switch METHOD {
        case 0: {
            return Quad(s.u + h * s.v, s.v + h * (pull - g * s.v));
        }
        case 1: {
            let v = s.v + h * (pull - g * s.v);
            return Quad(s.u + h * v, v);
        }
        default: {
            let v = (s.v + 0.5 * h * pull) / (1.0 + 0.5 * h * g);
            return Quad(s.u, v + 0.5 * h * (pull - g * v));
        }
    }
}

fn load_quad(at: vec2i) -> Quad {
    let a = load_state(at);
    let b = load_state(at + vec2i(0, 1));
    let c = load_state(at + vec2i(0, 2));
    let d = load_state(at + vec2i(0, 3));
    return Quad(vec4f(a.x, b.x, c.x, d.x), vec4f(a.y, b.y, c.y, d.y));
}

fn store_quad(s: Quad, y: i32, at: vec2i) {
    for (var i = 0; i < 4; i++) {
        if y + i >= STEPS && y + i < SIDE - STEPS {
            store_out(at + vec2i(0, i), vec4f(s.u[i], s.v[i], 0.0, 1.0));
        }
    }
}

@compute @workgroup_size(256)
fn main(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
    let x = i32(lane % 64u);
    let q = i32(lane / 64u) * 4;
    let at = vec2i(group.xy) * (SIDE - 2 * STEPS) - STEPS + vec2i(x, q * 4);
    let down = vec2i(0, 4);
    var a = load_quad(at);
    var b = load_quad(at + down);
    var c = load_quad(at + 2 * down);
    var d = load_quad(at + 3 * down);
    for (var step = 0; step < STEPS; step++) {
        a = drift(a);
        b = drift(b);
        c = drift(c);
        d = drift(d);
        field[q * SIDE + x] = a.u;
        field[(q + 1) * SIDE + x] = b.u;
        field[(q + 2) * SIDE + x] = c.u;
        field[(q + 3) * SIDE + x] = d.u;
        workgroupBarrier();
        a = kick(a, q, x, at);
        b = kick(b, q + 1, x, at + down);
        c = kick(c, q + 2, x, at + 2 * down);
        d = kick(d, q + 3, x, at + 3 * down);
        workgroupBarrier();
    }
    if x >= STEPS && x < SIDE - STEPS {
        store_quad(a, q * 4, at);
        store_quad(b, q * 4 + 4, at + down);
        store_quad(c, q * 4 + 8, at + 2 * down);
        store_quad(d, q * 4 + 12, at + 3 * down);
    }
}
