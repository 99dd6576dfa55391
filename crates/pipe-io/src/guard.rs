//! The last line against a decoder that panics on damaged input.
//!
//! Every header is checked before its decoder runs, and none of the damaged files we know gets past those checks into
//! a panic. But the decoders are other people's code over hostile bytes, and one `unwrap` in there must not take a
//! render farm's job down. So each decode runs inside [`shielded`]: a panic becomes an ordinary "damaged" fault, and
//! the panic hook (which would print a backtrace to the user) stays silent for that thread only.

use std::cell::Cell;
use std::panic::{self, AssertUnwindSafe};
use std::sync::Once;

use crate::error::Fault;

thread_local! {
    static SHIELDED: Cell<bool> = const { Cell::new(false) };
}

static HOOK: Once = Once::new();

/// Runs `decode`; a panic inside it is reported as damage instead of unwinding further or printing.
pub(crate) fn shielded<T>(decode: impl FnOnce() -> Result<T, Fault>) -> Result<T, Fault> {
    HOOK.call_once(|| {
        let before = panic::take_hook();
        panic::set_hook(Box::new(move |info| {
            if !SHIELDED.get() {
                before(info);
            }
        }));
    });
    let outer = SHIELDED.replace(true);
    // Whatever `decode` had half built is dropped with the panic, so no broken state can be seen afterwards.
    let outcome = panic::catch_unwind(AssertUnwindSafe(decode));
    SHIELDED.set(outer);
    outcome.unwrap_or_else(|payload| {
        let message = payload
            .downcast_ref::<&str>()
            .map(|text| (*text).to_owned())
            .or_else(|| payload.downcast_ref::<String>().cloned())
            .unwrap_or_default();
        Err(Fault::Damaged(format!("the decoder gave up on it ({message})")))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_becomes_damage() {
        let fault = shielded::<()>(|| panic!("index out of bounds")).unwrap_err();
        assert!(matches!(fault, Fault::Damaged(reason) if reason.contains("index out of bounds")));
    }
}
