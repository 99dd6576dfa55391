// AXIS: 0 x, 1 y, 2 z. RADIUS: taps to either side.

fn at(xyz: vec3i) -> vec4f {
    var along = vec3i(0);
    along[AXIS] = 1;
    var sum = vec4f();
    for (var k = -RADIUS; k <= RADIUS; k++) {
        sum += load_weights(k + RADIUS) * load_volume(xyz + k * along);
    }
    return sum;
}
