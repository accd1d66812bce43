/// Prefers the first of equally similar names.
pub(super) fn nearest<'a>(name: &str, names: impl Iterator<Item = &'a str>) -> Option<&'a str> {
    names.min_by_key(|known| edits(name, known))
}

/// Limit of compared characters; the time is quadratic in their number.
const MAX_COMPARED: usize = 60;

fn edits(from: &str, to: &str) -> usize {
    let to: Vec<char> = to.chars().take(MAX_COMPARED).collect();
    let mut row: Vec<usize> = (0..=to.len()).collect();
    for (i, a) in from.chars().take(MAX_COMPARED).enumerate() {
        let mut diagonal = std::mem::replace(&mut row[0], i + 1);
        for (j, b) in to.iter().enumerate() {
            let replaced = diagonal + usize::from(a != *b);
            diagonal = row[j + 1];
            row[j + 1] = replaced.min(row[j] + 1).min(diagonal + 1);
        }
    }
    row[to.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn edit_distances_match_known_values() {
        let known = [
            ("kitten", "sitting", 3),
            ("", "abc", 3),
            ("radios", "radius", 1),
            ("a", "a", 0),
            ("ab", "ba", 2),
        ];
        for (from, to, distance) in known {
            assert_eq!((edits(from, to), edits(to, from)), (distance, distance), "{from} {to}");
        }
        let long = "a".repeat(1 << 20);
        assert_eq!(edits(&long, &long.replace('a', "b")), MAX_COMPARED);
        assert_eq!(nearest("radios", ["rate", "radius", "ratio"].into_iter()), Some("radius"));
        assert_eq!(nearest("x", std::iter::empty()), None);
    }
}
