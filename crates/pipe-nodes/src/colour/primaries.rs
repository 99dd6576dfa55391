//! Primaries and white points: the matrices between linear colour spaces.

use glam::{DMat3, DVec3};

/// CIE 1931 chromaticity of CIE illuminant D65, as ITU-R BT.709 rounds it.
pub(super) const D65: [f64; 2] = [0.3127, 0.3290];

/// Chromaticity of the ACES white (SMPTE ST 2065-1).
const ACES_WHITE: [f64; 2] = [0.32168, 0.33767];

/// Chromaticities of red, green, blue and white.
pub(super) type Chromaticities = [[f64; 2]; 4];

/// ITU-R BT.709-6; sRGB has the same.
pub(super) const REC709: Chromaticities = [[0.64, 0.33], [0.30, 0.60], [0.15, 0.06], D65];

/// ITU-R BT.2020-2.
pub(super) const REC2020: Chromaticities = [[0.708, 0.292], [0.170, 0.797], [0.131, 0.046], D65];

/// SMPTE RP 431-2 with the white of displays (Display P3).
pub(super) const P3: Chromaticities = [[0.680, 0.320], [0.265, 0.690], [0.150, 0.060], D65];

/// Academy S-2014-004: AP1.
pub(super) const ACES_AP1: Chromaticities = [[0.713, 0.293], [0.165, 0.830], [0.128, 0.044], ACES_WHITE];

/// SMPTE ST 2065-1: AP0.
pub(super) const ACES_AP0: Chromaticities = [[0.7347, 0.2653], [0.0, 1.0], [0.0001, -0.0770], ACES_WHITE];

/// XYZ of a chromaticity, Y = 1.
pub(super) fn xyz_of([x, y]: [f64; 2]) -> DVec3 {
    DVec3::new(x / y, 1.0, (1.0 - x - y) / y)
}

/// Linear RGB of these primaries to XYZ in which D65 is white (SMPTE RP 177, white adapted by Bradford).
pub(super) fn to_xyz([r, g, b, white]: Chromaticities) -> DMat3 {
    let p = DMat3::from_cols(xyz_of(r), xyz_of(g), xyz_of(b));
    let own = p * DMat3::from_diagonal(p.inverse() * xyz_of(white));
    if white == D65 { own } else { adaptation(xyz_of(white), xyz_of(D65)) * own }
}

/// Takes XYZ seen under one white to what looks alike under another: von Kries in the cones of Bradford (K. Lam 1985).
pub(super) fn adaptation(from: DVec3, to: DVec3) -> DMat3 {
    let cones = DMat3::from_cols_array(&[0.8951, -0.7502, 0.0389, 0.2664, 1.7135, -0.0685, -0.1614, 0.0367, 1.0296]);
    cones.inverse() * DMat3::from_diagonal((cones * to) / (cones * from)) * cones
}

/// The rows of a matrix as a shader takes them.
pub(super) fn rows(m: &DMat3) -> [[f32; 3]; 3] {
    [0, 1, 2].map(|i| m.row(i).to_array().map(|v| v as f32))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn near(m: &DMat3, rows: [[f64; 3]; 3], tolerance: f64) -> bool {
        (0..3).all(|i| (0..3).all(|j| (m.row(i)[j] - rows[i][j]).abs() < tolerance))
    }

    #[test]
    fn matrices_are_the_published_ones() {
        let (srgb, from_ap0) = (to_xyz(REC709), to_xyz(ACES_AP0).inverse());
        // IEC 61966-2-1, to the four places given there.
        assert!(near(&srgb, [[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]], 6e-5), "{srgb}");
        // ITU-R BT.2087-0.
        let wide = to_xyz(REC2020).inverse() * srgb;
        assert!(near(&wide, [[0.6274, 0.3293, 0.0433], [0.0691, 0.9195, 0.0114], [0.0164, 0.0880, 0.8956]], 6e-5), "{wide}");
        // colour-science 0.4: `normalised_primary_matrix`, `matrix_chromatic_adaptation_VonKries(…, "Bradford")`.
        let ap1 = to_xyz(ACES_AP1).inverse() * srgb;
        let expected = [
            [0.613_097_402, 0.339_523_146, 0.047_379_451],
            [0.070_193_722, 0.916_353_879, 0.013_452_398],
            [0.020_615_593, 0.109_569_773, 0.869_814_634],
        ];
        assert!(near(&ap1, expected, 1e-8), "{ap1}");
        let ap0 = from_ap0 * srgb;
        let expected = [
            [0.439_632_982, 0.382_988_698, 0.177_378_320],
            [0.089_776_443, 0.813_439_429, 0.096_784_128],
            [0.017_541_170, 0.111_546_553, 0.870_912_276],
        ];
        assert!(near(&ap0, expected, 1e-8), "{ap0}");
        let p3 = to_xyz(P3).inverse() * srgb;
        let expected =
            [[0.822_461_969, 0.177_538_031, 0.0], [0.033_194_199, 0.966_805_801, 0.0], [0.017_082_631, 0.072_397_441, 0.910_519_929]];
        assert!(near(&p3, expected, 1e-8), "{p3}");
    }
}
