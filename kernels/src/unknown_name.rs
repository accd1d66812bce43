use thiserror::Error;

/// The error of `FromStr` for an unknown name.
///
/// ```
/// # use lazygrid_kernels::{Algorithm, UnknownName};
/// let unknown: UnknownName = "octree".parse::<Algorithm>().unwrap_err();
/// assert!(unknown.to_string().starts_with("unknown algorithm 'octree'; expected one of auto, naive, "));
/// ```
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[error("unknown {what} '{}'; expected one of {known}", shortened(name))]
pub struct UnknownName {
    what: &'static str,
    name: String,
    known: String,
}

impl UnknownName {
    /// Creates the error for a `name` of the kind `what` that is not among the `known` ones.
    pub fn new(what: &'static str, name: &str, known: &[&str]) -> Self {
        Self { what, name: name.to_owned(), known: known.join(", ") }
    }

    /// Returns the unknown name.
    pub fn name(&self) -> &str {
        &self.name
    }
}

/// Maximum characters of a name in a message.
const LONGEST: usize = 60;

fn shortened(name: &str) -> String {
    let mut shown: String = name.chars().take(LONGEST).collect();
    if shown.len() < name.len() {
        shown.push('…');
    }
    shown
}

#[cfg(test)]
mod tests {
    use crate::{Algorithm, Backend};

    #[test]
    fn names_parse_and_unknown_names_are_quoted() {
        for &backend in Backend::ALL {
            assert_eq!(backend.name().parse(), Ok(backend));
        }
        for &algorithm in Algorithm::ALL {
            assert_eq!(algorithm.name().parse(), Ok(algorithm));
        }
        let unknown = "CPU".parse::<Backend>().unwrap_err();
        assert_eq!(unknown.to_string(), "unknown backend 'CPU'; expected one of auto, cpu, gpu");
        assert_eq!(unknown.name(), "CPU");
    }
}
