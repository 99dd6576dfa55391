// STEPS time steps of an explicit integrator in one pass: see blocked.wgsl. METHOD is the position in the enum of
// wave_equation.rs: 0 Euler, 1 symplectic Euler, 2 and 3 midpoint and Runge-Kutta, 4 Verlet between half steps (see
// wave_verlet.wgsl).

fn drift(s: Quad) -> Quad {
    if METHOD == 4 {
        return Quad(s.u + params.dt * s.v, s.v);
    }
    return s;
}

/// The next state from the state, c²∇²u and, where the method needs it, c²∇²v.
fn kick(s: Quad, l: vec4f, lv: vec4f, at: vec2i) -> Quad {
    let h = params.dt;
    let g = resistance(at);
    let a = l - g * s.v;
    switch METHOD {
        case 0: {
            return Quad(s.u + h * s.v, s.v + h * a);
        }
        case 1: {
            let v = s.v + h * a;
            return Quad(s.u + h * v, v);
        }
        case 2: {
            let middle = s.v + 0.5 * h * a;
            return Quad(s.u + h * middle, s.v + h * (l + 0.5 * h * lv - g * middle));
        }
        case 3: {
            let end = s.v + h * a;
            return Quad(s.u + 0.5 * h * (s.v + end), s.v + 0.5 * h * (a + (l + h * lv - g * end)));
        }
        default: {
            let v = (s.v + 0.5 * h * l) / (1.0 + 0.5 * h * g);
            return Quad(s.u, v + 0.5 * h * (l - g * v));
        }
    }
}

@compute @workgroup_size(256)
fn main(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
    let x = i32(lane % 64u);
    let q = i32(lane / 64u) * 4;
    let at = block(group) * (SIDE - 2 * STEPS) - STEPS + vec2i(x, q * 4);
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
        publish(q, x, a.u, b.u, c.u, d.u);
        let la = bend(q, x, at);
        let lb = bend(q + 1, x, at + down);
        let lc = bend(q + 2, x, at + 2 * down);
        let ld = bend(q + 3, x, at + 3 * down);
        workgroupBarrier();
        var va = vec4f(0.0);
        var vb = vec4f(0.0);
        var vc = vec4f(0.0);
        var vd = vec4f(0.0);
        if METHOD == 2 || METHOD == 3 {
            publish(q, x, a.v, b.v, c.v, d.v);
            va = bend(q, x, at);
            vb = bend(q + 1, x, at + down);
            vc = bend(q + 2, x, at + 2 * down);
            vd = bend(q + 3, x, at + 3 * down);
            workgroupBarrier();
        }
        a = kick(a, la, va, at);
        b = kick(b, lb, vb, at + down);
        c = kick(c, lc, vc, at + 2 * down);
        d = kick(d, ld, vd, at + 3 * down);
    }
    if x >= STEPS && x < SIDE - STEPS {
        store_quad(a, q * 4, at);
        store_quad(b, q * 4 + 4, at + down);
        store_quad(c, q * 4 + 8, at + 2 * down);
        store_quad(d, q * 4 + 12, at + 3 * down);
    }
}
