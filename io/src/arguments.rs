//! Arguments that several commands share.

use std::path::Path;
use std::str::FromStr;

use lazygrid::Space;

use crate::error::excerpt;
use crate::read::Radii;

/// Parses `SPECIES=R`, a species' radius.
///
/// # Errors
/// Fails with a message for the user without `=`, or unless the radius is finite and not negative.
pub fn species_radius(text: &str) -> Result<(String, f64), String> {
    let (species, radius) = text.rsplit_once('=').ok_or("expected SPECIES=R, such as acid=0.1")?;
    match f64::from_str(radius) {
        Ok(radius) if radius.is_finite() && radius >= 0.0 => Ok((species.to_owned(), radius)),
        _ => Err(format!(
            "the radius '{}' must be a finite number that is not negative",
            excerpt(radius.as_bytes())
        )),
    }
}

/// Collects the radii of `--radius` by species.
///
/// # Errors
/// Fails with a message for the user if a species is given twice.
pub fn radii_by_species(options: &[(String, f64)]) -> Result<Radii, String> {
    let mut radii = Radii::new();
    for (species, radius) in options {
        if let Some(first) = radii.insert(species.clone(), *radius) {
            let species = excerpt(species.as_bytes());
            return Err(format!("--radius {species} is given twice, as {first} and {radius}; give one"));
        }
    }
    Ok(radii)
}

/// Returns the warning of a radius whose species is not in a file.
pub fn unused_radius(path: &Path, species: &str) -> String {
    let species = excerpt(species.as_bytes());
    format!("{}: no sphere is of species '{species}', for which a radius was given", path.display())
}

/// Parses the lengths of a periodic box as `X,Y,Z`, `-` for an unbounded axis; or `none`.
///
/// # Errors
/// Fails with a message for the user.
pub fn periodic_space(text: &str) -> Result<Space, String> {
    if text == "none" {
        return Ok(Space::UNBOUNDED);
    }
    let length = |text: &str| match text.trim() {
        "-" => Ok(None),
        number => match f64::from_str(number) {
            Ok(length) if length.is_finite() && length > 0.0 => Ok(Some(length)),
            Ok(_) => Err(format!(
                "the length {} is not a finite number above zero; write - for an axis that is unbounded",
                excerpt(number.as_bytes())
            )),
            Err(_) => Err(format!("'{}' is neither a length nor -", excerpt(number.as_bytes()))),
        },
    };
    let lengths: Vec<_> = text.split(',').map(length).collect::<Result<_, _>>()?;
    let lengths = lengths.try_into().map_err(|_| "expected three lengths, such as 10,10,-, or none")?;
    Space::periodic(lengths).map_err(|error| error.to_string())
}

/// Parses as [`periodic_space`], for `f32`.
///
/// # Errors
/// Fails with a message for the user, also for a length that is zero or infinite as an `f32`.
pub fn periodic_space_f32(text: &str) -> Result<Space, String> {
    let space = periodic_space(text)?;
    let is_outside = |length: &f64| matches!(*length as f32, 0.0 | f32::INFINITY);
    match space.lengths().into_iter().flatten().find(is_outside) {
        Some(length) => Err(format!("the length {length:?} is outside the range of 32-bit numbers")),
        None => Ok(space),
    }
}

/// Joins words to a shell command, with quotes where needed.
pub fn shell_command(words: &[String]) -> String {
    words.iter().map(|word| quoted(word)).collect::<Vec<_>>().join(" ")
}

fn quoted(word: &str) -> String {
    let is_plain = |c: char| c.is_alphanumeric() || "-_./=,:+@%".contains(c);
    if !word.is_empty() && word.chars().all(is_plain) {
        word.to_owned()
    } else {
        format!("'{}'", word.replace('\'', r"'\''"))
    }
}

#[cfg(test)]
mod tests {
    use super::{periodic_space, periodic_space_f32, shell_command};

    #[test]
    fn lengths_are_f64_numbers_unless_a_program_searches_in_f32() {
        for (text, length) in [("1e300,-,-", 1e300), ("0.1,-,-", 0.1), ("1e-60,-,-", 1e-60)] {
            assert_eq!(periodic_space(text).map(|space| space.lengths()), Ok([Some(length), None, None]));
        }
        assert_eq!(periodic_space_f32("0.1,-,-"), periodic_space("0.1,-,-"));
        for text in ["1e39,-,-", "-,1e-60,-"] {
            let refused = periodic_space_f32(text).unwrap_err();
            assert!(refused.contains("is outside the range of 32-bit numbers"), "{refused}");
        }
    }

    #[test]
    fn words_are_quoted_for_a_shell() {
        let words = ["lazygrid-bench", "--only", "3a,4", "my folder", "it's", ""].map(str::to_owned);
        assert_eq!(shell_command(&words), r"lazygrid-bench --only 3a,4 'my folder' 'it'\''s' ''");
    }
}
