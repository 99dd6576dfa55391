fn at(i: i32) -> f32 {
    let size = size_medium();
    var most = 0.0;
    for (var x = 0; x < size.x; x++) {
        let v = load_medium(vec3i(x, i % size.y, i / size.y)).r;
        // A comparison with NaN is false.
        most = select(most, v, v > most);
    }
    return most;
}
