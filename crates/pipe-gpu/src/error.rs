//! What can go wrong on a device, in full sentences.

/// Why a device could not do what was asked.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum GpuError {
    /// No adapter at all.
    #[error("no GPU and no software renderer was found\n  next: {hint}", hint = install_hint())]
    NoAdapter,
    /// None that fits `--device`.
    #[error("no device fits `{wanted}`; there are: {available}\n  next: `pipe devices` lists them")]
    NoSuchDevice {
        /// What was asked for.
        wanted: String,
        /// Names of what there is.
        available: String,
    },
    /// The driver refused to open the device.
    #[error("cannot open {name}: {reason}")]
    Open {
        /// The adapter.
        name: String,
        /// The driver's words.
        reason: String,
    },
    /// A shader was refused.
    #[error("the shader of `{node}` ({label}) does not compile:\n{message}")]
    Shader {
        /// The pass.
        node: String,
        /// Shader files.
        label: String,
        /// The compiler's words.
        message: String,
    },
    /// Memory ran out.
    #[error("out of device memory at `{what}`{}\n  next: close other programs, shrink the image, or set a budget with --vram", of_size(*bytes))]
    OutOfMemory {
        /// What did not fit.
        what: String,
        /// Its size in bytes, 0 when unknown.
        bytes: u64,
    },
    /// Something is larger than the device can hold in one piece.
    #[error(
        "`{what}` needs {size}, this device allows {limit}\n  next: shrink the image, or choose another device (`pipe devices` lists their limits)"
    )]
    TooLarge {
        /// The graph and the slot.
        what: String,
        /// What it needs.
        size: String,
        /// What there is.
        limit: String,
    },
    /// The plan does not fit the budget.
    #[error("`{what}` needs {} of device memory, the budget is {}; the largest parts are {largest}\n  next: give it more with --vram, shrink the image, or use options: (format: F16)", size(*needed), size(*budget))]
    OverBudget {
        /// The graph.
        what: String,
        /// Bytes of all slots, kept frames and staging buffers.
        needed: u64,
        /// Bytes that are allowed.
        budget: u64,
        /// The largest slots, in words.
        largest: String,
    },
    /// The work took longer than `--timeout`.
    #[error(
        "`{node}` did not finish within {limit:?}\n  next: give it more with --timeout SECONDS, or look for an endless loop in its shader"
    )]
    Timeout {
        /// The passes that were running: those of one submission.
        node: String,
        /// The bound.
        limit: std::time::Duration,
    },
    /// A loop in a user's shader did not end.
    #[error(
        "the loops in the shader of `{node}` did not come to an end within the rounds that a thread has (32,000 on a software renderer, 4,194,304 on a GPU)\n  next: look for an endless loop, or do less in one pass"
    )]
    Endless {
        /// The passes that it may be.
        node: String,
    },
    /// The device went away.
    #[error(
        "the device was lost while running `{node}`: {reason}\n  next: run `pipe doctor`; if it happens again, lower the work per pass or try --device cpu"
    )]
    Lost {
        /// The pass.
        node: String,
        /// The driver's words.
        reason: String,
    },
    /// wgpu found a mistake of ours.
    #[error("the device refused `{node}`: {message}")]
    Refused {
        /// The pass.
        node: String,
        /// wgpu's words.
        message: String,
    },
    /// The device lacks something that a plan needs.
    #[error("`{node}` needs {what}, which this device does not have")]
    Unsupported {
        /// The pass.
        node: String,
        /// The feature.
        what: &'static str,
    },
    /// The caller gave too few bytes for an input.
    #[error("input `{name}` has {got} bytes, the plan reads up to byte {wanted}")]
    ShortInput {
        /// The external.
        name: String,
        /// Its length.
        got: u64,
        /// What the plan reads.
        wanted: u64,
    },
    /// The plan does not fit itself, which its maker must not let happen.
    #[error("the plan of `{node}` is inconsistent: {reason}\n  next: this is a mistake in pipe; please report it with the graph")]
    Plan {
        /// The pass or the graph.
        node: String,
        /// What does not fit.
        reason: String,
    },
    /// The caller could not bring or take the pixels of a tile.
    #[error("{0}")]
    Exchange(String),
    /// The user interrupted the run.
    #[error("interrupted")]
    Interrupted,
}

fn of_size(bytes: u64) -> String {
    if bytes == 0 { String::new() } else { format!(", {} in one piece", size(bytes)) }
}

/// Bytes in the largest unit that leaves at least one of it.
pub(crate) fn size(bytes: u64) -> String {
    let units = ["KiB", "MiB", "GiB", "TiB"];
    let mut value = bytes as f64;
    let mut unit = "bytes";
    for larger in units {
        if value < 1024.0 {
            break;
        }
        value /= 1024.0;
        unit = larger;
    }
    if unit == "bytes" { format!("{bytes} bytes") } else { format!("{value:.1} {unit}") }
}

/// What to install where there is no adapter.
fn install_hint() -> &'static str {
    if cfg!(target_os = "linux") {
        "install a Vulkan driver: the vendor's for a GPU; without one, the software renderer:\n\
         \x20   Debian, Ubuntu   sudo apt-get install mesa-vulkan-drivers\n\
         \x20   Fedora           sudo dnf install mesa-vulkan-drivers\n\
         \x20   Arch             sudo pacman -S vulkan-swrast\n\
         \x20   Alpine           sudo apk add mesa-vulkan-swrast"
    } else if cfg!(target_os = "windows") {
        "install the driver of your GPU's vendor; Windows' own software renderer (WARP) needs DirectX 12"
    } else {
        "Metal is part of macOS 10.13 and later on every Mac with a supported GPU"
    }
}
