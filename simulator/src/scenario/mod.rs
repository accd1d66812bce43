//! Scenario files: a [`Model`] and its output, as TOML. `docs/simulator.md` lists the keys.

mod flow_file;
mod nearest;
mod overrides;
mod resolve;
mod run_warnings;
pub mod sweep;
mod warnings;

use std::ops::Range;
use std::path::Path;

use self::nearest::nearest;
pub use self::overrides::Overrides;
pub use self::sweep::Sweep;
use lazygrid_io::{excerpt, printed};

use crate::memory::check_available;
pub use crate::output::options::Output;
use crate::{Error, Model};

#[derive(Clone, Debug)]
pub struct Scenario {
    pub model: Model,
    pub steps: u32,
    pub seed: u64,
    pub output: Output,
    pub text: String,
    /// Each with its location and a remedy.
    pub warnings: Vec<String>,
}

impl Scenario {
    /// Reads a scenario file.
    ///
    /// # Errors
    /// [`Error::Read`] if the file cannot be read, otherwise as [`parse`](Self::parse).
    pub fn read(path: &Path) -> Result<Self, Error> {
        let text = std::fs::read_to_string(path);
        Self::parse(path, text.map_err(|source| Error::Read { path: path.to_owned(), source })?)
    }

    /// Parses the text of the file at `path`, and logs the warnings.
    ///
    /// # Errors
    /// [`Error::Scenario`] with line and key, [`Error::Model`] for a fault without a location.
    pub fn parse(path: &Path, text: String) -> Result<Self, Error> {
        let scenario = Self::parse_silently(path, text)?;
        scenario.warnings.iter().for_each(|message| log::warn!("{message}"));
        Ok(scenario)
    }

    fn parse_silently(path: &Path, text: String) -> Result<Self, Error> {
        check_length(text.len())?;
        let placed = |problem| located(path, &text, problem);
        let file = lazygrid_scenario::parse(&text).map_err(|error| placed(error.into()))?;
        let resolve::ResolvedScenario { model, steps, seed, output, warnings } =
            resolve::resolve(file, path.parent().unwrap_or(Path::new(""))).map_err(placed)?;
        model.check().map_err(shortened)?;
        let more = warnings.len().saturating_sub(MAX_WARNINGS);
        let first = warnings.into_iter().take(MAX_WARNINGS);
        let mut warnings: Vec<_> = first.map(|problem| placed(problem).to_string()).collect();
        if more > 0 {
            warnings.push(format!("{}: {more} more warnings", path.display()));
        }
        Ok(Self { model, steps, seed, output, text, warnings })
    }
}

const MAX_WARNINGS: usize = 100;
/// Bytes that parsing takes per byte of text, for tables with one short key each.
const BYTES_PER_BYTE: u64 = 200;

/// Refuses a text whose parsing would exceed the memory.
fn check_length(bytes: usize) -> Result<(), Error> {
    let remedy = "make it shorter, or raise the limit";
    check_available(
        &format!("{bytes} bytes of scenario"),
        BYTES_PER_BYTE.saturating_mul(bytes as u64),
        remedy,
    )
}

fn located(path: &Path, text: &str, Problem { span, key, message }: Problem) -> Error {
    let start = span.map_or(0, |span| span.start);
    let (line, found) = line_and_key(text, start);
    let key = excerpt(key.unwrap_or(found).as_bytes());
    let message = short_message(&message);
    Error::Scenario { path: path.to_owned(), line, key, message }
}

fn shortened(error: Error) -> Error {
    match error {
        Error::Model(message) => Error::Model(short_message(&message)),
        error => error,
    }
}

struct Problem {
    span: Option<Range<usize>>,
    key: Option<String>,
    message: String,
}

impl Problem {
    fn at(span: Range<usize>, message: String) -> Self {
        Self { span: Some(span), key: None, message }
    }
}

impl From<toml::de::Error> for Problem {
    fn from(error: toml::de::Error) -> Self {
        // Messages such as "missing field `radius`" and "unknown field `radios`, …" name the key.
        let message = error.message().lines().collect::<Vec<_>>().join("; ");
        let named =
            ["missing field `", "unknown field `"].iter().find_map(|start| message.strip_prefix(start));
        let key = named.and_then(|rest| rest.split_once('`')).map(|(key, _)| key.to_owned());
        let message = key.iter().fold(message, |text, key| text.replacen(key, &excerpt(key.as_bytes()), 1));
        let near = message.strip_prefix("unknown field `").and_then(|rest| {
            let mut names = rest.split('`').step_by(2);
            nearest(names.next()?, rest.split('`').skip(2).step_by(2))
        });
        let message = near.map(|near| format!("{message}; the nearest is `{near}`")).unwrap_or(message);
        Self { span: error.span(), key, message }
    }
}

/// Largest length of a message, in bytes.
const MOST_SHOWN: usize = 800;
const MOST_QUOTED: usize = 60;

fn short_message(message: &str) -> String {
    printed(with_short_quotes(message).as_bytes(), MOST_SHOWN)
}

/// Shortens words and quotations to [`MOST_QUOTED`] characters: the parser quotes keys and values in full.
fn with_short_quotes(text: &str) -> String {
    let (mut shown, mut quote, mut length) = (String::new(), None, 0);
    for c in text.chars() {
        let is_end = quote.map_or(c.is_whitespace(), |quote| c == quote);
        let is_begin = quote.is_none() && matches!(c, '`' | '"');
        if is_end || is_begin {
            (quote, length) = (is_begin.then_some(c), 0);
            shown.push(c);
            continue;
        }
        length += 1;
        if length <= MOST_QUOTED {
            shown.push(c);
        } else if length == MOST_QUOTED + 1 {
            shown.push('…');
        }
    }
    shown
}

/// Returns the 1-based line, and the key there or in the nearest earlier line.
fn line_and_key(text: &str, start: usize) -> (usize, String) {
    let start = (0..=start.min(text.len())).rev().find(|&at| text.is_char_boundary(at)).unwrap_or(0);
    let line = text[..start].bytes().filter(|&byte| byte == b'\n').count();
    let key_of = |line: &str| {
        let line = line.trim_start_matches([' ', '\t', '{', '}', ',']);
        let key = match line.strip_prefix('[') {
            Some(header) => header.trim_start_matches('[').split(']').next(),
            None => line.split_once('=').map(|(key, _)| key.trim_end()),
        };
        key.filter(|key| !key.is_empty() && !key.starts_with('#')).map(str::to_owned)
    };
    let end = text[start..].find('\n').map_or(text.len(), |length| start + length);
    let key = text[..end].lines().rev().find_map(key_of);
    (line + 1, key.unwrap_or_default())
}

#[cfg(test)]
mod tests;
