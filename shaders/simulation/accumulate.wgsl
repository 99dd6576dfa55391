// A frame joined with what the frames before came to. OP 0: weighted mean, 1: maximum.

import package::lib::extremes::maximum;

fn apply(image: vec4f, before: vec4f) -> vec4f {
    if OP == 1 {
        return maximum(image, before);
    }
    if COUNTED {
        return before + (image - before) / params.weight;
    }
    return params.weight * image + (1.0 - params.weight) * before;
}
