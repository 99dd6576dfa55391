//! ICC profiles: what the numbers of an integer file mean.
//!
//! Most profiles are a matrix and one curve, and most curves are sRGB, a power or a straight line. Those become a
//! [`Colour`] tag, the samples stay as they are and the GPU does the conversion. The rest (tables, mixed curves) is
//! converted here, to f32 linear Rec.709, by moxcms. Profiles for other colour models than the pixels' (the CMYK
//! profile of a JPEG that was decoded to RGB) cannot be applied and are ignored.

use moxcms::{ColorProfile, DataColorSpace, Layout, ToneReprCurve, TransformOptions};

use crate::colour::{Colour, Primaries, Transfer};
use crate::error::Fault;
use crate::picture::{Channels, Picture, Sample};

/// What a profile asks for.
pub(crate) enum Meaning {
    /// The samples can stay: this is what they mean.
    Tag(Colour),
    /// They must be converted with this profile.
    Convert(Box<ColorProfile>),
    /// The profile is unreadable or does not fit the pixels: use the format's default.
    Ignore,
}

/// Reads a profile for pixels that are grey or RGB.
pub(crate) fn meaning(profile: &[u8], grey: bool) -> Meaning {
    let Ok(profile) = ColorProfile::new_from_slice(profile) else { return Meaning::Ignore };
    let wanted = if grey { DataColorSpace::Gray } else { DataColorSpace::Rgb };
    if profile.color_space != wanted {
        return Meaning::Ignore;
    }
    match tag(&profile, grey) {
        Some(colour) => Meaning::Tag(colour),
        None => Meaning::Convert(Box::new(profile)),
    }
}

/// The colour that a profile expresses exactly (within 2⁻¹⁰ of the curve), if one does.
fn tag(profile: &ColorProfile, grey: bool) -> Option<Colour> {
    if grey {
        let transfer = transfer(profile.gray_trc.as_ref()?)?;
        return Some(Colour { primaries: Primaries::REC709, transfer });
    }
    let has_tables = profile.lut_a_to_b_perceptual.is_some() || profile.lut_a_to_b_colorimetric.is_some();
    if has_tables {
        return None;
    }
    let curves = [&profile.red_trc, &profile.green_trc, &profile.blue_trc];
    let [red, green, blue] = curves.map(|curve| curve.as_ref().and_then(transfer));
    if red.is_none() || red != green || red != blue {
        return None;
    }
    // Colorants are relative to the profile connection space's D50 white, and so are chromaticities made from them.
    let colorants = [profile.red_colorant, profile.green_colorant, profile.blue_colorant].map(|c| [c.x, c.y, c.z]);
    let chromaticity = |[x, y, z]: [f64; 3]| [x / (x + y + z), y / (x + y + z)];
    let sum = |i: usize| colorants.iter().map(|colorant| colorant[i]).sum::<f64>();
    let white = chromaticity([sum(0), sum(1), sum(2)]);
    let [r, g, b] = colorants.map(chromaticity);
    let primaries = Primaries { red: r, green: g, blue: b, white };
    let colour = Colour { primaries, transfer: red? };
    primaries.to_xyz()?;
    let matrix = colour.to_working_matrix();
    let near_identity = (0..3).all(|i| (0..3).all(|j| (matrix[i][j] - f32::from(i == j)).abs() < 2e-3));
    Some(if near_identity { Colour { primaries: Primaries::REC709, ..colour } } else { colour })
}

fn transfer(curve: &ToneReprCurve) -> Option<Transfer> {
    // ICC.1:2010, table 64: the parameters g, a, b, c, d (, e, f) by their number.
    let value: Box<dyn Fn(f64) -> f64> = match curve {
        ToneReprCurve::Lut(table) => match table.as_slice() {
            [] => return Some(Transfer::Linear),
            [gamma] => return power(f32::from(*gamma) / 256.0),
            table => {
                let table = table.to_vec();
                Box::new(move |x| {
                    let at = x * (table.len() - 1) as f64;
                    let i = (at as usize).min(table.len() - 2);
                    let (a, b) = (f64::from(table[i]), f64::from(table[i + 1]));
                    (a + (b - a) * (at - i as f64)) / 65535.0
                })
            }
        },
        ToneReprCurve::Parametric(p) => {
            let p: Vec<f64> = p.iter().map(|&value| f64::from(value)).collect();
            match *p.as_slice() {
                [g] => return power(g as f32),
                [g, a, b] => Box::new(move |x| if x >= -b / a { (a * x + b).powf(g) } else { 0.0 }),
                [g, a, b, c] => Box::new(move |x| if x >= -b / a { (a * x + b).powf(g) + c } else { c }),
                [g, a, b, c, d] => Box::new(move |x| if x >= d { (a * x + b).powf(g) } else { c * x }),
                [g, a, b, c, d, e, f] => Box::new(move |x| if x >= d { (a * x + b).powf(g) + e } else { c * x + f }),
                _ => return None,
            }
        }
    };
    let agrees = |candidate: &Transfer| {
        (0..=255).all(|i| {
            let x = f64::from(i) / 255.0;
            (value(x) - candidate.decode(x)).abs() < 1.0 / 1024.0
        })
    };
    [Transfer::Srgb, Transfer::Linear, Transfer::Gamma(2.2), Transfer::Gamma(1.8)].into_iter().find(agrees)
}

