//! What numbers in a file mean as light: primaries, white and transfer function.
//!
//! The working space is linear light with Rec.709 primaries and D65 white. A file's values go there by their transfer
//! function and then one 3×3 matrix, which [`Colour::to_working_matrix`] computes in f64: RGB → XYZ from the
//! chromaticities (SMPTE RP 177-1993), a Bradford adaptation of the file's white to D65, XYZ → Rec.709. The matrix is
//! plain data for the GPU's unpack pass. Gamut mapping is not done: colours outside Rec.709 become negative values,
//! which float pixels keep.

use std::str::FromStr;

use crate::error::Error;

/// CIE 1931 xy chromaticities of the primaries and the white of an RGB space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Primaries {
    /// Red (x, y).
    pub red: [f64; 2],
    /// Green (x, y).
    pub green: [f64; 2],
    /// Blue (x, y).
    pub blue: [f64; 2],
    /// White (x, y): the colour of R = G = B.
    pub white: [f64; 2],
}

const D65: [f64; 2] = [0.3127, 0.3290];
const ACES_WHITE: [f64; 2] = [0.32168, 0.33767];

impl Primaries {
    /// ITU-R BT.709 and sRGB.
    pub const REC709: Self = Self { red: [0.64, 0.33], green: [0.30, 0.60], blue: [0.15, 0.06], white: D65 };
    /// ITU-R BT.2020.
    pub const REC2020: Self = Self { red: [0.708, 0.292], green: [0.170, 0.797], blue: [0.131, 0.046], white: D65 };
    /// Display P3 (SMPTE RP 431-2 primaries, D65 white).
    pub const P3: Self = Self { red: [0.680, 0.320], green: [0.265, 0.690], blue: [0.150, 0.060], white: D65 };
    /// ACEScg, also called AP1 (S-2014-004).
    pub const ACESCG: Self = Self { red: [0.713, 0.293], green: [0.165, 0.830], blue: [0.128, 0.044], white: ACES_WHITE };
    /// ACES2065-1, also called AP0 (ST 2065-1).
    pub const ACES2065_1: Self = Self { red: [0.7347, 0.2653], green: [0.0, 1.0], blue: [0.0001, -0.077], white: ACES_WHITE };
    /// CIE XYZ as an RGB space, white at equal energy.
    pub const XYZ: Self = Self { red: [1.0, 0.0], green: [0.0, 1.0], blue: [0.0, 0.0], white: [1.0 / 3.0, 1.0 / 3.0] };

    /// RGB → XYZ with Y = 1 for white (SMPTE RP 177-1993); `None` where the primaries span no space.
    pub fn to_xyz(&self) -> Option<Matrix> {
        // Columns (x, y, 1−x−y) instead of the usual (x/y, 1, z/y): the scale is solved for anyway, and a primary
        // with y = 0 (XYZ's own) stays finite.
        let column = |[x, y]: [f64; 2]| [x, y, 1.0 - x - y];
        let [r, g, b] = [column(self.red), column(self.green), column(self.blue)];
        let columns = [[r[0], g[0], b[0]], [r[1], g[1], b[1]], [r[2], g[2], b[2]]];
        let white = xyz_of(self.white)?;
        let scale = apply(&inverse(&columns)?, white);
        let matrix = columns.map(|row| [row[0] * scale[0], row[1] * scale[1], row[2] * scale[2]]);
        matrix.iter().flatten().all(|value| value.is_finite()).then_some(matrix)
    }

    /// Whether all chromaticities agree within `tolerance`.
    pub fn near(&self, other: &Self, tolerance: f64) -> bool {
        let close = |a: [f64; 2], b: [f64; 2]| (a[0] - b[0]).abs() <= tolerance && (a[1] - b[1]).abs() <= tolerance;
        close(self.red, other.red) && close(self.green, other.green) && close(self.blue, other.blue) && close(self.white, other.white)
    }

    /// These primaries, or the named ones that they are a rounding of, so that f32 chromaticities of a file compare
    /// equal to ours and Rec.709 files get an exact identity.
    #[must_use]
    pub fn snapped(self) -> Self {
        let named = [Self::REC709, Self::REC2020, Self::P3, Self::ACESCG, Self::ACES2065_1, Self::XYZ];
        named.into_iter().find(|known| self.near(known, 1e-4)).unwrap_or(self)
    }
}

/// How stored values relate to linear light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Transfer {
    /// Stored values are proportional to light.
    Linear,
    /// IEC 61966-2-1, extended to negative values by symmetry.
    Srgb,
    /// encoded = linear^(1/g); g > 0.
    Gamma(f32),
}

