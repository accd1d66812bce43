//! `key=value` pairs in the comment line of extended XYZ.

struct Entry<'a> {
    key: &'a [u8],
    value: &'a [u8],
    /// `true` if the value begins with a quote or bracket that is not closed.
    is_open: bool,
}

impl Entry<'_> {
    fn has_key(&self, key: &str) -> bool {
        self.key.eq_ignore_ascii_case(key.as_bytes())
    }
}

/// Ignores case, and removes quotes or brackets.
pub(super) fn value_of<'a>(comment: &'a [u8], key: &str) -> Option<&'a [u8]> {
    entries(comment).find(|entry| entry.has_key(key)).map(|entry| entry.value)
}

/// Returns the key whose quote or bracket is not closed.
pub(super) fn unclosed<'k>(comment: &[u8], keys: &[&'k str]) -> Option<&'k str> {
    let mut open = entries(comment).filter(|entry| entry.is_open);
    open.find_map(|entry| keys.iter().copied().find(|key| entry.has_key(key)))
}

fn entries(comment: &[u8]) -> impl Iterator<Item = Entry<'_>> {
    let mut rest = comment;
    std::iter::from_fn(move || {
        loop {
            rest = rest.trim_ascii_start();
            if rest.is_empty() {
                return None;
            }
            let (key, tail) = token(rest, |b| b == b'=' || b.is_ascii_whitespace());
            let Some(value) = tail.trim_ascii_start().strip_prefix(b"=") else {
                // Skips a word without a value, or a stray `=`.
                rest = if tail.len() < rest.len() { tail } else { &rest[1..] };
                continue;
            };
            let value = value.trim_ascii_start();
            let is_open = closing(value) == Some(None);
            let (value, tail) = token(value, |b| b.is_ascii_whitespace());
            rest = tail;
            return Some(Entry { key, value, is_open });
        }
    })
}

pub(super) fn elements(value: &[u8]) -> impl Iterator<Item = &[u8]> {
    let between = |b: &u8| b.is_ascii_whitespace() || b",[]{}".contains(b);
    value.split(between).filter(|element| !element.is_empty())
}

fn token(text: &[u8], end: impl Fn(u8) -> bool) -> (&[u8], &[u8]) {
    match closing(text) {
        None => {
            let length = text.iter().position(|&b| end(b)).unwrap_or(text.len());
            text.split_at(length)
        }
        Some(Some(at)) => (&text[1..][..at], &text[1..][at + 1..]),
        Some(None) => (&text[1..], &[]),
    }
}

/// Returns the position of the closing quote or bracket, counted after the first byte; `None` without an opening one.
fn closing(text: &[u8]) -> Option<Option<usize>> {
    match *text.first()? {
        quote @ (b'"' | b'\'') => Some(closing_quote(&text[1..], quote)),
        b'[' => Some(closing_bracket(text, [b'[', b']'])),
        b'{' => Some(closing_bracket(text, [b'{', b'}'])),
        _ => None,
    }
}

/// Searches after the opening quote; backslashes escape.
fn closing_quote(inside: &[u8], quote: u8) -> Option<usize> {
    let mut at = 0;
    while at < inside.len() {
        match inside[at] {
            b'\\' => at += 2,
            b if b == quote => return Some(at),
            _ => at += 1,
        }
    }
    None
}

fn closing_bracket(text: &[u8], [open, close]: [u8; 2]) -> Option<usize> {
    let mut depth = 0_usize;
    for (at, &b) in text.iter().enumerate() {
        depth += usize::from(b == open);
        depth -= usize::from(b == close);
        if depth == 0 {
            return Some(at - 1);
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_found_by_their_key() {
        let comment = br#" flag Lattice = "1 0 0" note="pbc=\"T T T\" or so" pbc=[F, T, F] Properties=pos:R:3 e={1 2}=x"#;
        let text = |key| value_of(comment, key).map(|value| std::str::from_utf8(value).unwrap());
        assert_eq!(text("Lattice"), Some("1 0 0"));
        assert_eq!(text("lattice"), Some("1 0 0"));
        assert_eq!(text("pbc"), Some("F, T, F"));
        assert_eq!(text("properties"), Some("pos:R:3"));
        assert_eq!(text("e"), Some("1 2"));
        assert_eq!(text("flag"), None);
        assert_eq!(value_of(b"pbc=\"T T", "pbc"), Some(&b"T T"[..]));
        assert_eq!(value_of(b"= == pbc =", "pbc"), Some(&b""[..]));
        assert_eq!(value_of(b"a=[[1, 2], [3]] pbc='T T F'", "pbc"), Some(&b"T T F"[..]));
        let keys = ["Lattice", "pbc"];
        assert_eq!(unclosed(b"title='it pbc=\"T T", &keys), None);
        assert_eq!(unclosed(b"title=it's lattice=\"1 0 0 pbc=T", &keys), Some("Lattice"));
        assert_eq!(unclosed(comment, &keys), None);
        assert_eq!(elements(b"[1, 0], [2 3]").collect::<Vec<_>>(), [b"1", b"0", b"2", b"3"]);
    }
}
