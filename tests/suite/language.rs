use std::fs;
use std::path::{Path, PathBuf};

const ROOTS: [&str; 19] = [
    "ARCHITECTURE.md",
    "CONTRIBUTING.md",
    "README.md",
    "bench",
    "capi",
    "check",
    "cli",
    "distributed",
    "docs",
    "engine",
    "fuzz",
    "host-fallback",
    "io",
    "java",
    "kernels",
    "python",
    "report",
    "simulator",
    "tests",
];

const EXTENSIONS: [&str; 10] = ["c", "cc", "h", "hpp", "java", "md", "py", "pyi", "rs", "wgsl"];

/// Build outputs, generated tables and this list of patterns.
const SKIPPED: [&str; 5] = ["target", "node_modules", "results", "data", "language.rs"];

const OPENINGS: [&str; 12] =
    ["what", "whether", "where", "how", "who", "why", "which", "those", "as", "of", "by", "the same"];

enum Pattern {
    Phrases(&'static [&'static str]),
    Prefixes(&'static [&'static str]),
    Pair(&'static [&'static str], usize, &'static str),
}

/// Patterns that no line may have, and a better wording.
const PATTERNS: [(Pattern, &str); 16] = [
    (Pattern::Phrases(&["so many"]), "the parameter in backticks"),
    (Pattern::Phrases(&["where there is", "where there are"]), "if … exists"),
    (Pattern::Phrases(&["is none", "are none"]), "is not a …"),
    (Pattern::Phrases(&["whoever", "whatever", "whichever", "nobody", "everybody"]), "the actor by name"),
    (Pattern::Phrases(&["what comes of", "what came of", "befall", "befalls", "befell"]), "result, event"),
    (Pattern::Phrases(&["anew"]), "rebuild"),
    (Pattern::Phrases(&["but for"]), "except"),
    (Pattern::Phrases(&["beside"]), "next to"),
    (Pattern::Phrases(&["behind"]), "after"),
    (Pattern::Pair(&["from"], 25, "on"), "at or above"),
    (Pattern::Phrases(&["take down", "takes down", "take up where", "takes up where"]), "records, updates"),
    (Pattern::Pair(&["held", "hold", "holds"], 100, "against"), "checks against"),
    (Pattern::Prefixes(&["settle"]), "assign, apply, resolve"),
    (Pattern::Prefixes(&["lean", "straight", "seam"]), "triclinic, orthogonalized, periodic boundary"),
    (Pattern::Phrases(&["the way back", "bring back", "brings back"]), "readback"),
    (Pattern::Phrases(&["without a word", "last word", "in words"]), "(delete)"),
];

/// Words that had several meanings in code, with a limit of their uses and better words.
const AMBIGUOUS_WORDS: [(Pattern, usize, &str); 12] = [
    (Pattern::Phrases(&["place"]), 19, "index, position, location"),
    (Pattern::Phrases(&["edge"]), 7, "cell size, cell vector, side"),
    (Pattern::Phrases(&["reach"]), 9, "cutoff, effective radius, distance"),
    (Pattern::Phrases(&["share"]), 17, "fraction, range"),
    (Pattern::Phrases(&["piece"]), 1, "chunk, tile, segment"),
    (Pattern::Phrases(&["room"]), 11, "capacity, boundary"),
    (Pattern::Phrases(&["way"]), 9, "path, displacement, direction"),
    (Pattern::Phrases(&["turn"]), 8, "iteration, rotation"),
    (Pattern::Phrases(&["kept"]), 10, "candidates, cached"),
    (Pattern::Phrases(&["gone"]), 2, "removed, moved"),
    (Pattern::Phrases(&["asked"]), 1, "requested"),
    (Pattern::Phrases(&["fn of"]), 0, "new, from_…, or a noun"),
];

impl Pattern {
    fn matches(&self, line: &str) -> bool {
        let word = |c: char| c.is_alphanumeric() || c == '_';
        let begins = |at: usize| !line[..at].chars().next_back().is_some_and(word);
        let ends = |at: usize| !line[at..].chars().next().is_some_and(word);
        let whole = |phrase: &str| {
            line.match_indices(phrase).map(|(at, _)| at).find(|&at| begins(at) && ends(at + phrase.len()))
        };
        match self {
            Self::Phrases(phrases) => phrases.iter().any(|phrase| whole(phrase).is_some()),
            Self::Prefixes(prefixes) => {
                prefixes.iter().any(|prefix| line.match_indices(prefix).any(|(at, _)| begins(at)))
            }
            Self::Pair(firsts, within, last) => firsts.iter().any(|first| {
                whole(first).is_some_and(|at| {
                    let start = at + first.len();
                    let ends_with = |(end, _): (usize, &str)| {
                        end > start && end - start <= within + 1 && begins(end) && ends(end + last.len())
                    };
                    line.match_indices(last).any(ends_with)
                })
            }),
        }
    }
}