impl Transfer {
    /// Linear light of a stored value.
    pub fn decode(self, value: f64) -> f64 {
        match self {
            Self::Linear => value,
            Self::Srgb => {
                let v = value.abs();
                let linear = if v <= 0.04045 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) };
                linear.copysign(value)
            }
            Self::Gamma(g) => value.abs().powf(f64::from(g)).copysign(value),
        }
    }
}

/// The meaning of stored colour values.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Colour {
    /// Which colours the channels are.
    pub primaries: Primaries,
    /// How values relate to light.
    pub transfer: Transfer,
}

/// Rows of a 3×3 matrix that multiplies a column vector.
pub type Matrix = [[f64; 3]; 3];

impl Colour {
    /// The working space: linear light, Rec.709 primaries, D65 white.
    pub const LINEAR_REC709: Self = Self { primaries: Primaries::REC709, transfer: Transfer::Linear };
    /// sRGB.
    pub const SRGB: Self = Self { primaries: Primaries::REC709, transfer: Transfer::Srgb };

    /// Linear RGB of this space → linear Rec.709, rows first; white goes to white (Bradford), except for CIE XYZ,
    /// which is absolute. Exactly the identity for Rec.709 primaries, and for primaries that span no space.
    pub fn to_working_matrix(&self) -> [[f32; 3]; 3] {
        narrow(self.working(false))
    }

    /// Linear Rec.709 → linear RGB of this space; the inverse of [`Self::to_working_matrix`].
    pub fn from_working_matrix(&self) -> [[f32; 3]; 3] {
        narrow(self.working(true))
    }

    fn working(&self, from: bool) -> Matrix {
        if self.primaries == Primaries::REC709 {
            return IDENTITY;
        }
        let matrix = || {
            let here = self.primaries.to_xyz()?;
            let working = inverse(&Primaries::REC709.to_xyz()?)?;
            // A file of CIE XYZ holds tristimulus values as they are. Its "white" is a unit of measurement and not
            // what the scene was adapted to: OpenEXR's own sample of one picture in both spaces says so.
            let absolute = self.primaries == Primaries::XYZ;
            let adapted = if absolute { here } else { multiply(&bradford(self.primaries.white, D65)?, &here) };
            let to = multiply(&working, &adapted);
            if from { inverse(&to) } else { Some(to) }
        };
        matrix().unwrap_or(IDENTITY)
    }
}

/// A name for the colours of a file, as `--in-colorspace` and `--out-colorspace` take it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Colorspace {
    /// The working space.
    LinearRec709,
    /// sRGB transfer, Rec.709 primaries.
    Srgb,
    /// Linear light, Rec.2020 primaries.
    Rec2020Linear,
    /// Linear light, AP1 primaries, ACES white.
    AcesCg,
    /// The numbers as they are: nothing is converted on the way in or out, nothing is tagged.
    Raw,
}

impl Colorspace {
    /// Every name, in the order of the manual.
    pub const ALL: [Self; 5] = [Self::LinearRec709, Self::Srgb, Self::Rec2020Linear, Self::AcesCg, Self::Raw];

    /// As the command line spells it.
    pub const fn name(self) -> &'static str {
        match self {
            Self::LinearRec709 => "linear-rec709",
            Self::Srgb => "srgb",
            Self::Rec2020Linear => "rec2020-linear",
            Self::AcesCg => "acescg",
            Self::Raw => "raw",
        }
    }

    /// What values in it mean. `Raw` values are taken for the working space, which makes every conversion an identity.
    pub const fn colour(self) -> Colour {
        match self {
            Self::LinearRec709 | Self::Raw => Colour::LINEAR_REC709,
            Self::Srgb => Colour::SRGB,
            Self::Rec2020Linear => Colour { primaries: Primaries::REC2020, transfer: Transfer::Linear },
            Self::AcesCg => Colour { primaries: Primaries::ACESCG, transfer: Transfer::Linear },
        }
    }
}

impl FromStr for Colorspace {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self, Error> {
        Self::ALL.into_iter().find(|space| space.name() == text).ok_or_else(|| {
            let names = Self::ALL.map(Self::name).join(", ");
            Error::argument(text, format!("a colour space: {names}"))
        })
    }
}

const IDENTITY: Matrix = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

/// Bradford's cone response (Lam 1985).
const BRADFORD: Matrix = [[0.8951, 0.2664, -0.1614], [-0.7502, 1.7135, 0.0367], [0.0389, -0.0685, 1.0296]];

fn bradford(from: [f64; 2], to: [f64; 2]) -> Option<Matrix> {
    if from == to {
        return Some(IDENTITY);
    }
    let (source, target) = (apply(&BRADFORD, xyz_of(from)?), apply(&BRADFORD, xyz_of(to)?));
    let mut scaled = BRADFORD;
    for i in 0..3 {
        scaled[i] = scaled[i].map(|value| value * target[i] / source[i]);
    }
    Some(multiply(&inverse(&BRADFORD)?, &scaled))
}

