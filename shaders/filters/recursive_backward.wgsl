// From right to left (or up): Σ over n ≥ 1 of h(n)·in(x + n), added to what the forward pass found.

import package::lib::poison::{Poison, poisoned, antidote, outcome};

fn each(xy: vec2i) {
    let step = select(vec2i(0, 1), vec2i(1, 0), ALONG_X);
    let start = select(vec2i(xy.x, xy.y * RUN), vec2i(xy.x * RUN, xy.y), ALONG_X);
    var a_re = vec4f();
    var a_im = vec4f();
    var b_re = vec4f();
    var b_im = vec4f();
    var poison = Poison(vec4f(), vec4i(-1));
    for (var i = RUN + WARM - 1; i >= 0; i--) {
        let p = start + step * i;
        // The sums so far, seen from one pixel further.
        let a = params.pole0.x * a_re - params.pole0.y * a_im;
        a_im = params.pole0.x * a_im + params.pole0.y * a_re;
        a_re = a;
        let b = params.pole1.x * b_re - params.pole1.y * b_im;
        b_im = params.pole1.x * b_im + params.pole1.y * b_re;
        b_re = b;
        if i < RUN {
            store_out(p, load_forward(p) + outcome(poison, a_re + b_re));
        }
        let pixel = load_image(p);
        poison = poisoned(poison, pixel, RADIUS - 1);
        let v = antidote(pixel);
        a_re += params.gain0.x * v;
        a_im += params.gain0.y * v;
        b_re += params.gain1.x * v;
        b_im += params.gain1.y * v;
    }
}