fn add_files(path: PathBuf, files: &mut Vec<PathBuf>) {
    let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    if name.starts_with('.') || SKIPPED.contains(&name.as_str()) {
        return;
    }
    if path.is_dir() {
        for entry in fs::read_dir(path).expect("a folder of the workspace") {
            add_files(entry.expect("an entry").path(), files);
        }
    } else if path.extension().is_some_and(|suffix| EXTENSIONS.iter().any(|extension| suffix == *extension)) {
        files.push(path);
    }
}

fn texts() -> Vec<(PathBuf, String)> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("the workspace");
    let mut files = Vec::new();
    ROOTS.iter().for_each(|name| add_files(root.join(name), &mut files));
    files.into_iter().map(|path| (path.clone(), fs::read_to_string(path).expect("text"))).collect()
}

fn comment(line: &str) -> Option<&str> {
    let text = line.trim_start().strip_prefix("//")?;
    Some(text.trim_start_matches(['/', '!']).trim_start())
}

fn unclear_openings(source: &str) -> usize {
    let mut before = None;
    let mut count = 0;
    for line in source.lines() {
        let text = comment(line);
        let begins = before.is_none_or(str::is_empty);
        let is_unclear = text.is_some_and(|text| {
            let text = text.to_lowercase();
            let rest = |opening: &&str| text.strip_prefix(*opening).map(|rest| rest.chars().next());
            OPENINGS.iter().filter_map(rest).any(|next| next.is_none_or(|c| !c.is_alphanumeric()))
        });
        count += usize::from(begins && is_unclear);
        before = text;
    }
    count
}

fn is_source(path: &Path) -> bool {
    path.extension().is_some_and(|suffix| suffix == "rs" || suffix == "wgsl")
}

#[test]
fn ambiguous_words_in_code_do_not_spread() {
    let texts = texts();
    let sources = texts.iter().filter(|(path, _)| is_source(path));
    let lines: Vec<&str> =
        sources.flat_map(|(_, text)| text.lines()).filter(|line| comment(line).is_none()).collect();
    let uses = |pattern: &Pattern| lines.iter().filter(|line| pattern.matches(line)).count();
    let counts = AMBIGUOUS_WORDS.iter().map(|(pattern, limit, better)| (uses(pattern), limit, better));
    let above: Vec<_> = counts.filter(|(count, limit, _)| count > limit).collect();
    assert!(above.is_empty(), "lines, their limit, and better words: {above:?}");
}

#[test]
fn comments_begin_with_a_noun_or_a_verb() {
    let texts = texts();
    let sources = texts.iter().filter(|(path, _)| is_source(path));
    let unclear = sources.filter(|(_, text)| unclear_openings(text) > 0).map(|(path, _)| path);
    let unclear: Vec<_> = unclear.collect();
    assert!(
        unclear.is_empty(),
        "comments begin with one of {OPENINGS:?} in {unclear:?}: begin with a noun or a verb"
    );
}

#[test]
fn no_line_has_an_unclear_phrase() {
    let texts = texts();
    let mut lines: [Vec<String>; PATTERNS.len()] = Default::default();
    for (path, text) in &texts {
        for (number, line) in (1..).zip(text.lines()) {
            // Python's `is None` is code.
            let lower = line.replace("is None", "").to_lowercase();
            for ((pattern, ..), found) in PATTERNS.iter().zip(&mut lines) {
                if pattern.matches(&lower) {
                    found.push(format!("{}:{number}: {}", path.display(), line.trim()));
                }
            }
        }
    }
    let found = PATTERNS.iter().zip(&lines).filter(|(_, found)| !found.is_empty());
    let report: String =
        found.map(|((_, better), found)| format!("write: {better}\n{}\n", found.join("\n"))).collect();
    assert!(report.is_empty(), "{report}");
}

#[test]
fn only_the_first_line_of_a_comment_is_its_opening() {
    let source = "/// What a cell is.\n/// How it is built.\nfn cell() {}\n//! Cells.\n//!\n//! Of them.\n// A cell\n// of one.\n\
                  fn f() {}\n// The same.\nfn g() {}\n// Offsets.";
    assert_eq!(unclear_openings(source), 3);
}

#[test]
fn patterns_match_whole_words() {
    let phrase = Pattern::Phrases(&["so many"]);
    assert!(phrase.matches("so many spheres") && !phrase.matches("also many"));
    let prefix = Pattern::Prefixes(&["lean"]);
    assert!(prefix.matches("a box that leans") && !prefix.matches("clean"));
    let pair = Pattern::Pair(&["from"], 25, "on");
    assert!(pair.matches("from step 5 on, none") && !pair.matches("from one of them"));
    assert!(!pair.matches("from a place that is far away, it goes on"));
}