fn power(gamma: f32) -> Option<Transfer> {
    match gamma {
        1.0 => Some(Transfer::Linear),
        g if g > 0.0 && g.is_finite() => Some(Transfer::Gamma(g)),
        _ => None,
    }
}

/// Converts an interleaved picture to f32 linear Rec.709; alpha is kept.
pub(crate) fn convert(profile: &ColorProfile, picture: Picture) -> Result<Picture, Fault> {
    let failed = |error: moxcms::CmsError| Fault::unsupported(format!("its ICC profile ({error})"));
    let values: Vec<f32> = match picture.sample {
        Sample::U8 => picture.bytes.iter().map(|&byte| f32::from(byte) / 255.0).collect(),
        Sample::U16 => {
            let words = picture.bytes.as_chunks::<2>().0;
            words.iter().map(|&word| f32::from(u16::from_ne_bytes(word)) / 65535.0).collect()
        }
        // Float files are linear by convention; their profiles are not applied.
        Sample::F16 | Sample::F32 => return Ok(picture),
    };
    let (from, to, channels) = match picture.channels {
        Channels::Y => (Layout::Gray, Layout::Rgb, Channels::Rgb),
        Channels::Ya => (Layout::GrayAlpha, Layout::Rgba, Channels::Rgba),
        Channels::Rgb => (Layout::Rgb, Layout::Rgb, Channels::Rgb),
        Channels::Rgba => (Layout::Rgba, Layout::Rgba, Channels::Rgba),
    };
    let mut linear = ColorProfile::new_srgb();
    let straight = ToneReprCurve::Lut(Vec::new());
    linear.red_trc = Some(straight.clone());
    linear.green_trc = Some(straight.clone());
    linear.blue_trc = Some(straight);
    linear.cicp = None;
    let options = TransformOptions { allow_use_cicp_transfer: false, ..TransformOptions::default() };
    let transform = profile.create_transform_f32(from, &linear, to, options).map_err(failed)?;
    let count = picture.width as usize * picture.height as usize * channels.count();
    let mut converted = vec![0.0f32; count];
    transform.transform(&values, &mut converted).map_err(failed)?;
    Ok(Picture {
        sample: Sample::F32,
        channels,
        colour: Colour::LINEAR_REC709,
        bytes: bytemuck::cast_slice(&converted).to_vec(),
        ..picture
    })
}

/// Applies what a profile asks for to a decoded picture.
pub(crate) fn apply(profile: Option<&[u8]>, picture: Picture) -> Result<Picture, Fault> {
    let Some(profile) = profile else { return Ok(picture) };
    match meaning(profile, picture.channels.is_grey()) {
        Meaning::Tag(colour) => Ok(Picture { colour, ..picture }),
        Meaning::Convert(profile) => convert(&profile, picture),
        Meaning::Ignore => Ok(picture),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tagged(profile: &ColorProfile, grey: bool) -> Option<Colour> {
        match meaning(&profile.encode().unwrap(), grey) {
            Meaning::Tag(colour) => Some(colour),
            _ => None,
        }
    }

    #[test]
    fn common_profiles_keep_the_integers() {
        assert_eq!(tagged(&ColorProfile::new_srgb(), false), Some(Colour::SRGB));
        let grey = tagged(&ColorProfile::new_gray_with_gamma(2.2), true).unwrap();
        assert!(matches!(grey.transfer, Transfer::Gamma(g) if (g - 2.2).abs() < 0.01));
    }

    #[test]
    fn display_p3_has_its_own_matrix() {
        let colour = tagged(&ColorProfile::new_display_p3(), false).unwrap();
        assert_eq!(colour.transfer, Transfer::Srgb);
        let matrix = colour.to_working_matrix();
        // P3 → sRGB, as published with CSS Color 4.
        let want = [[1.2249, -0.2247, 0.0], [-0.0420, 1.0419, 0.0], [-0.0197, -0.0786, 1.0979]];
        for (row, want) in matrix.iter().zip(want) {
            for (value, want) in row.iter().zip(want) {
                assert!((value - want).abs() < 2e-3, "{matrix:?}");
            }
        }
    }

    #[test]
    fn other_curves_are_converted_here() {
        let mut profile = ColorProfile::new_srgb();
        let cubic = ToneReprCurve::Lut((0..256).map(|i| ((f64::from(i) / 255.0).powi(3) * 65535.0) as u16).collect());
        profile.red_trc = Some(cubic.clone());
        profile.green_trc = Some(cubic.clone());
        profile.blue_trc = Some(cubic);
        profile.cicp = None;
        let before = Picture {
            width: 2,
            height: 1,
            sample: Sample::U8,
            layout: crate::Layout::Interleaved,
            channels: Channels::Rgba,
            alpha: crate::Alpha::Straight,
            colour: Colour::SRGB,
            bytes: vec![255, 128, 0, 77, 51, 204, 102, 255],
            metadata: crate::Metadata::default(),
        };
        let after = apply(Some(&profile.encode().unwrap()), before.clone()).unwrap();
        assert_eq!((after.sample, after.colour), (Sample::F32, Colour::LINEAR_REC709));
        for (x, channel) in (0..2).flat_map(|x| (0..4).map(move |channel| (x, channel))) {
            let [got, stored] = [&after, &before].map(|p| p.sample_at(x, 0, channel).unwrap());
            let want = if channel == 3 { stored } else { stored.powi(3) };
            assert!((got - want).abs() < 4e-3, "pixel {x}, channel {channel}: {got}, not {want}");
        }
    }
}
