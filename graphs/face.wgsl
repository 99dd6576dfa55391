// What leaves through one face.

fn at(i: i32) -> vec4f {
    return vec4f(load_faces(params.face));
}
