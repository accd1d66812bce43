//! The language of comments: openings that leave the reader to work out what an item is become fewer, never more.

use std::fs;
use std::path::{Path, PathBuf};

/// Folders with sources of the project.
const FOLDERS: [&str; 14] = [
    "bench",
    "capi",
    "check",
    "cli",
    "distributed",
    "engine",
    "fuzz",
    "host-fallback",
    "io",
    "kernels",
    "python",
    "report",
    "simulator",
    "tests",
];

/// Words with which no comment should begin.
const OPENINGS: [&str; 11] =
    ["what", "whether", "where", "how", "who", "why", "which", "those", "as", "of", "by"];

/// The number of comments that still begin with one of them. Lower it with every change that lowers the count.
const BUDGET: usize = 643;

/// Adds the sources in a folder, except those in build outputs and hidden folders.
fn add_sources(folder: &Path, sources: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).expect("a folder of the workspace") {
        let path = entry.expect("an entry").path();
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        if path.is_dir() {
            if !name.starts_with('.') && name != "target" && name != "node_modules" {
                add_sources(&path, sources);
            }
        } else if name.ends_with(".rs") || name.ends_with(".wgsl") {
            sources.push(path);
        }
    }
}

/// The text of a comment line; `None` for code.
fn comment(line: &str) -> Option<&str> {
    let text = line.trim_start().strip_prefix("//")?;
    Some(text.trim_start_matches(['/', '!']).trim_start())
}

/// The comments of a source that begin with one of [`OPENINGS`].
fn unclear_openings(source: &str) -> usize {
    let mut before = None;
    let mut count = 0;
    for line in source.lines() {
        let text = comment(line);
        let begins = before.is_none_or(str::is_empty);
        let word = text.and_then(|text| text.split(|c: char| !c.is_alphanumeric()).next());
        let is_unclear = word.is_some_and(|word| OPENINGS.contains(&word.to_ascii_lowercase().as_str()));
        count += usize::from(begins && is_unclear);
        before = text;
    }
    count
}

#[test]
fn unclear_openings_of_comments_stay_within_the_budget() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("the workspace");
    let mut sources = Vec::new();
    FOLDERS.iter().for_each(|folder| add_sources(&root.join(folder), &mut sources));
    let count: usize =
        sources.iter().map(|path| unclear_openings(&fs::read_to_string(path).expect("text"))).sum();
    assert!(
        count <= BUDGET,
        "{count} comments begin with one of {OPENINGS:?}, more than {BUDGET}: begin with a noun or a verb"
    );
}

#[test]
fn only_the_first_line_of_a_comment_is_its_opening() {
    let source = "/// What a cell is.\n/// How it is built.\nfn cell() {}\n//! Cells.\n//!\n//! Of them.\n// A cell\n// of one.";
    assert_eq!(unclear_openings(source), 2);
}
