//! `doctor`: does the adapter do what pipe relies on?

use std::fmt::Write as _;

use pipe::Failure;
use pipe_gpu::{Device, probe};

use super::args::DoctorArgs;
use super::{device_choice, print, print_json};

/// Tests the adapter.
pub(super) fn doctor(a: &DoctorArgs) -> Result<(), Failure> {
    let device = Device::open(&device_choice(a.device.as_deref()))?;
    let findings = probe::examine(&device)?;
    if a.json {
        print_json(&serde_json::json!({"device": device.name(), "findings": findings}))?;
    } else {
        let mut out = format!("{}\n", device.name());
        for f in &findings {
            let _ = writeln!(out, "  {}  {:<24} {}", if f.good { "ok " } else { "BAD" }, f.name, f.value);
            if !f.good {
                let _ = writeln!(out, "       {}", f.hint);
            }
        }
        print(&out)?;
    }
    if findings.iter().all(|f| f.good || !f.vital) {
        Ok(())
    } else {
        Err(Failure::World("the device fails a test that pipe relies on\n  next: update its driver, or use --device cpu".into()))
    }
}