fn xyz_of([x, y]: [f64; 2]) -> Option<[f64; 3]> {
    (y.is_finite() && x.is_finite() && y > 0.0).then(|| [x / y, 1.0, (1.0 - x - y) / y])
}

fn apply(m: &Matrix, v: [f64; 3]) -> [f64; 3] {
    m.map(|row| row[0] * v[0] + row[1] * v[1] + row[2] * v[2])
}

fn multiply(a: &Matrix, b: &Matrix) -> Matrix {
    a.map(|row| [0, 1, 2].map(|j| row[0] * b[0][j] + row[1] * b[1][j] + row[2] * b[2][j]))
}

/// By cofactors; `None` for a (nearly) singular matrix.
fn inverse(m: &Matrix) -> Option<Matrix> {
    let cofactor = |i: usize, j: usize| {
        let (a, b) = ((i + 1) % 3, (i + 2) % 3);
        let (c, d) = ((j + 1) % 3, (j + 2) % 3);
        m[a][c] * m[b][d] - m[a][d] * m[b][c]
    };
    let determinant = m[0][0] * cofactor(0, 0) + m[0][1] * cofactor(0, 1) + m[0][2] * cofactor(0, 2);
    (determinant.is_finite() && determinant.abs() > 1e-12).then(|| [0, 1, 2].map(|i| [0, 1, 2].map(|j| cofactor(j, i) / determinant)))
}

fn narrow(m: Matrix) -> [[f32; 3]; 3] {
    m.map(|row| row.map(|value| value as f32))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn near(got: [[f32; 3]; 3], want: [[f64; 3]; 3], tolerance: f64) {
        for (row, expected) in got.iter().zip(want) {
            for (value, expected) in row.iter().zip(expected) {
                assert!((f64::from(*value) - expected).abs() < tolerance, "{got:?} is not {want:?}");
            }
        }
    }

    #[test]
    fn rec709_to_xyz_is_the_standard_matrix() {
        // IEC 61966-2-1, annex F (rounded to four digits there).
        let want = [[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]];
        near(narrow(Primaries::REC709.to_xyz().unwrap()), want, 1e-4);
    }

    #[test]
    fn acescg_to_rec709_is_the_published_matrix() {
        // The ACES distribution's AP1 → Rec.709 with Bradford adaptation.
        let want = [[1.705_051, -0.621_792, -0.083_258], [-0.130_257, 1.140_804, -0.010_548], [-0.024_003, -0.128_969, 1.152_972]];
        let acescg = Colour { primaries: Primaries::ACESCG, transfer: Transfer::Linear };
        near(acescg.to_working_matrix(), want, 2e-5);
    }

    #[test]
    fn white_stays_white_and_there_is_a_way_back() {
        for primaries in [Primaries::REC2020, Primaries::P3, Primaries::ACES2065_1] {
            let colour = Colour { primaries, transfer: Transfer::Linear };
            let (to, from) = (colour.to_working_matrix(), colour.from_working_matrix());
            let wide = |m: [[f32; 3]; 3]| m.map(|row| row.map(f64::from));
            for value in apply(&wide(to), [1.0; 3]) {
                assert!((value - 1.0).abs() < 1e-6);
            }
            near(narrow(multiply(&wide(to), &wide(from))), IDENTITY, 1e-5);
        }
    }

    #[test]
    fn xyz_is_absolute() {
        // IEC 61966-2-1: XYZ → linear sRGB.
        let want = [[3.2406, -1.5372, -0.4986], [-0.9689, 1.8758, 0.0415], [0.0557, -0.2040, 1.0570]];
        near(Colour { primaries: Primaries::XYZ, transfer: Transfer::Linear }.to_working_matrix(), want, 1e-3);
    }

    #[test]
    fn degenerate_primaries_are_left_alone() {
        let flat = Primaries { red: [0.3, 0.3], green: [0.3, 0.3], blue: [0.3, 0.3], white: [0.3, 0.0] };
        let colour = Colour { primaries: flat, transfer: Transfer::Linear };
        near(colour.to_working_matrix(), IDENTITY, 0.0 + f64::EPSILON);
    }

    #[test]
    fn colour_spaces_are_found_by_name() {
        assert_eq!("acescg".parse::<Colorspace>().unwrap(), Colorspace::AcesCg);
        let error = "adobe".parse::<Colorspace>().unwrap_err().to_string();
        assert!(error.contains("rec2020-linear"), "{error}");
    }
}
