// The value at a quantile: between the value of the rank and the next larger one. Constants: COMPONENTS, TARGETS,
// TARGET (which quantile).

import package::lib::order::value_of_order;

@compute @workgroup_size(1, 1, 1)
fn main() {
    var out = vec4f();
    for (var c = 0; c < COMPONENTS; c++) {
        let s = TARGET * COMPONENTS + c;
        var v = value_of_order(load_state(4 * s));
        if load_state(4 * s + 3) == 0u {
            let fraction = f32(load_state(4 * s + 2)) / 4294967296.0;
            v += fraction * (value_of_order(~load_above(s)) - v);
        }
        out[c] = v;
    }
    store_out(out);
}
