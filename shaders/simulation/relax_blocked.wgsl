// STEPS iterations of wave_relax.wgsl in one pass: see blocked.wgsl. A quad holds (x, x before).

fn relax(s: Quad, rhs: vec4f, l: vec4f, at: vec2i) -> Quad {
    let th = params.theta * params.dt;
    let product = s.u * (1.0 + th * resistance(at)) - th * th * l;
    return Quad(s.u + params.gain * (rhs - product) + params.inertia * (s.u - s.v), s.u);
}

fn load_right(at: vec2i) -> vec4f {
    return vec4f(load_rhs(at).x, load_rhs(at + vec2i(0, 1)).x, load_rhs(at + vec2i(0, 2)).x, load_rhs(at + vec2i(0, 3)).x);
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
    let ra = load_right(at);
    let rb = load_right(at + down);
    let rc = load_right(at + 2 * down);
    let rd = load_right(at + 3 * down);
    for (var step = 0; step < STEPS; step++) {
        publish(q, x, a.u, b.u, c.u, d.u);
        let la = bend(q, x, at);
        let lb = bend(q + 1, x, at + down);
        let lc = bend(q + 2, x, at + 2 * down);
        let ld = bend(q + 3, x, at + 3 * down);
        workgroupBarrier();
        a = relax(a, ra, la, at);
        b = relax(b, rb, lb, at + down);
        c = relax(c, rc, lc, at + 2 * down);
        d = relax(d, rd, ld, at + 3 * down);
    }
    if x >= STEPS && x < SIDE - STEPS {
        store_quad(a, q * 4, at);
        store_quad(b, q * 4 + 4, at + down);
        store_quad(c, q * 4 + 8, at + 2 * down);
        store_quad(d, q * 4 + 12, at + 3 * down);
    }
}
