// Bricks of 8³ cells of the port `volume`, with the extreme density of each in the port `bricks`.

struct Brick {
    extreme: f32,
    /// How far it goes on along the ray.
    length: f32,
}

/// The brick that holds a point of the unit cube.
fn brick(p: vec3f, direction: vec3f) -> Brick {
    let size = vec3f(size_volume());
    // In cells, which lie between voxel centres and begin before the first one.
    let cell = p * size + 0.5;
    let number = floor(cell / 8.0);
    let speed = direction * size;
    let ahead = (number + select(vec3f(0.0), vec3f(1.0), speed > vec3f(0.0))) * 8.0 - cell;
    let lengths = ahead / select(speed, vec3f(1e-20), abs(speed) < vec3f(1e-20));
    // Parallel to a face a ray never leaves by it, on whichever side the tiny speed points.
    let reach = select(lengths, vec3f(4.0), lengths < vec3f(0.0));
    return Brick(load_bricks(vec3i(number)).r, min(reach.x, min(reach.y, reach.z)));
}
