//! `devices`: adapters, limits, features, formats.

use std::fmt::Write as _;

use pipe::Failure;
use pipe_gpu::GpuError;

use super::args::DevicesArgs;
use super::{print, print_json};

/// Lists adapters, the preferred one first.
pub(super) fn devices(a: &DevicesArgs) -> Result<(), Failure> {
    let all = pipe_gpu::enumerate();
    if a.json {
        return print_json(&serde_json::json!(all));
    }
    if all.is_empty() {
        return Err(GpuError::NoAdapter.into());
    }
    let mut out = String::new();
    for d in &all {
        let l = &d.limits;
        let _ = writeln!(out, "{}: {}  ({}, {}, {})", d.index, d.name, d.kind, d.backend, d.driver);
        let _ = writeln!(
            out,
            "   images up to {}, volumes up to {}, buffers up to {} MiB, {} images read and {} written by a kernel",
            l.max_image,
            l.max_volume,
            l.max_binding_bytes >> 20,
            l.max_sampled_images,
            l.max_storage_images
        );
        let _ = writeln!(out, "   features: {}", d.features.join(" "));
        if a.formats {
            let _ = writeln!(out, "   {:<16} sample filter storage read-write atomic render blend", "format");
            for f in &d.formats {
                let yes = |b: bool| if b { "yes" } else { "-" };
                let _ = writeln!(
                    out,
                    "   {:<16} {:<6} {:<6} {:<7} {:<10} {:<6} {:<6} {}",
                    f.format,
                    yes(f.sample),
                    yes(f.filter),
                    yes(f.storage),
                    yes(f.read_write),
                    yes(f.atomic),
                    yes(f.render),
                    yes(f.blend)
                );
            }
        }
    }
    print(&out)
}
