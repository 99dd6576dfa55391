// Count, mean and squared distances from the mean of a set of values, four sets at a time.

struct Moments {
    count: vec4f,
    /// One of the values.
    origin: vec4f,
    /// The mean, as its distance from the origin.
    mean: vec4f,
    /// The sum of squared distances from the mean.
    squares: vec4f,
}

/// Those of two sets together: Chan, Golub and LeVeque, Algorithms for Computing the Sample Variance, The American
/// Statistician 37, 1983.
fn joined_moments(a: Moments, b: Moments) -> Moments {
    let none = a.count == vec4f();
    let count = a.count + b.count;
    let share = b.count / max(count, vec4f(1.0));
    let apart = select((b.origin - a.origin) + (b.mean - a.mean), vec4f(), none | (b.count == vec4f()));
    return Moments(
        count,
        select(a.origin, b.origin, none),
        select(a.mean + apart * share, b.mean, none),
        a.squares + b.squares + apart * apart * (a.count * share),
    );
}
