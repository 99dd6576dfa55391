//! The one place where image types become texture formats.

use pipe_graph::types::{ImageType, Precision, VolumeType};
use wgpu::{TextureFormat, TextureFormatFeatureFlags, TextureUsages};

const fn format(channels: u8, precision: Precision) -> TextureFormat {
    match (channels, precision) {
        (1, Precision::F32) => TextureFormat::R32Float,
        (2, Precision::F32) => TextureFormat::Rg32Float,
        (_, Precision::F32) => TextureFormat::Rgba32Float,
        (1, Precision::F16) => TextureFormat::R16Float,
        (2, Precision::F16) => TextureFormat::Rg16Float,
        (_, Precision::F16) => TextureFormat::Rgba16Float,
    }
}

/// The format of an image.
pub(crate) const fn of_image(t: ImageType) -> TextureFormat {
    format(t.channels, t.precision)
}

/// The format of a volume.
pub(crate) const fn of_volume(t: VolumeType) -> TextureFormat {
    format(t.channels, t.precision)
}

/// What one texture format allows on an adapter.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize)]
#[allow(clippy::struct_excessive_bools, reason = "a row of a table of yes and no")]
pub struct FormatSupport {
    /// Its WGSL name.
    pub format: String,
    /// Can be read by shaders.
    pub sample: bool,
    /// Can be filtered by the texture unit.
    pub filter: bool,
    /// Can be written by shaders.
    pub storage: bool,
    /// Can be read and written in one pass.
    pub read_write: bool,
    /// Can be changed atomically.
    pub atomic: bool,
    /// Can be drawn into.
    pub render: bool,
    /// Can be blended into.
    pub blend: bool,
}

/// What each of the common formats allows.
pub(crate) fn support(adapter: &wgpu::Adapter) -> Vec<FormatSupport> {
    use TextureFormat as F;
    let all = [
        F::R8Unorm,
        F::Rg8Unorm,
        F::Rgba8Unorm,
        F::Rgba8UnormSrgb,
        F::Bgra8Unorm,
        F::R16Float,
        F::Rg16Float,
        F::Rgba16Float,
        F::R32Float,
        F::Rg32Float,
        F::Rgba32Float,
        F::R32Uint,
        F::R32Sint,
        F::Rg32Uint,
        F::Rgba32Uint,
        F::Rgba16Uint,
        F::Rgb10a2Unorm,
        F::Rg11b10Ufloat,
        F::Depth32Float,
    ];
    let one = |format: F| {
        let features = adapter.get_texture_format_features(format);
        let (usage, flags) = (features.allowed_usages, features.flags);
        FormatSupport {
            format: format!("{format:?}").to_lowercase(),
            sample: usage.contains(TextureUsages::TEXTURE_BINDING),
            filter: flags.contains(TextureFormatFeatureFlags::FILTERABLE),
            storage: usage.contains(TextureUsages::STORAGE_BINDING),
            read_write: flags.contains(TextureFormatFeatureFlags::STORAGE_READ_WRITE),
            atomic: flags.contains(TextureFormatFeatureFlags::STORAGE_ATOMIC),
            render: usage.contains(TextureUsages::RENDER_ATTACHMENT),
            blend: flags.contains(TextureFormatFeatureFlags::BLENDABLE),
        }
    };
    all.into_iter().map(one).collect()
}
