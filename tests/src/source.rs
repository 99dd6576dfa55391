//! Test inputs: small, deterministic, and awkward on purpose (zeros, negatives, values above 1).

use pipe_graph::prelude::*;
use pipe_graph::reference::{Block, Raster, Tensor};

/// A number in 0..1 from two integers (SplitMix64).
pub fn hash(seed: u64, i: u64) -> f64 {
    let mut z =
        seed.wrapping_mul(0x9E37_79B9_7F4A_7C15).wrapping_add(i.wrapping_mul(0xBF58_476D_1CE4_E5B9)).wrapping_add(0x94D0_49BB_1331_11EB);
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
}

/// A smooth HDR picture with some noise, zeros and negatives; alpha in 0..1.
pub fn picture(size: [u32; 2], channels: u8, seed: u64) -> Raster {
    let [w, h] = size;
    let mut i = 0;
    Raster::from_fn(size, channels, |x, y| {
        i += 1;
        let (u, v) = (x as f64 / f64::from(w), y as f64 / f64::from(h));
        let n = |k: u64| hash(seed + k, i);
        let smooth = 0.5 + 0.5 * (6.0 * u + 3.0 * v + seed as f64).sin() * (5.0 * v).cos();
        let mut c = [smooth + 0.2 * n(1), 1.5 * smooth * n(2), 0.3 + 0.4 * n(3) - 0.3 * smooth, 0.25 + 0.75 * n(4)];
        if n(5) > 0.98 {
            c[0] += 8.0 * n(6);
        }
        if n(7) > 0.99 {
            c = [0.0, 0.0, 0.0, c[3]];
        }
        // What a 32-bit file can hold.
        c.map(|v| f64::from(v as f32))
    })
}

/// A soft ball.
pub fn volume(size: [u32; 3]) -> Block {
    Block::from_fn(size, 1, |x, y, z| {
        let at = [x, y, z].into_iter().zip(size).map(|(i, n)| (i as f64 + 0.5) / f64::from(n) - 0.5);
        let r = at.map(|d| d * d).sum::<f64>().sqrt();
        let v = f64::from((1.2 - 2.4 * r).clamp(0.0, 1.0) as f32);
        [v, v, v, 1.0]
    })
}

/// The value of an edge that examples may name.
pub fn edge(name: &str, size: [u32; 2]) -> Tensor {
    match name {
        "in" => Tensor::Image(picture(size, 4, 1)),
        "other" => Tensor::Image(picture(size, 4, 2)),
        "grey" => Tensor::Image(picture(size, 1, 3)),
        "pair" => Tensor::Image(picture(size, 2, 4)),
        "table" => Tensor::Table((0..256).map(|i| (hash(5, i) * 1000.0).floor()).collect()),
        "curve" => Tensor::Table((0..64).map(|i| f64::from((hash(6, i) * 2.0 - 0.5) as f32)).collect()),
        "volume" => Tensor::Volume(volume([21, 18, 15])),
        "fog" => Tensor::Volume(Block::from_fn([16, 16, 16], 1, |x, y, z| {
            let v = f64::from((0.5 + 0.5 * hash(7, (x + 16 * y + 256 * z) as u64)) as f32);
            [v, v, v, 1.0]
        })),
        "scalar" => Tensor::Scalar(SCALAR.map(f64::from).to_vec()),
        other => panic!("no test input is called {other}"),
    }
}

/// The types of the inputs above.
pub fn edge_type(name: &str, size: [u32; 2]) -> EdgeType {
    match name {
        "grey" => EdgeType::image(size, 1),
        "pair" => EdgeType::image(size, 2),
        "table" => EdgeType::table(256, Element::U32),
        "curve" => EdgeType::table(64, Element::F32),
        "volume" => EdgeType::volume([21, 18, 15], 1),
        "fog" => EdgeType::volume([16, 16, 16], 1),
        _ => EdgeType::image(size, 4),
    }
}

/// The content of the `scalar` edge.
pub const SCALAR: [f32; 4] = [0.75, 0.5, 0.25, 1.0];

/// Emits [`SCALAR`], since a graph input cannot be a scalar.
#[derive(Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct ScalarSource {}

/// The kind of [`ScalarSource`].
pub const KIND: Kind = Kind::of::<ScalarSource>("ScalarSource", Category::Sources, &["ScalarSource()"]);

impl Node for ScalarSource {
    fn outputs(&self, _: &mut Inputs<'_>) -> Result<Vec<Output>, Mistake> {
        Ok(Output::out(EdgeType::scalar(4)))
    }

    fn lower(&self, cx: &mut Lowering<'_>) -> Result<(), Mistake> {
        let id = cx.scalar("value", SCALAR);
        cx.emit("out", id);
        Ok(())
    }

    fn reference(&self, _: &Reference<'_>) -> Vec<Tensor> {
        vec![Tensor::Scalar(SCALAR.map(f64::from).to_vec())]
    }
}

/// Bytes of a tensor as the executor takes them: floats, or u32 for tables of that type.
pub fn bytes(tensor: &Tensor, ty: &EdgeType) -> Vec<u8> {
    let floats = |pixels: &[[f64; 4]], channels: u8| -> Vec<u8> {
        pixels.iter().flat_map(|p| p[..channels as usize].to_vec()).flat_map(|v| (v as f32).to_le_bytes()).collect()
    };
    match (tensor, ty) {
        (Tensor::Image(r), _) => floats(&r.pixels, r.channels),
        (Tensor::Volume(b), _) => floats(&b.voxels, b.channels),
        (Tensor::Table(t), EdgeType::Table(TableType { element: Element::U32, .. })) => {
            t.iter().flat_map(|v| (*v as u32).to_le_bytes()).collect()
        }
        (Tensor::Table(t), _) => t.iter().flat_map(|v| (*v as f32).to_le_bytes()).collect(),
        _ => Vec::new(),
    }
}
