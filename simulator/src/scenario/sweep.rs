//! Sweeps: scenarios with all combinations of values of some keys.

use std::collections::HashSet;
use std::ops::Range;
use std::path::Path;

use lazygrid_io::{excerpt, printed};
use toml::Spanned;
use toml::de::{DeTable, DeValue};

use super::{MOST_SHOWN, Problem, Scenario, check_length, flow_file, located, nearest};
use crate::Error;

const MAX_POINTS: usize = 100_000;

#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SweptKey {
    /// Path, such as `receiver.rx.center.x`.
    pub path: String,
    /// Values as TOML text.
    pub values: Vec<String>,
}

#[derive(Clone, Debug)]
pub struct SweepPoint {
    /// Values without quotation marks, in the order of keys.
    pub values: Vec<String>,
    pub scenario: Scenario,
}

/// All combinations of values, the last key fastest.
#[derive(Clone, Debug)]
pub struct Sweep {
    /// Keys of `[sweep]` in alphabetical order, then those of options.
    pub keys: Vec<SweptKey>,
    pub points: Vec<SweepPoint>,
}

impl Sweep {
    /// Reads `[sweep]`, and `KEY=VALUE,VALUE` options, which replace values of the same key. Returns `None` without
    /// either.
    ///
    /// # Errors
    /// [`Error::Read`], [`Error::Scenario`] for a faulty file, [`Error::Model`] for a faulty key or option, and
    /// [`Error::SweepPoint`] for an invalid combination.
    pub fn read(path: &Path, options: &[String]) -> Result<Option<Self>, Error> {
        let text = std::fs::read_to_string(path);
        let text = text.map_err(|source| Error::Read { path: path.to_owned(), source })?;
        Self::parse(path, &text, options)
    }

    /// Parses the sweep of a scenario's text.
    ///
    /// # Errors
    /// See [`read`](Self::read).
    pub fn parse(path: &Path, text: &str, options: &[String]) -> Result<Option<Self>, Error> {
        check_length(text.len())?;
        let placed = |problem| located(path, text, problem);
        // `Scenario::parse` reports a text that is not TOML.
        let Ok(file) = DeTable::parse(text) else { return Ok(None) };
        let mut keys = section_keys(text, file.get_ref()).map_err(placed)?;
        let option_keys = options.iter().map(|option| option_key(option)).collect::<Result<Vec<_>, _>>();
        option_keys.and_then(|option_keys| replace_keys(&mut keys, option_keys)).map_err(Error::Model)?;
        if keys.is_empty() {
            return Ok(None);
        }
        keys.iter().try_for_each(check_values).map_err(Error::Model)?;
        let text = without_section(text, file.get_ref());
        let Ok(file) = DeTable::parse(&text) else { return Ok(None) };
        let mut known = Vec::new();
        list_keys(file.get_ref(), "", MAX_PATH_PARTS, &mut known);
        let spots = keys.iter().map(|key| value_span(key, &known)).collect::<Result<Vec<_>, _>>();
        let spots = spots.and_then(disjoint).map_err(Error::Model)?;
        let points = combinations(&keys).map_err(Error::Model)?;
        // A scenario keeps a tenth of what its parsing takes.
        check_length(text.len() * points.len() / 10)?;
        let (mut logged, mut fields) = (Vec::new(), Vec::new());
        let directory = path.parent().unwrap_or(Path::new(""));
        let points = points.into_iter().map(|values| {
            let text = flow_file::with_absolute_path(replaced(&text, &spots, &values), directory);
            let scenario = Scenario::parse_silently(path, text);
            let values: Vec<String> = values.iter().map(|value| unquoted(value)).collect();
            let mut scenario = scenario.map_err(|source| sweep_point_error(&keys, &values, source))?;
            flow_file::share_flow_field(&mut scenario.model, &mut fields);
            for warning in scenario.warnings.iter().filter(|warning| !logged.contains(*warning)) {
                log::warn!("{}: {warning}", named_values(&keys, &values));
            }
            logged.extend_from_slice(&scenario.warnings);
            Ok(SweepPoint { values, scenario })
        });
        let points = points.collect::<Result<Vec<_>, Error>>()?;
        Ok(Some(Self { keys, points }))
    }
}

pub(crate) fn sweep_point_error(keys: &[SweptKey], values: &[String], source: Error) -> Error {
    Error::SweepPoint { values: named_values(keys, values), source: Box::new(source) }
}

fn named_values(keys: &[SweptKey], values: &[String]) -> String {
    let shown = |text: &str| excerpt(text.as_bytes());
    let named =
        keys.iter().zip(values).map(|(key, value)| format!("{} = {}", shown(&key.path), shown(value)));
    printed(named.collect::<Vec<_>>().join(", ").as_bytes(), MOST_SHOWN)
}

