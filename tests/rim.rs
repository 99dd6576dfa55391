//! What becomes of samples between a file and the GPU, for every value that a file can hold.

use std::collections::HashMap;
use std::sync::Arc;

use half::f16;
use pipe_gpu::{Choice, Device, Executor, RunOptions};
use pipe_graph::rim::{Alpha, Layout, PixelForm, Sample, Transfer};
use pipe_graph::types::{EdgeType, ImageType};
use pipe_plan::Options;
use pipe_plan::lower::Rim;
use pipe_tests::bench::compile;

/// Sends pixels to the GPU in one form and fetches them in another.
struct Crossing(Executor);

impl Crossing {
    fn open() -> Self {
        let choice = Choice::parse(&std::env::var("PIPE_DEVICE").unwrap_or_default());
        Self(Executor::new(Device::open(&choice).unwrap_or_else(|e| panic!("{e}")), None))
    }

    fn cross(&mut self, bytes: &[u8], from: PixelForm, to: PixelForm) -> Vec<u8> {
        let text = r#"Graph(version: 1, inputs: {"in": Image}, nodes: {}, outputs: {"out": "in"})"#;
        let ty = EdgeType::Image(ImageType::new(from.size, from.image_channels()));
        let graph = compile(text, &[("in", ty)]).unwrap_or_else(|e| panic!("{e}"));
        let rim = Rim { inputs: [("in".to_owned(), from)].into(), outputs: [("out".to_owned(), to)].into(), ..Rim::default() };
        let limits = self.0.device().limits();
        let plan = pipe_plan::plan_graph(&graph, &rim, &limits, &Options::default(), &|_| true).unwrap_or_else(|e| panic!("{e}"));
        let prepared = self.0.prepare(Arc::new(plan)).unwrap_or_else(|e| panic!("{e}"));
        let given = HashMap::from([("in", bytes)]);
        let mut outputs = self.0.run(&prepared, &given, &RunOptions::default()).unwrap_or_else(|e| panic!("{e}"));
        self.0.release(prepared);
        let mut fetched = outputs.fetched.swap_remove("out").expect("it was asked for");
        fetched.truncate(to.bytes() as usize);
        fetched
    }
}

/// So many samples in rows of 127, the last one filled up; a row of one channel ends within a word.
fn form(samples: usize, channels: u8, sample: Sample, layout: Layout) -> PixelForm {
    let rows = samples.div_ceil(127 * usize::from(channels)) as u32;
    let alpha = if channels == 4 { Alpha::Associated } else { Alpha::None };
    PixelForm { sample, layout, alpha, ..PixelForm::linear([127, rows], channels) }
}

const FORMS: [(u8, Layout); 5] =
    [(1, Layout::Interleaved), (3, Layout::Interleaved), (4, Layout::Interleaved), (3, Layout::Planar), (4, Layout::Planar)];

fn floats(bytes: &[u8]) -> impl Iterator<Item = f32> {
    bytes.chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]]))
}

fn words16(bytes: &[u8]) -> impl Iterator<Item = u16> {
    bytes.chunks_exact(2).map(|b| u16::from_le_bytes([b[0], b[1]]))
}

/// `bytes` filled up with zeros to what the form holds.
fn filled(mut bytes: Vec<u8>, form: &PixelForm) -> Vec<u8> {
    bytes.resize(form.bytes() as usize, 0);
    bytes
}

#[test]
fn every_half_is_read_exactly() {
    let mut crossing = Crossing::open();
    for (channels, layout) in FORMS {
        let from = form(1 << 16, channels, Sample::F16, layout);
        let halves = filled((0..=u16::MAX).flat_map(u16::to_le_bytes).collect(), &from);
        let to = PixelForm { sample: Sample::F32, ..from };
        let got = crossing.cross(&halves, from, to);
        for (h, v) in words16(&halves).map(f16::from_bits).zip(floats(&got)) {
            let expected = h.to_f32();
            let same = expected.to_bits() == v.to_bits() || expected.is_nan() && v.is_nan();
            assert!(same, "{:#06x} is {v}, {:#010x}, in {channels} channels {layout:?}", h.to_bits(), v.to_bits());
        }
    }
}

#[test]
fn floats_become_the_nearest_halves() {
    let mut crossing = Crossing::open();
    // Every half, every middle between two, and the floats beside them.
    let tested = |h: u16| {
        let (a, b) = (f16::from_bits(h).to_f32(), f16::from_bits(h + 1).to_f32());
        let middle = if b.is_finite() { f32::midpoint(a, b) } else { 65520.0 };
        [a, middle].into_iter().flat_map(|v| [v.next_down(), v, v.next_up()])
    };
    let finite = (0..0x7c00).flat_map(tested);
    let special = [f32::INFINITY, f32::NAN, f32::MAX, f32::MIN_POSITIVE, 1e-30];
    let all: Vec<f32> = finite.chain(special).flat_map(|v| [v, -v]).collect();
    for (channels, layout) in FORMS {
        let from = form(all.len(), channels, Sample::F32, layout);
        let given = filled(all.iter().flat_map(|v| v.to_le_bytes()).collect(), &from);
        let got = crossing.cross(&given, from, PixelForm { sample: Sample::F16, ..from });
        for (v, h) in floats(&given).zip(words16(&got).map(f16::from_bits)) {
            let expected = f16::from_f32(v);
            let same = expected.to_bits() == h.to_bits() || expected.is_nan() && h.is_nan();
            assert!(same, "{v:e} is {:#06x} in {channels} channels {layout:?}", h.to_bits());
        }
    }
}

