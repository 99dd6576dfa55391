//! Directions that the shaders' phase functions draw, for tests of their distribution.

use pipe_graph::prelude::*;

/// Scatters light that came along `direction` many times. Two entries for each time: the cosine between the directions, and
/// the angle around the old one in turns, 0..1.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
pub struct Scattered {
    /// 0 isotropic, 1 Rayleigh, 2 Henyey–Greenstein.
    phase: i32,
    /// Mean cosine of Henyey–Greenstein.
    g: f32,
    /// Where light came from; of length 1.
    direction: [f32; 3],
    /// How often.
    count: u32,
}

/// The kind of [`Scattered`].
pub const KIND: Kind =
    Kind::of::<Scattered>("Scattered", Category::Sources, &["Scattered(phase: 0, g: 0, direction: (0, 0, 1), count: 10)"]);

const SHADER: &str = "
import package::lib::phase::scatter;
import package::lib::random::{open_unit, philox};

fn at(i: i32) -> f32 {
    let words = philox(vec4u(u32(i / 2), 0u, 0u, 0u), vec2u(1u, 2u));
    let old = params.direction;
    let next = scatter(params.phase, params.g, old, open_unit(words.y), open_unit(words.z));
    if i % 2 == 0 {
        return dot(old, next);
    }
    let right = normalize(cross(old, select(vec3f(1.0, 0.0, 0.0), vec3f(0.0, 1.0, 0.0), abs(old.x) > 0.5)));
    return atan2(dot(next, cross(old, right)), dot(next, right)) / 6.28318531 + 0.5;
}
";

impl Node for Scattered {
    fn outputs(&self, _: &mut Inputs<'_>) -> Result<Vec<Output>, Mistake> {
        Ok(Output::out(EdgeType::table(2 * self.count, Element::F32)))
    }

    fn lower(&self, cx: &mut Lowering<'_>) -> Result<(), Mistake> {
        let out = cx.output("out");
        cx.pass("", Shader::builtin("scattered.wgsl", SHADER))
            .write("out", out)
            .param("phase", self.phase)
            .param("g", self.g)
            .param("direction", self.direction)
            .add();
        Ok(())
    }

    fn reference(&self, _: &Reference<'_>) -> Vec<Tensor> {
        unreachable!("what it draws is tested as a distribution")
    }
}
