//! Where light comes from. Every light emits the power 1.

use std::f64::consts::{PI, TAU};

use glam::{DVec3, Vec3};
use pipe_graph::lowering::PassBuilder;
use pipe_graph::prelude::*;

use crate::components::Sides;

/// A light of power 1.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub(super) enum Light {
    /// A point that shines everywhere alike.
    Point {
        /// Where it is.
        position: [f32; 3],
    },
    /// A ray without width.
    Beam {
        /// Where it begins.
        origin: [f32; 3],
        /// Where it goes; of any length.
        direction: [f32; 3],
    },
    /// A rectangle that shines straight ahead, everywhere alike.
    Plane {
        /// Its middle.
        origin: [f32; 3],
        /// Where its light goes; of any length.
        normal: [f32; 3],
        /// Length of its sides, or of each: the first lies along x, or along y where the light goes along x.
        #[serde(default = "one")]
        size: Sides,
    },
}

const fn one() -> Sides {
    Sides([1.0; 2])
}

impl Default for Light {
    /// Above the roof of the cloud chamber.
    fn default() -> Self {
        Self::Point { position: [0.5, 0.95, 0.5] }
    }
}

impl Light {
    /// What is wrong with its numbers.
    pub(super) fn check(self) -> Result<(), Mistake> {
        let (direction, size) = match self {
            Self::Point { .. } => return Ok(()),
            Self::Beam { direction, .. } => (direction, [1.0; 2]),
            Self::Plane { normal, size: Sides(sides), .. } => (normal, sides),
        };
        if direction == [0.0; 3] {
            return Err(Mistake::in_field("light", "its direction is no direction").hint("expected a vector other than 0"));
        }
        if let Some(side) = size.into_iter().find(|side| *side <= 0.0) {
            return Err(Mistake::in_field("light", format!("its size is {side}")).hint("expected a size above 0"));
        }
        Ok(())
    }

    /// What is wrong with it where points are asked how much light they get.
    pub(super) fn check_visible(self) -> Result<(), Mistake> {
        self.check()?;
        match self {
            Self::Beam { .. } => Err(Mistake::in_field("light", "a beam has no width: no ray from the eye ever meets it")
                .hint("use a Plane of a small size in its place")),
            _ => Ok(()),
        }
    }

    /// The constant `LIGHT` of `light.wgsl`.
    const fn code(self) -> i32 {
        match self {
            Self::Point { .. } => 0,
            Self::Beam { .. } => 1,
            Self::Plane { .. } => 2,
        }
    }

    /// Its numbers.
    pub(super) fn shape(self) -> Emitter {
        let vector = |v: [f32; 3]| Vec3::from(v).as_dvec3();
        let (origin, direction, size) = match self {
            Self::Point { position } => (position, [0.0; 3], [0.0; 2]),
            Self::Beam { origin, direction } => (origin, direction, [0.0; 2]),
            Self::Plane { origin, normal, size: Sides(sides) } => (origin, normal, sides.map(f64::from)),
        };
        let direction = vector(direction).normalize_or_zero();
        // Sides along axes where the direction is along an axis.
        let axis = if direction.x.abs() < 0.9 { DVec3::X } else { DVec3::Y };
        let right = (axis - direction * direction.dot(axis)).normalize();
        Emitter { light: self, origin: vector(origin), direction, sides: [right * size[0], direction.cross(right) * size[1]] }
    }

    /// Tells a pass what `light.wgsl` asks for.
    pub(super) fn describe<'b, 'a>(self, pass: PassBuilder<'b, 'a>) -> PassBuilder<'b, 'a> {
        let Emitter { origin, direction, sides, .. } = self.shape();
        let pass = pass.constant("LIGHT", self.code());
        [("light_origin", origin), ("light_direction", direction), ("light_right", sides[0]), ("light_up", sides[1])]
            .into_iter()
            .fold(pass, |pass, (name, v)| pass.param(name, v.as_vec3().to_array()))
    }
}

/// A light in double precision.
#[derive(Debug, Clone, Copy)]
pub(super) struct Emitter {
    light: Light,
    origin: DVec3,
    direction: DVec3,
    /// The sides of a plane, 0 for other lights.
    sides: [DVec3; 2],
}

