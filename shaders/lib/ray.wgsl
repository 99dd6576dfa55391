// Eye rays of a pin-hole camera, and what they meet of the unit cube that volumes fill.

struct Ray {
    origin: vec3f,
    direction: vec3f,
}

/// The ray through the centre of a pixel of a picture of this size. `forward` leads from the eye to the picture's middle,
/// `right` from there to its right edge, `up` to its upper edge.
fn eye_ray(xy: vec2i, size: vec2i, eye: vec3f, right: vec3f, up: vec3f, forward: vec3f) -> Ray {
    let at = (vec2f(xy) + 0.5) * 2.0 / vec2f(size) - 1.0;
    return Ray(eye, normalize(forward + at.x * right - at.y * up));
}

/// Distances along the ray at which it enters and leaves the unit cube, none behind its origin; the first is not below
/// the second where it misses.
fn cube_span(ray: Ray) -> vec2f {
    // Parallel to a face: so far away that no other face comes later.
    let inverse = 1.0 / select(ray.direction, vec3f(1e-20), abs(ray.direction) < vec3f(1e-20));
    let low = -ray.origin * inverse;
    let high = (1.0 - ray.origin) * inverse;
    let enter = min(low, high);
    let leave = max(low, high);
    return vec2f(max(max(enter.x, enter.y), max(enter.z, 0.0)), min(leave.x, min(leave.y, leave.z)));
}

/// Where a point of the unit cube is seen when the volume has other proportions than a cube's.
fn seen_at(p: vec3f, proportions: vec3f) -> vec3f {
    return (p - 0.5) * proportions + 0.5;
}
