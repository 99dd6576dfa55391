//! Messages and progress on stderr.

use std::io::{IsTerminal, Write};
use std::sync::atomic::{AtomicI8, Ordering};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

static VERBOSITY: AtomicI8 = AtomicI8::new(0);

/// −1 quiet, 0 normal, 1 verbose.
pub(super) fn set_verbosity(quiet: bool, verbose: u8) {
    VERBOSITY.store(if quiet { -1 } else { verbose.min(3) as i8 }, Ordering::Relaxed);
}

/// Whether there is more to say than usual.
pub(super) fn verbose() -> bool {
    VERBOSITY.load(Ordering::Relaxed) > 0
}

/// A line for people, unless they asked for quiet.
pub(super) fn say(text: &str) {
    if VERBOSITY.load(Ordering::Relaxed) >= 0 && !text.is_empty() {
        let _ = writeln!(std::io::stderr(), "{}", text.trim_end());
    }
}

/// A bar that shows itself when the work takes longer than a second and stderr is a terminal.
pub(super) fn progress(of: u64, what: &str) -> ProgressBar {
    let shown = VERBOSITY.load(Ordering::Relaxed) >= 0 && std::io::stderr().is_terminal();
    let target = if shown { ProgressDrawTarget::stderr_with_hz(1) } else { ProgressDrawTarget::hidden() };
    let bar = ProgressBar::with_draw_target(Some(of), target);
    if let Ok(style) = ProgressStyle::with_template("{msg} {wide_bar} {pos}/{len} {eta}") {
        bar.set_style(style);
    }
    bar.set_message(what.to_owned());
    bar
}
