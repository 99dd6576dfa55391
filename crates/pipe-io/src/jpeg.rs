//! Whether a JPEG file is whole.
//!
//! Its decoder makes a picture of whatever there is and fills the rest with grey, so a download that broke off would pass for
//! one that did not. What tells is the marker at the end, which no part of the file may contain: segments say how long they
//! are, and coded data have a zero after each `FF` of their own.

use crate::error::Fault;

/// Finds the end marker. What follows it (another picture, a phone's film) is not ours.
pub(crate) fn check_end(bytes: &[u8]) -> Result<(), Fault> {
    let mut at = 0;
    while let Some((marker, after)) = marker(bytes, at) {
        at = match marker {
            0xd9 => return Ok(()),
            // The start, restarts and TEM stand alone.
            0x01 | 0xd0..=0xd8 => after,
            _ => match bytes.get(after..after + 2) {
                Some(length) => after + usize::from(u16::from_be_bytes([length[0], length[1]])),
                None => break,
            },
        };
    }
    Err(Fault::damaged("it ends before its end marker"))
}

/// The first marker from a place on, coded data skipped, and the place behind it. A marker may have several `FF`.
fn marker(bytes: &[u8], at: usize) -> Option<(u8, usize)> {
    let begins = |pair: &[u8]| pair[0] == 0xff && !matches!(pair[1], 0x00 | 0xff);
    let found = at + bytes.get(at..)?.windows(2).position(begins)?;
    Some((bytes[found + 1], found + 2))
}