fn section_keys(text: &str, file: &DeTable<'_>) -> Result<Vec<SweptKey>, Problem> {
    let mut keys = Vec::new();
    let Some(section) = file.get("sweep") else { return Ok(keys) };
    let DeValue::Table(table) = section.get_ref() else {
        return Err(Problem::at(section.span(), "write it as a section: [sweep]".to_owned()));
    };
    if !text[section.span()].starts_with('[') {
        let message = "write it as a section of its own: a line [sweep], then a line for each key".to_owned();
        return Err(Problem::at(section.span(), message));
    }
    add_section_keys(text, table, "", &mut keys)?;
    match keys.is_empty() {
        true => Err(Problem::at(section.span(), "it has no keys; write KEY = [VALUE, VALUE]".to_owned())),
        false => Ok(keys),
    }
}

fn add_section_keys(
    text: &str,
    table: &DeTable<'_>,
    prefix: &str,
    keys: &mut Vec<SweptKey>,
) -> Result<(), Problem> {
    for (name, value) in table {
        let path = format!("{prefix}{}", name.get_ref());
        match value.get_ref() {
            DeValue::Table(inner) => add_section_keys(text, inner, &format!("{path}."), keys)?,
            DeValue::Array(values) if !values.is_empty() => {
                let values = values.iter().map(|value| text[value.span()].to_owned()).collect();
                keys.push(SweptKey { path, values });
            }
            _ => {
                let message = "it needs a list of values, as in time-step = [1e-3, 1e-4]".to_owned();
                return Err(Problem::at(value.span(), message));
            }
        }
    }
    Ok(())
}

/// Parses `KEY=VALUE,VALUE`. Values that are not TOML are strings.
fn option_key(option: &str) -> Result<SweptKey, String> {
    let shown = excerpt(option.as_bytes());
    let path_and_values = option.split_once('=').map(|(path, values)| (path.trim(), values.trim()));
    let (path, values) =
        path_and_values.filter(|(path, values)| !path.is_empty() && !values.is_empty()).ok_or_else(|| {
            format!("--sweep '{shown}' is not KEY=VALUE,VALUE, as in receiver.rx.center.x=5,10,20")
        })?;
    let list = format!("v = [{values}]");
    let parsed = DeTable::parse(&list).ok().and_then(|table| match table.get_ref().get("v")?.get_ref() {
        DeValue::Array(values) => {
            Some(values.iter().map(|value| list[value.span()].to_owned()).collect::<Vec<_>>())
        }
        _ => None,
    });
    let values = parsed.unwrap_or_else(|| values.split(',').map(|value| quoted(value.trim())).collect());
    Ok(SweptKey { path: path.to_owned(), values })
}

pub(super) fn quoted(value: &str) -> String {
    format!("\"{}\"", value.replace('\\', "\\\\").replace('"', "\\\""))
}

fn unquoted(value: &str) -> String {
    let inner = ['"', '\''].into_iter().find_map(|quote| value.strip_prefix(quote)?.strip_suffix(quote));
    inner.unwrap_or(value).replace(',', " ").split_whitespace().collect::<Vec<_>>().join(" ")
}

struct KnownKey {
    path: String,
    span: Range<usize>,
    is_string: bool,
}

/// Parts and bytes of the longest path of a key. The number of paths is exponential in their parts, because elements of
/// nested arrays have several names.
const MAX_PATH_PARTS: usize = 8;
const MAX_PATH_BYTES: usize = 1024;

/// Lists keys of at most `max_parts` parts. Array elements are named by index, and by name, equation or species,
/// coordinates also by x, y and z.
fn list_keys(table: &DeTable<'_>, prefix: &str, max_parts: usize, known: &mut Vec<KnownKey>) {
    for (name, value) in table {
        list_value(value, format!("{prefix}{}", name.get_ref()), max_parts, known);
    }
}

fn list_value(value: &Spanned<DeValue<'_>>, path: String, max_parts: usize, known: &mut Vec<KnownKey>) {
    let Some(max_parts) = max_parts.checked_sub(1).filter(|_| path.len() <= MAX_PATH_BYTES) else { return };
    match value.get_ref() {
        DeValue::Table(table) => return list_keys(table, &format!("{path}."), max_parts, known),
        DeValue::Array(values) => {
            for (index, one) in values.iter().enumerate() {
                let names = element_names(one.get_ref(), index, values.len());
                names
                    .into_iter()
                    .for_each(|name| list_value(one, format!("{path}.{name}"), max_parts, known));
            }
            if values.iter().any(|one| matches!(one.get_ref(), DeValue::Table(_))) {
                return;
            }
        }
        _ => {}
    }
    let is_string = matches!(value.get_ref(), DeValue::String(_));
    known.push(KnownKey { path, span: value.span(), is_string });
}

fn element_names(value: &DeValue<'_>, index: usize, count: usize) -> Vec<String> {
    let mut names = vec![index.to_string()];
    match value {
        DeValue::Table(table) => {
            let name = ["name", "equation", "species"].into_iter().find_map(|key| table.get(key));
            names.extend(name.and_then(|name| name.get_ref().as_str()).map(str::to_owned));
        }
        DeValue::Array(_) => {}
        _ if count == 3 => names.push(["x", "y", "z"][index].to_owned()),
        _ => {}
    }
    names
}