impl Emitter {
    /// Where a photon begins and where it goes, from two numbers in 0..1.
    pub(super) fn emit(&self, u: f64, v: f64) -> [DVec3; 2] {
        if matches!(self.light, Light::Point { .. }) {
            let z = 2.0 * u - 1.0;
            let r = (1.0 - z * z).sqrt();
            let (s, c) = (TAU * v).sin_cos();
            return [self.origin, DVec3::new(r * c, r * s, z)];
        }
        [self.origin + (u - 0.5) * self.sides[0] + (v - 0.5) * self.sides[1], self.direction]
    }

    /// The light that arrives at a point when nothing is in its way: the direction from which it comes, the distance of
    /// its source and its irradiance across that direction. `None` where none arrives.
    pub(super) fn at(&self, p: DVec3) -> Option<Arrival> {
        let aside = p - self.origin;
        if matches!(self.light, Light::Point { .. }) {
            let distance = aside.length().max(1e-6);
            return Some(Arrival { towards: -aside / distance, distance, irradiance: 1.0 / (4.0 * PI * distance * distance) });
        }
        let area = self.sides[0].length() * self.sides[1].length();
        let within = self.sides.iter().all(|side| (aside.dot(*side) / side.length_squared()).abs() <= 0.5);
        let distance = aside.dot(self.direction);
        (within && distance > 0.0).then_some(Arrival { towards: -self.direction, distance, irradiance: 1.0 / area })
    }
}

/// Light that arrives at a point.
#[derive(Debug, Clone, Copy)]
pub(super) struct Arrival {
    /// Where it comes from.
    pub(super) towards: DVec3,
    /// How far away that is.
    pub(super) distance: f64,
    /// Power per area across its direction.
    pub(super) irradiance: f64,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_point_shines_everywhere_alike() {
        let light = Light::Point { position: [0.25, 0.5, 0.75] }.shape();
        let n = 40;
        let mut sum = DVec3::ZERO;
        for i in 0..n {
            for j in 0..n {
                let at = |k: i32| (f64::from(k) + 0.5) / f64::from(n);
                let [origin, direction] = light.emit(at(i), at(j));
                assert_eq!(origin, DVec3::new(0.25, 0.5, 0.75));
                assert!((direction.length() - 1.0).abs() < 1e-12);
                sum += direction;
            }
        }
        assert!(sum.length() < 1e-9);
    }

    #[test]
    fn a_plane_shines_on_what_is_before_it() {
        let light = Light::Plane { origin: [0.5, 1.0, 0.5], normal: [0.0, -2.0, 0.0], size: Sides([0.5; 2]) }.shape();
        let [origin, direction] = light.emit(0.0, 1.0);
        assert!((origin - DVec3::new(0.25, 1.0, 0.75)).abs().max_element() < 1e-9 || (origin.y - 1.0).abs() < 1e-9);
        assert_eq!(direction, DVec3::NEG_Y);
        let below = light.at(DVec3::new(0.4, 0.25, 0.7)).unwrap_or_else(|| panic!("it is lit"));
        assert_eq!((below.distance, below.irradiance, below.towards), (0.75, 4.0, DVec3::Y));
        assert!(light.at(DVec3::new(0.2, 0.25, 0.5)).is_none(), "beside it");
        assert!(light.at(DVec3::new(0.5, 1.25, 0.5)).is_none(), "behind it");
    }

    #[test]
    fn a_plane_may_be_longer_than_wide() {
        let light = Light::Plane { origin: [0.5, 1.0, 0.5], normal: [0.0, -1.0, 0.0], size: Sides([0.25, 1.0]) }.shape();
        let lit = |x, z| light.at(DVec3::new(x, 0.5, z)).map(|arrival| arrival.irradiance);
        assert_eq!([lit(0.5, 0.5), lit(0.4, 0.1), lit(0.6, 0.9)], [Some(4.0); 3]);
        assert_eq!([lit(0.3, 0.5), lit(0.7, 0.5)], [None; 2]);
        let [corner, _] = light.emit(0.0, 0.0);
        assert_eq!((corner - light.origin).abs(), DVec3::new(0.125, 0.0, 0.5));
    }
}
