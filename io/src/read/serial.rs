use super::line::Line;
use crate::error::Error;

/// `high.low`, or one number.
pub(super) type Serial = (u64, Option<u64>);

pub(super) fn serial(line: Line<'_>, field: &[u8]) -> Result<Serial, Error> {
    let number = |digits: &[u8]| lexical_core::parse(digits).ok();
    let serial = match memchr::memchr(b'.', field) {
        None => number(field).map(|whole| (whole, None)),
        Some(at) => number(&field[..at]).zip(number(&field[at + 1..])).map(|(high, low)| (high, Some(low))),
    };
    serial.ok_or_else(|| line.unexpected("name(state) x y z serial, with a number as serial"))
}
