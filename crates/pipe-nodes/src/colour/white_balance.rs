//! `WhiteBalance`: makes the light of a scene neutral.

use glam::{DMat3, DVec2, DVec3};
use pipe_graph::prelude::*;
use smart_default::SmartDefault;

use crate::colour::point::{map_tinted, point, tinted};
use crate::colour::primaries::{REC709, adaptation, rows, to_xyz, xyz_of};
use crate::shader;

/// Corrects the colour of the light that a picture was taken in: what this light made of white becomes neutral.
///
/// As in raw converters a higher `temperature` gives a warmer picture, a lower one a colder picture; 6500 with tint 0
/// changes nothing. The light is a black body's (Krystek 1985), moved off the Planckian locus by `tint`; colour is adapted
/// to 6500 K in the cones of Bradford, in linear Rec.709. Alpha is kept, 1-channel images become colour.
#[derive(Debug, SmartDefault, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(super) struct WhiteBalance {
    /// The image.
    image: In<Image>,
    /// Correlated colour temperature of the light.
    #[default = 6500.0]
    #[schemars(range(min = 1000.0, max = 25000.0), extend("x-unit" = "K"))]
    temperature: f32,
    /// How green the light was: positive values move the picture to magenta, negative ones to green. 3000 times the
    /// distance from the Planckian locus in CIE 1960 (u, v), as Adobe's raw converters count.
    #[schemars(range(min = -150.0, max = 150.0))]
    tint: f32,
}

pub(super) const KIND: Kind = Kind::of::<WhiteBalance>(
    "WhiteBalance",
    Category::Colour,
    &[
        r#"WhiteBalance(image: "in", temperature: 5000)"#,
        r#"WhiteBalance(image: "in", temperature: 9000, tint: -40)"#,
        r#"WhiteBalance(image: "grey", temperature: 3200)"#,
        r#"WhiteBalance(image: "in")"#,
    ],
)
.tolerance(2e-6, 2e-5);

/// A point in CIE 1960 (u, v) and how it moves with the temperature: the Planckian locus by M. Krystek, An algorithm to
/// calculate correlated colour temperature, 1985.
fn planckian(t: f64) -> (DVec2, DVec2) {
    let ratio = |n: [f64; 3], d: [f64; 3]| {
        let value = |p: [f64; 3]| p[0] + t * (p[1] + t * p[2]);
        let slope = |p: [f64; 3]| p[1] + 2.0 * t * p[2];
        let (n, dn, d, dd) = (value(n), slope(n), value(d), slope(d));
        (n / d, (dn * d - n * dd) / (d * d))
    };
    let (u, du) = ratio([0.860_117_757, 1.541_182_54e-4, 1.286_412_12e-7], [1.0, 8.424_202_35e-4, 7.081_451_63e-7]);
    let (v, dv) = ratio([0.317_398_726, 4.228_062_45e-5, 4.204_816_91e-8], [1.0, -2.897_418_16e-5, 1.614_560_53e-7]);
    (DVec2::new(u, v), DVec2::new(du, dv))
}

/// XYZ of a light, Y = 1.
fn light(temperature: f64, tint: f64) -> DVec3 {
    let (on_locus, along) = planckian(temperature);
    // Green lies above the locus, which runs to smaller u as it gets hotter.
    let green = DVec2::new(along.y, -along.x).normalize();
    let DVec2 { x: u, y: v } = on_locus + green * (tint / 3000.0);
    let d = 2.0 * u - 8.0 * v + 4.0;
    xyz_of([3.0 * u / d, 2.0 * v / d])
}

/// The correction in linear Rec.709.
fn correction(temperature: f64, tint: f64) -> DMat3 {
    let rgb = to_xyz(REC709);
    rgb.inverse() * adaptation(light(temperature, tint), light(6500.0, 0.0)) * rgb
}

impl WhiteBalance {
    fn matrix(&self) -> DMat3 {
        if self.temperature == 6500.0 && self.tint == 0.0 {
            return DMat3::IDENTITY;
        }
        correction(f64::from(self.temperature), f64::from(self.tint))
    }
}

impl Node for WhiteBalance {
    fn outputs(&self, inputs: &mut Inputs<'_>) -> Result<Vec<Output>, Mistake> {
        tinted(inputs, &self.image, true)
    }

    fn lower(&self, cx: &mut Lowering<'_>) -> Result<(), Mistake> {
        let [r, g, b] = rows(&self.matrix());
        let [r, g, b] = [r, g, b].map(|[x, y, z]| [x, y, z, 0.0]);
        point(cx, &self.image, shader!("colour/color_matrix"))
            .param("r", r)
            .param("g", g)
            .param("b", b)
            .param("a", [0.0, 0.0, 0.0, 1.0])
            .add();
        Ok(())
    }

    fn reference(&self, cx: &Reference<'_>) -> Vec<Tensor> {
        let m = self.matrix();
        map_tinted(cx, &self.image, true, |c| (m * DVec3::from_array(c)).to_array())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// colour-science 0.4: `CCT_to_uv_Krystek1985`, numerical normal, `matrix_chromatic_adaptation_VonKries(…, "Bradford")`.
    #[test]
    fn corrections_are_those_of_colour_science() {
        let expected = [
            (3200.0, 0.0, [[0.811_898, -0.339_073, -0.078_281], [0.015_789, 1.116_512, -0.032_052], [0.037_845, 0.141_101, 2.617_306]]),
            (9000.0, -40.0, [[0.987_414, -0.069_654, 0.008_719], [0.003_655, 1.052_725, 0.007_252], [-0.005_998, -0.027_569, 0.726_394]]),
            (5000.0, 25.0, [[0.968_428, -0.026_206, -0.020_830], [0.000_975, 0.990_340, -0.010_723], [0.011_133, 0.044_610, 1.484_546]]),
        ];
        for (temperature, tint, rows) in expected {
            let m = correction(temperature, tint);
            for (i, row) in rows.iter().enumerate() {
                for (j, v) in row.iter().enumerate() {
                    assert!((m.row(i)[j] - v).abs() < 2e-6, "{temperature} K, {tint}: {m}");
                }
            }
        }
    }
}