#[test]
fn float_files_keep_every_bit() {
    let mut crossing = Crossing::open();
    let patterns = (0..1_u32 << 16).map(|i| i.wrapping_mul(0x9e37_79b9)).filter(|b| !f32::from_bits(*b).is_nan());
    let bits: Vec<u8> = patterns.flat_map(u32::to_le_bytes).collect();
    for (channels, layout) in FORMS {
        let form = form(bits.len() / 4, channels, Sample::F32, layout);
        let given = filled(bits.clone(), &form);
        assert!(crossing.cross(&given, form, form) == given, "{channels} channels {layout:?}");
    }
}

/// Share of the samples that differ from `expected`, which none may by more than one.
fn share_off(got: impl Iterator<Item = u16>, expected: impl Iterator<Item = u16>) -> f64 {
    let (mut off, mut all) = (0, 0);
    for (g, e) in got.zip(expected) {
        assert!(g.abs_diff(e) <= 1, "{g} where {e} was expected");
        off += u32::from(g != e);
        all += 1;
    }
    f64::from(off) / f64::from(all)
}

fn encoded(v: f32, most: f64) -> u16 {
    let v = f64::from(v).clamp(0.0, 1.0);
    let encoded = if v <= 0.003_130_8 { 12.92 * v } else { 1.055 * v.powf(1.0 / 2.4) - 0.055 };
    (encoded * most + 0.5) as u16
}

#[test]
fn colours_become_srgb() {
    let mut crossing = Crossing::open();
    let ramp = (0..1_u32 << 20).map(|i| i as f32 / (1 << 20) as f32);
    let all: Vec<f32> = ramp.chain([1.0, 1.5, f32::INFINITY, -0.0, -0.5, f32::NEG_INFINITY, f32::NAN, 1e-30]).collect();
    for (channels, layout) in [(3, Layout::Interleaved), (3, Layout::Planar)] {
        let from = form(all.len(), channels, Sample::F32, layout);
        let given = filled(all.iter().flat_map(|v| v.to_le_bytes()).collect(), &from);
        let to = PixelForm { transfer: Transfer::Srgb, ..from };
        let bytes = crossing.cross(&given, from, PixelForm { sample: Sample::U8, ..to });
        let off = share_off(bytes.into_iter().map(u16::from), floats(&given).map(|v| encoded(v, 255.0)));
        assert!(off <= 2e-5, "{off} of the 8-bit samples");
        let words = crossing.cross(&given, from, PixelForm { sample: Sample::U16, ..to });
        let off = share_off(words16(&words), floats(&given).map(|v| encoded(v, 65535.0)));
        assert!(off <= 0.02, "{off} of the 16-bit samples");
    }
}

/// Whether a sample belongs to the fourth channel.
fn is_fourth(sample: usize, layout: Layout, form: &PixelForm) -> bool {
    let [w, h] = form.size.map(|n| n as usize);
    if layout == Layout::Planar { sample / (w * h) == 3 } else { sample % 4 == 3 }
}

#[test]
fn srgb_codes_become_colours() {
    let mut crossing = Crossing::open();
    for (sample, most, bytes) in [
        (Sample::U8, 255.0, (0..=u8::MAX).collect::<Vec<u8>>()),
        (Sample::U16, 65535.0, (0..=u16::MAX).flat_map(u16::to_le_bytes).collect()),
    ] {
        for (channels, layout) in FORMS {
            let samples = bytes.len() / sample.bytes() as usize;
            let to = form(samples, channels, Sample::F32, layout);
            let from = PixelForm { sample, transfer: Transfer::Srgb, ..to };
            let got = crossing.cross(&filled(bytes.clone(), &from), from, to);
            for (code, v) in floats(&got).take(samples).enumerate() {
                let a = code as f64 / most;
                let alpha = channels == 4 && is_fourth(code, layout, &from);
                let expected = match a {
                    _ if alpha => a,
                    _ if a <= 0.04045 => a / 12.92,
                    _ => ((a + 0.055) / 1.055).powf(2.4),
                };
                assert!((f64::from(v) - expected).abs() <= 2e-6 * expected + 1e-9, "{code} of {most} is {v}, not {expected}");
            }
        }
    }
}
