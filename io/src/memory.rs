//! Fallible allocation.

use std::collections::TryReserveError;
use std::io;
use std::path::Path;

use crate::Error;

pub(crate) fn try_push<T>(all: &mut Vec<T>, value: T) -> Result<(), TryReserveError> {
    if all.len() == all.capacity() {
        all.try_reserve(1)?;
    }
    all.push(value);
    Ok(())
}

pub(crate) fn try_collect<T>(values: impl ExactSizeIterator<Item = T>) -> Result<Vec<T>, TryReserveError> {
    let mut all = Vec::new();
    all.try_reserve_exact(values.len())?;
    all.extend(values);
    Ok(all)
}

/// Refuses if less than a MiB is left for small allocations that cannot report a failure.
pub(crate) fn check_margin() -> Result<(), TryReserveError> {
    const MARGIN_BYTES: usize = 1 << 20;
    let mut margin = Vec::<u8>::new();
    // Keeps the compiler from removing the unused allocation.
    std::hint::black_box(&mut margin).try_reserve_exact(MARGIN_BYTES)?;
    drop(std::hint::black_box(margin));
    Ok(())
}

/// Replaces invalid UTF-8 by U+FFFD.
pub(crate) fn try_text(bytes: &[u8]) -> Result<String, TryReserveError> {
    const REPLACEMENT_BYTES: usize = char::REPLACEMENT_CHARACTER.len_utf8();
    let is_text = std::str::from_utf8(bytes).is_ok();
    let mut text = String::new();
    text.try_reserve_exact(if is_text { bytes.len() } else { REPLACEMENT_BYTES * bytes.len() })?;
    for chunk in bytes.utf8_chunks() {
        text.push_str(chunk.valid());
        text.extend((!chunk.invalid().is_empty()).then_some(char::REPLACEMENT_CHARACTER));
    }
    Ok(text)
}

pub(crate) fn refused(path: &Path, what: &str) -> Error {
    let source = io::Error::new(io::ErrorKind::OutOfMemory, format!("no memory for {what}"));
    Error::Read { path: path.to_owned(), source }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_equals_that_of_the_standard_library() {
        for bytes in [&b"acid"[..], b"", "é(σ)".as_bytes(), b"\xFFa\xC3", b"\xE2\x82a\xF0\x9F\x92b"] {
            assert_eq!(try_text(bytes), Ok(String::from_utf8_lossy(bytes).into_owned()));
        }
    }
}
