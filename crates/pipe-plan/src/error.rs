//! Why a graph cannot be planned for a device.

/// What stands in the way.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[allow(missing_docs)]
pub enum PlanError {
    /// An image is wider or higher than the device can hold.
    #[error("`{name}` is {}x{}, but the device holds images of at most {most} pixels a side\n  next: shrink it with Resize, or cut it with Crop", size[0], size[1])]
    ImageTooLarge { name: String, size: [u32; 2], most: u32 },
    /// A volume is larger than the device can hold.
    #[error("`{name}` is {}x{}x{}, but the device holds volumes of at most {most} voxels a side\n  next: shrink it with VolumeResample", size[0], size[1], size[2])]
    VolumeTooLarge { name: String, size: [u32; 3], most: u32 },
    /// A table is longer than a shader can bind.
    #[error("`{name}` takes {bytes} bytes, but a shader of this device binds at most {most}\n  next: use fewer entries")]
    TableTooLarge { name: String, bytes: u64, most: u64 },
    /// Something is larger than the device allocates at once.
    #[error(
        "`{name}` takes {}, but the device has no more than {} in one piece\n  next: shrink the image, or use options: (format: F16)",
        human(bytes),
        human(most)
    )]
    PieceTooLarge { name: String, bytes: u64, most: u64 },
    /// A pass needs more resources at once than the device can bind.
    #[error("`{name}` needs {has} {what} at once, the device has {most}\n  next: split it into several nodes")]
    TooManyBindings { name: String, what: &'static str, has: u32, most: u32 },
    /// A grid is larger than a dispatch may be.
    #[error("`{name}` needs {groups:?} workgroups, the device runs at most {most} along each axis")]
    TooManyGroups { name: String, groups: [u32; 3], most: u32 },
    /// A shader cannot be composed.
    #[error("cannot compose {label}:\n{message}")]
    Shader { label: String, message: String },
    /// The plan does not fit the budget.
    #[error(
        "the plan needs {} at once, the budget is {}; the largest part is `{name}` with {}\n  next: give it more with --vram, shrink the image, or use options: (format: F16)",
        human(needed),
        human(budget),
        human(bytes)
    )]
    Budget { needed: u64, budget: u64, name: String, bytes: u64 },
    /// It does not fit, and tiles do not help.
    #[error(
        "{}\n  tiles do not help: {why}\n  next: give it more with --vram, shrink the image, or use options: (format: F16)",
        whole.reason()
    )]
    NoTiles { whole: Box<Self>, why: String },
    /// A node refused to be lowered.
    #[error("`{name}` {message}")]
    Node { name: String, message: String },
}

impl PlanError {
    /// What is wrong, without what to do next.
    pub(crate) fn reason(&self) -> String {
        let text = self.to_string();
        text.split_once("\n  next: ").map_or(text.clone(), |(reason, _)| reason.to_owned())
    }

    /// Whether images made in parts may help.
    pub(crate) const fn is_about_size(&self) -> bool {
        matches!(
            self,
            Self::ImageTooLarge { .. }
                | Self::TableTooLarge { .. }
                | Self::PieceTooLarge { .. }
                | Self::TooManyGroups { .. }
                | Self::Budget { .. }
        )
    }
}

pub(crate) fn human(bytes: &u64) -> String {
    let (unit, name) = if *bytes < 1 << 20 { (10, "KiB") } else { (20, "MiB") };
    format!("{:.1} {name}", *bytes as f64 / f64::from(1 << unit))
}
