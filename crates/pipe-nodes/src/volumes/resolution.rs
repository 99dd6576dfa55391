//! How many voxels a volume has that comes from no file.

use pipe_graph::prelude::*;
use smart_default::SmartDefault;

/// Voxels along the edges of the unit cube.
#[derive(Debug, Clone, Copy, PartialEq, SmartDefault, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub(crate) enum Resolution {
    /// All three alike.
    #[default]
    Cube(#[default = 64] u32),
    /// x, y and z.
    Box([u32; 3]),
}

impl Resolution {
    /// Voxels along x, y and z.
    pub(crate) const fn size(self) -> [u32; 3] {
        match self {
            Self::Cube(n) => [n, n, n],
            Self::Box(size) => size,
        }
    }

    /// A volume of this resolution.
    pub(crate) fn volume(self, channels: u8) -> Result<EdgeType, Mistake> {
        if self.size().contains(&0) {
            return Err(Mistake::in_field("resolution", "has no voxels").hint("expected a number of voxels, or [x, y, z], each at least 1"));
        }
        Ok(EdgeType::volume(self.size(), channels))
    }
}

/// The centre of a voxel in the unit cube.
pub(crate) fn centre(size: [u32; 3], voxel: [i64; 3]) -> glam::DVec3 {
    std::array::from_fn(|i| (voxel[i] as f64 + 0.5) / f64::from(size[i])).into()
}
