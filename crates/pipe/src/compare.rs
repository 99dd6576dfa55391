//! How far two images are from each other.

use pipe_io::{Picture, ReadOptions, Source};

use crate::Failure;

/// The measures of `pipe compare`.
#[derive(Debug, Clone, PartialEq)]
pub struct Comparison {
    /// Largest absolute difference of any channel; infinite when one value is no number and the other is.
    pub max_abs: f64,
    /// Mean absolute difference.
    pub mean_abs: f64,
    /// Root mean square difference.
    pub rms: f64,
    /// 10·log₁₀(peak²/MSE), peak 1; infinite for equal images.
    pub psnr_db: f64,
    /// Mean FLIP error (Andersson et al. 2020) of the sRGB images, 0 to 1.
    pub flip_mean: f64,
    /// Share of pixels that differ by more than the limit, percent.
    pub different_percent: f64,
    /// Where the difference is largest.
    pub worst: Worst,
    /// Size of both.
    pub size: [u32; 2],
    /// Largest difference of any channel at each pixel, rows from the top.
    pub map: Vec<f32>,
}

/// The place of the largest difference.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[allow(missing_docs)]
pub struct Worst {
    pub x: u32,
    pub y: u32,
    pub channel: usize,
    pub a: f64,
    pub b: f64,
}

impl Comparison {
    /// `{max_abs, mean_abs, rms, psnr_db, flip_mean, different_percent, worst: {x, y, channel, a, b}}`; infinities are
    /// texts, since JSON has none.
    pub fn to_json(&self) -> serde_json::Value {
        let number = |v: f64| if v.is_finite() { serde_json::json!(v) } else { serde_json::json!(v.to_string()) };
        serde_json::json!({
            "max_abs": number(self.max_abs),
            "mean_abs": number(self.mean_abs),
            "rms": number(self.rms),
            "psnr_db": number(self.psnr_db),
            "flip_mean": number(self.flip_mean),
            "different_percent": self.different_percent,
            "worst": {
                "x": self.worst.x,
                "y": self.worst.y,
                "channel": self.worst.channel,
                "a": number(self.worst.a),
                "b": number(self.worst.b),
            },
        })
    }
}

/// An image's values as they are stored, RGBA or fewer channels, in 0..1 for integers.
struct Values {
    size: [u32; 2],
    channels: usize,
    data: Vec<f32>,
    srgb: bool,
}

/// The values of a picture in so many channels: grey is spread over three, and what has no alpha is opaque.
fn values(p: &Picture, channels: usize) -> Values {
    let own = p.channels.count();
    let place = |c: usize| match (own, c) {
        _ if own == channels => Some(c),
        (1 | 3, 3) => None,
        (2, 3) => Some(1),
        (1 | 2, _) => Some(0),
        _ => Some(c),
    };
    let mut data = Vec::with_capacity(p.width as usize * p.height as usize * channels);
    for y in 0..p.height {
        for x in 0..p.width {
            for c in 0..channels {
                data.push(place(c).map_or(1.0, |c| p.sample_at(x, y, c).unwrap_or(f32::NAN)));
            }
        }
    }
    let srgb = p.colour.transfer != pipe_io::Transfer::Linear;
    Values { size: [p.width, p.height], channels, data, srgb }
}

/// Compares two files; differences up to `limit` do not count as different.
pub fn compare_files(a: &str, b: &str, limit: f64) -> Result<Comparison, Failure> {
    let read = |name: &str| pipe_io::read(&Source::parse(name), &ReadOptions::default());
    let (pa, pb) = (read(a)?, read(b)?);
    compare(&pa, &pb, limit).map_err(|e| Failure::World(format!("{a} and {b} cannot be compared: {e}")))
}

/// Compares two pictures.
pub fn compare(a: &Picture, b: &Picture, limit: f64) -> Result<Comparison, String> {
    let channels = match [a, b].map(|p| p.channels.count()) {
        [one, other] if one == other => one,
        counts if counts.contains(&2) || counts.contains(&4) => 4,
        _ => 3,
    };
    let (a, b) = (values(a, channels), values(b, channels));
    if a.size != b.size {
        return Err(format!("one is {}x{}, the other {}x{}", a.size[0], a.size[1], b.size[0], b.size[1]));
    }
    let pixels = a.size[0] as usize * a.size[1] as usize;
    let mut map = vec![0.0_f32; pixels];
    let (mut sum, mut squares, mut largest, mut different) = (0.0, 0.0, -1.0, 0_usize);
    let mut worst = Worst::default();
    for (p, (pa, pb)) in a.data.chunks_exact(a.channels).zip(b.data.chunks_exact(b.channels)).enumerate() {
        let mut here = 0.0_f64;
        for (c, (va, vb)) in pa.iter().zip(pb).enumerate() {
            let (va, vb) = (f64::from(*va), f64::from(*vb));
            // Equal infinities and two NaNs do not differ.
            let d = if va == vb || (va.is_nan() && vb.is_nan()) { 0.0 } else { (va - vb).abs() };
            let d = if d.is_nan() { f64::INFINITY } else { d };
            sum += d;
            squares += d * d;
            here = here.max(d);
            if d > largest {
                largest = d;
                worst = Worst { x: (p % a.size[0] as usize) as u32, y: (p / a.size[0] as usize) as u32, channel: c, a: va, b: vb };
            }
        }
        map[p] = here as f32;
        different += usize::from(here > limit);
    }
    let count = a.data.len() as f64;
    let mse = squares / count;
    Ok(Comparison {
        max_abs: largest.max(0.0),
        mean_abs: sum / count,
        rms: mse.sqrt(),
        psnr_db: if mse == 0.0 { f64::INFINITY } else { -10.0 * mse.log10() },
        flip_mean: flip(&a, &b),
        different_percent: 100.0 * different as f64 / pixels as f64,
        worst,
        size: a.size,
        map,
    })
}

/// Mean FLIP of the images as a display shows them.
fn flip(a: &Values, b: &Values) -> f64 {
    let shown = |v: &Values| {
        let mut rgb = Vec::with_capacity(v.data.len());
        for p in v.data.chunks_exact(v.channels) {
            let colour = if v.channels < 3 { [p[0]; 3] } else { [p[0], p[1], p[2]] };
            rgb.extend(colour.map(|c| {
                let c = if c.is_nan() { 0.0 } else { c.clamp(0.0, 1.0) };
                let e = if v.srgb {
                    c
                } else if c <= 0.003_130_8 {
                    12.92 * c
                } else {
                    1.055 * c.powf(1.0 / 2.4) - 0.055
                };
                (e * 255.0 + 0.5) as u8
            }));
        }
        nv_flip::FlipImageRgb8::with_data(v.size[0], v.size[1], &rgb)
    };
    let error = nv_flip::flip(shown(a), shown(b), nv_flip::DEFAULT_PIXELS_PER_DEGREE);
    f64::from(nv_flip::FlipPool::from_image(&error).mean())
}
