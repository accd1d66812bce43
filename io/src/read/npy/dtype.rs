#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Dtype {
    pub(super) class: DtypeKind,
    pub(super) big_endian: bool,
    pub(super) width: usize,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum DtypeKind {
    Float,
    Signed,
    Unsigned,
    Bytes,
    Text,
    Other,
}

impl Dtype {
    pub(super) const NATIVE_F32: Self =
        Self { class: DtypeKind::Float, big_endian: cfg!(target_endian = "big"), width: 4 };

    pub(super) fn parse(text: &[u8]) -> Option<Self> {
        const MAX_ITEM_BYTES: usize = 1 << 16;
        let (&order, rest) = text.split_first()?;
        let (&letter, digits) = rest.split_first()?;
        let big_endian = match order {
            b'<' | b'|' => false,
            b'>' => true,
            b'=' => cfg!(target_endian = "big"),
            _ => return None,
        };
        // The unit of a date follows its width.
        let (count, _): (usize, _) = lexical_core::parse_partial(digits).ok()?;
        let width = if letter == b'U' { count.checked_mul(4)? } else { count };
        let class = match (letter, width) {
            (b'f', 4 | 8) => DtypeKind::Float,
            (b'i', 1 | 2 | 4 | 8) => DtypeKind::Signed,
            (b'u', 1 | 2 | 4 | 8) => DtypeKind::Unsigned,
            (b'S', _) => DtypeKind::Bytes,
            (b'U', _) => DtypeKind::Text,
            // Objects are not stored in the array.
            (b'O', _) => return None,
            _ => DtypeKind::Other,
        };
        (width <= MAX_ITEM_BYTES).then_some(Self { class, big_endian, width })
    }

    pub(super) fn is_f64(self) -> bool {
        self.class == DtypeKind::Float && self.width == 8
    }

    /// Requires `Float`.
    #[inline]
    pub(super) fn float(self, bytes: &[u8]) -> f64 {
        match self.width {
            4 => f32::from_bits(self.bits(bytes) as u32).into(),
            _ => f64::from_bits(self.bits(bytes)),
        }
    }

    /// Requires `Signed` or `Unsigned`.
    pub(super) fn whole(self, bytes: &[u8]) -> i128 {
        let (bits, unused) = (self.bits(bytes), 64 - 8 * self.width as u32);
        match self.class {
            DtypeKind::Signed => ((bits << unused) as i64 >> unused).into(),
            _ => bits.into(),
        }
    }

    pub(super) fn text(self, bytes: &[u8]) -> String {
        match self.class {
            DtypeKind::Text => {
                let letters = bytes.chunks_exact(4).map(|letter| self.bits(letter) as u32);
                let letters = letters.map(|code| char::from_u32(code).unwrap_or(char::REPLACEMENT_CHARACTER));
                letters.collect::<String>().trim_end_matches('\0').to_owned()
            }
            _ => String::from_utf8_lossy(bytes).trim_end_matches('\0').to_owned(),
        }
    }

    #[inline]
    fn bits(self, bytes: &[u8]) -> u64 {
        match *bytes {
            [a, b, c, d] if self.big_endian => u32::from_be_bytes([a, b, c, d]).into(),
            [a, b, c, d] => u32::from_le_bytes([a, b, c, d]).into(),
            [a, b, c, d, e, f, g, h] if self.big_endian => u64::from_be_bytes([a, b, c, d, e, f, g, h]),
            [a, b, c, d, e, f, g, h] => u64::from_le_bytes([a, b, c, d, e, f, g, h]),
            _ if self.big_endian => bytes.iter().fold(0, |bits, &b| bits << 8 | u64::from(b)),
            _ => bytes.iter().rev().fold(0, |bits, &b| bits << 8 | u64::from(b)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_of_every_kind() {
        let kind = |text: &str| Dtype::parse(text.as_bytes()).unwrap();
        assert_eq!(kind(">f8").float(&1.25_f64.to_be_bytes()), 1.25);
        assert_eq!(kind("<f4").float(&1.25_f32.to_le_bytes()), 1.25);
        for (text, bytes, value) in [
            ("|i1", &[0xFF][..], -1),
            ("|u1", &[0xFF], 255),
            ("<i2", &[0xFE, 0xFF], -2),
            (">u2", &[1, 0], 256),
            ("<i4", &[0, 0, 0, 0x80], i32::MIN.into()),
            ("<u8", &[0xFF; 8], u64::MAX.into()),
            (">i8", &[0xFF; 8], -1),
        ] {
            assert_eq!(kind(text).whole(bytes), value, "{text}");
        }
        assert_eq!(kind("|S4").text(b"ab\0\0"), "ab");
        assert_eq!(kind(">U2").text(&[0, 0, 0, 0xE4, 0, 0, 0, 0]), "ä");
        assert_eq!(kind("<M8[ns]").width, 8);
        for text in ["", "<", "<f", "f4", "|O8", "<U99999999999"] {
            assert_eq!(Dtype::parse(text.as_bytes()), None, "{text}");
        }
    }
}
