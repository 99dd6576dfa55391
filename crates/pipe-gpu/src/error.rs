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
    #[error("out of device memory while making {what} of {bytes} bytes\n  next: close other programs, shrink the image, or set a budget with --vram")]
    OutOfMemory {
        /// What did not fit.
        what: String,
        /// Its size.
        bytes: u64,
    },
    /// The work took longer than `--timeout`.
    #[error("`{node}` did not finish within {seconds} s\n  next: give it more with --timeout SECONDS, or look for an endless loop in its shader")]
    Timeout {
        /// The pass that was running, or the first of the batch.
        node: String,
        /// The bound.
        seconds: u64,
    },
    /// The device went away.
    #[error("the device was lost while running `{node}`: {reason}\n  next: run `pipe doctor`; if it happens again, lower the work per pass or try --device cpu")]
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
    /// The user interrupted the run.
    #[error("interrupted")]
    Interrupted,
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
