use std::io::{self, Write};

/// Writes bytes as base64 (RFC 4648).
///
/// # Errors
/// Fails if the writer fails.
pub fn base64(out: &mut (impl Write + ?Sized), bytes: &[u8]) -> io::Result<()> {
    const LETTERS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut text = Vec::with_capacity(bytes.len().div_ceil(3) * 4);
    for three in bytes.chunks(3) {
        let word = (0..3).fold(0_u32, |word, k| word << 8 | u32::from(three.get(k).copied().unwrap_or(0)));
        let letter = |k: usize| LETTERS[(word >> (18 - 6 * k) & 63) as usize];
        text.extend((0..4).map(|k| if k <= three.len() { letter(k) } else { b'=' }));
    }
    out.write_all(&text)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn base64_of_the_standards_test_vectors() {
        let known = [
            ("", ""),
            ("f", "Zg=="),
            ("fo", "Zm8="),
            ("foo", "Zm9v"),
            ("foob", "Zm9vYg=="),
            ("fooba", "Zm9vYmE="),
            ("foobar", "Zm9vYmFy"),
        ];
        for (bytes, letters) in known {
            let mut out = Vec::new();
            base64(&mut out, bytes.as_bytes()).expect("written");
            assert_eq!(String::from_utf8(out).as_deref(), Ok(letters));
        }
    }
}
