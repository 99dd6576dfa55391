// Carries from tile to tile: for each of LENGTH lines, what the tiles before sum to, for COUNT tiles. Compensated.

/// Terms that a thread asks for at once, lest it wait for each.
const AHEAD = 16;

@compute @workgroup_size(64, 1, 1)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let line = i32(id.x);
    if line >= LENGTH {
        return;
    }
    var sum = Texel();
    var error = Texel();
    for (var first = 0; first < COUNT; first += AHEAD) {
        var terms = array<Texel, AHEAD>();
        for (var n = 0; n < AHEAD; n++) {
            terms[n] = sums_at(min(first + n, COUNT - 1) * LENGTH + line);
        }
        for (var n = 0; n < AHEAD; n++) {
            if first + n < COUNT {
                put_carried((first + n) * LENGTH + line, sum + error);
            }
            error += lost_in(sum, terms[n]);
            sum += terms[n];
        }
    }
}
