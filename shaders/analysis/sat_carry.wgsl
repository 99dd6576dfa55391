// Carries from tile to tile: for each of LENGTH lines, what the tiles before sum to, for COUNT tiles. Compensated.

import package::lib::wide::sum_error;

@compute @workgroup_size(64, 1, 1)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let line = i32(id.x);
    if line >= LENGTH {
        return;
    }
    var sum = Texel();
    var error = Texel();
    for (var i = 0; i < COUNT; i++) {
        put_carried(i * LENGTH + line, sum + error);
        let term = sums_at(i * LENGTH + line);
        error += lost_in(sum, term);
        sum += term;
    }
}
