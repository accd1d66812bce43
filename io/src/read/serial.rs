use super::line::Line;
use crate::error::Error;

/// `high.low`, or one number.
pub(super) type Serial = (u64, Option<u64>);

pub(super) fn serial(line: Line<'_>, field: &[u8]) -> Result<Serial, Error> {
    let part = |digits: &[u8]| lexical_core::parse(digits).ok();
    let serial = match memchr::memchr(b'.', field) {
        None => part(field).map(|whole| (whole, None)),
        Some(at) => part(&field[..at]).zip(part(&field[at + 1..])).map(|(high, low)| (high, Some(low))),
    };
    serial.ok_or_else(|| line.unexpected("name(state) x y z serial, with a number as serial"))
}