fn value_span(key: &SweptKey, known: &[KnownKey]) -> Result<(Range<usize>, bool), String> {
    let mut found = known.iter().filter(|known| known.path == key.path);
    if let Some(first) = found.next() {
        return match found.any(|other| other.span != first.span) {
            false => Ok((first.span.clone(), first.is_string)),
            true => Err(format!(
                "the scenario has several keys '{}' to sweep; name the list entry by its index, or rename an entry",
                excerpt(key.path.as_bytes())
            )),
        };
    }
    let near = nearest(&key.path, known.iter().map(|known| &known.path[..])).unwrap_or_default();
    let (path, near) = (excerpt(key.path.as_bytes()), excerpt(near.as_bytes()));
    Err(format!(
        "the scenario has no key '{path}' to sweep; the nearest is '{near}'; write a key with some value in the scenario first"
    ))
}

/// Refuses equal values, because their points would be the same run.
fn check_values(key: &SweptKey) -> Result<(), String> {
    let mut known = HashSet::new();
    // Numbers are equal in any notation; strings have quotation marks.
    let number = |value: &String| {
        let digits = value.replace('_', "");
        // An `f64` rounds long seeds and bits.
        match digits.bytes().all(|byte| byte.is_ascii_digit()) {
            true => digits,
            false => digits.parse::<f64>().map_or_else(|_| value.clone(), |x| x.to_string()),
        }
    };
    match key.values.iter().find(|value| !known.insert(number(value))) {
        None => Ok(()),
        Some(value) => {
            let [path, value] = [&key.path, value].map(|text| excerpt(text.as_bytes()));
            Err(format!("the sweep has the value {value} of {path} twice; remove one"))
        }
    }
}

fn disjoint(spots: Vec<(Range<usize>, bool)>) -> Result<Vec<(Range<usize>, bool)>, String> {
    let mut ends: Vec<&Range<usize>> = spots.iter().map(|(span, _)| span).collect();
    ends.sort_by_key(|span| span.start);
    match ends.windows(2).all(|pair| pair[0].end <= pair[1].start) {
        true => Ok(spots),
        false => {
            Err("two keys of the sweep are the same, or one is a part of the other; remove one".to_owned())
        }
    }
}

fn combinations(keys: &[SweptKey]) -> Result<Vec<Vec<String>>, String> {
    let count = keys.iter().try_fold(1_usize, |count, key| count.checked_mul(key.values.len()));
    if count.is_none_or(|count| count > MAX_POINTS) {
        return Err(format!("the sweep has more than {MAX_POINTS} combinations; sweep fewer values"));
    }
    let add = |all: Vec<Vec<String>>, key: &SweptKey| {
        let longer = all
            .iter()
            .flat_map(|one| key.values.iter().map(|value| [&one[..], std::slice::from_ref(value)].concat()));
        longer.collect()
    };
    Ok(keys.iter().fold(vec![Vec::new()], add))
}

/// Puts quotation marks around values of strings.
fn replaced(text: &str, spots: &[(Range<usize>, bool)], values: &[String]) -> String {
    let mut edits: Vec<_> = spots.iter().zip(values).collect();
    edits.sort_by_key(|((span, _), _)| std::cmp::Reverse(span.start));
    let mut text = text.to_owned();
    for ((span, is_string), value) in edits {
        let is_quoted = value.starts_with(['"', '\'']);
        let value = if *is_string && !is_quoted { quoted(value) } else { value.clone() };
        text.replace_range(span.clone(), &value);
    }
    text
}

/// Returns the text without the section `[sweep]`, with as many lines.
fn without_section(text: &str, file: &DeTable<'_>) -> String {
    let Some(section) = file.get("sweep") else { return text.to_owned() };
    let start = section.span().start;
    let mut after = text.len();
    for (name, value) in file.iter().filter(|(name, _)| name.get_ref() != "sweep") {
        let mut known = Vec::new();
        list_value(value, name.get_ref().to_string(), MAX_PATH_PARTS, &mut known);
        let first = known.iter().map(|known| known.span.start).chain([value.span().start]);
        after = first.filter(|&at| at > start).fold(after, usize::min);
    }
    // The next header begins with a bracket at the start of a line.
    let header = text[start..after].rfind("\n[").filter(|_| after < text.len());
    let end = match text[after..].starts_with('[') && text[..after].ends_with('\n') {
        true => after,
        false => header.map_or(after, |at| start + at + 1),
    };
    let lines = "\n".repeat(text[start..end].matches('\n').count());
    [&text[..start], &lines, &text[end..]].concat()
}

/// Replaces the keys of a section by those of options, which name each once.
fn replace_keys(keys: &mut Vec<SweptKey>, option_keys: Vec<SweptKey>) -> Result<(), String> {
    for (k, key) in option_keys.iter().enumerate() {
        if option_keys[..k].iter().any(|other| other.path == key.path) {
            let path = excerpt(key.path.as_bytes());
            return Err(format!(
                "--sweep {path}: given twice; give all values at once, such as {path}=1,2,3"
            ));
        }
    }
    for key in option_keys {
        match keys.iter_mut().find(|known| known.path == key.path) {
            Some(known) => *known = key,
            None => keys.push(key),
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests;
