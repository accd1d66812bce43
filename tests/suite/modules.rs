use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

const CRATES: [&str; 17] = [
    "bench/src",
    "capi/src",
    "check/src",
    "cli/src",
    "distributed/mpi/src",
    "distributed/ranks/src",
    "engine/src",
    "fuzz/src",
    "host-fallback/src",
    "io/src",
    "kernels/src",
    "python/src",
    "report/src",
    "simulator/results/src",
    "simulator/scenario/src",
    "simulator/src",
    "tests/src",
];

type Graph = BTreeMap<String, BTreeSet<String>>;

fn code(source: &str) -> String {
    let mut text = String::with_capacity(source.len());
    let mut rest = source;
    while let Some(first) = rest.chars().next() {
        if rest.starts_with("//") {
            rest = rest.split_once('\n').map_or("", |(_, after)| after);
            text.push('\n');
        } else if first == '"' {
            rest = after_string(&rest[1..]);
            text.push_str("\"\"");
        } else if rest.starts_with("r\"") || rest.starts_with("r#\"") {
            let end = if rest.starts_with("r\"") { "\"" } else { "\"#" };
            let string = &rest[1 + end.len()..];
            rest = string.split_once(end).map_or("", |(_, after)| after);
        } else if rest.starts_with("'\"'") || rest.starts_with("'\\\"'") {
            rest = rest.split_once("\"'").map_or("", |(_, after)| after);
        } else if let Some(after) = rest.strip_prefix("#[cfg(test)]") {
            rest = after_item(after);
        } else {
            text.push(first);
            rest = &rest[first.len_utf8()..];
        }
    }
    text
}

fn after_string(mut rest: &str) -> &str {
    while let Some(at) = rest.find(['"', '\\']) {
        let skipped = if rest[at..].starts_with('\\') { 2 } else { 1 };
        let next = rest.get(at + skipped..).unwrap_or_default();
        if skipped == 1 {
            return next;
        }
        rest = next;
    }
    ""
}

fn after_item(rest: &str) -> &str {
    let mut depth = 0_usize;
    for (at, character) in rest.char_indices() {
        match character {
            ';' if depth == 0 => return &rest[at + 1..],
            '{' => depth += 1,
            '}' if depth <= 1 => return &rest[at + 1..],
            '}' => depth -= 1,
            _ => {}
        }
    }
    ""
}

fn paths(text: &str, prefix: &str) -> Vec<Vec<String>> {
    let is_word = |c: char| c.is_alphanumeric() || c == '_';
    let mut found = Vec::new();
    for (at, _) in text.match_indices(prefix) {
        let is_whole = text[..at].chars().next_back().is_none_or(|c| !is_word(c) && c != ':');
        if is_whole {
            expand(&text[at + prefix.len()..], &[], &mut found);
        }
    }
    found
}

fn expand<'a>(text: &'a str, before: &[String], found: &mut Vec<Vec<String>>) -> &'a str {
    let text = text.trim_start();
    if let Some(mut rest) = text.strip_prefix('{') {
        loop {
            rest = rest.trim_start();
            if let Some(after) = rest.strip_prefix('}') {
                return after;
            }
            let next = expand(rest, before, found);
            let next = next.trim_start();
            // Renames, `as name`, end at the next comma.
            let end = next.find([',', '}']).unwrap_or(next.len());
            rest = next[end..].strip_prefix(',').unwrap_or(&next[end..]);
            if rest.is_empty() {
                return rest;
            }
        }
    }
    let end = text.find(|c: char| !c.is_alphanumeric() && c != '_').unwrap_or(text.len());
    if end == 0 {
        // A glob uses the module itself.
        found.extend((!before.is_empty()).then(|| before.to_vec()));
        return text.strip_prefix('*').unwrap_or_default();
    }
    let mut path = before.to_vec();
    path.push(text[..end].to_owned());
    match text[end..].strip_prefix("::") {
        Some(rest) if rest.starts_with(|c: char| c.is_alphanumeric() || "_{*".contains(c)) => {
            expand(rest, &path, found)
        }
        _ => {
            found.push(path);
            &text[end..]
        }
    }
}

fn modules(folder: &Path, path: &[String], files: &mut Vec<(Vec<String>, PathBuf)>) {
    for entry in fs::read_dir(folder).expect("a folder of the workspace") {
        let entry = entry.expect("an entry").path();
        let name = entry.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let is_root = path.is_empty() && ["lib", "main"].contains(&name.as_str());
        if entry.is_dir() && name != "bin" {
            modules(&entry, &[path, &[name]].concat(), files);
        } else if entry.extension().is_some_and(|extension| extension == "rs") {
            let module = if name == "mod" || is_root { path.to_vec() } else { [path, &[name]].concat() };
            files.push((module, entry));
        }
    }
}

fn test_modules(text: &str) -> BTreeSet<String> {
    let after = text.split("#[cfg(test)]").skip(1);
    let name = |item: &str| Some(item.trim_start().strip_prefix("mod ")?.split_once(';')?.0.to_owned());
    after.filter_map(name).filter(|name| !name.contains(['{', '\n'])).collect()
}

fn graph(folder: &Path) -> Graph {
    let mut files = Vec::new();
    modules(folder, &[], &mut files);
    let sources: Vec<(Vec<String>, String)> =
        files.into_iter().map(|(path, file)| (path, fs::read_to_string(file).expect("text"))).collect();
    let tests: BTreeSet<Vec<String>> = sources
        .iter()
        .flat_map(|(path, text)| test_modules(text).into_iter().map(|name| [&path[..], &[name]].concat()))
        .collect();
    let is_tested_only = |path: &[String]| (1..=path.len()).any(|end| tests.contains(&path[..end]));
    let names: BTreeSet<String> = sources.iter().filter_map(|(path, _)| path.first().cloned()).collect();
    let mut exported: BTreeMap<String, String> = BTreeMap::new();
    for (_, text) in sources.iter().filter(|(path, _)| path.is_empty()) {
        for path in paths(&code(text), "use ") {
            let path = if path[0] == "self" || path[0] == "crate" { &path[1..] } else { &path[..] };
            if let [module, .., name] = path
                && names.contains(module)
            {
                exported.insert(name.clone(), module.clone());
            }
        }
    }
    let mut graph = Graph::new();
    for (path, text) in &sources {
        let Some(module) = path.first() else { continue };
        let uses = graph.entry(module.clone()).or_default();
        if is_tested_only(path) {
            continue;
        }
        let code = code(text);
        let absolute = paths(&code, "crate::").into_iter();
        let relative = paths(&code, "super::").into_iter().filter_map(|used| {
            let ups = 1 + used.iter().take_while(|name| *name == "super").count();
            Some([path.get(..path.len().checked_sub(ups)?)?, &used[ups - 1..]].concat())
        });
        for used in absolute.chain(relative) {
            let Some(first) = used.first() else { continue };
            let target = names.get(first).or_else(|| exported.get(first));
            uses.extend(target.filter(|target| *target != module).cloned());
        }
    }
    graph
}

fn reached(graph: &Graph, start: &str) -> BTreeSet<String> {
    let mut reached = BTreeSet::new();
    let mut next: Vec<&String> = graph[start].iter().collect();
    while let Some(module) = next.pop() {
        if reached.insert(module.clone()) {
            next.extend(graph.get(module).into_iter().flatten());
        }
    }
    reached
}

fn circles(graph: &Graph) -> BTreeSet<Vec<String>> {
    let all: BTreeMap<&String, BTreeSet<String>> =
        graph.keys().map(|module| (module, reached(graph, module))).collect();
    let circle = |(module, reached): (&&String, &BTreeSet<String>)| {
        let back = |other: &&String| all.get(other).is_some_and(|from| from.contains(*module));
        reached.contains(*module).then(|| reached.iter().filter(back).cloned().collect())
    };
    all.iter().filter_map(circle).collect()
}

#[test]
fn modules_have_no_import_circles() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("the workspace");
    let mut found = Vec::new();
    for folder in CRATES.iter().filter(|folder| root.join(folder).is_dir()) {
        let graph = graph(&root.join(folder));
        for circle in circles(&graph) {
            let among = |module: &String| {
                let uses = graph[module].iter().filter(|used| circle.contains(used));
                format!("{module} -> {}", uses.cloned().collect::<Vec<_>>().join(", "))
            };
            let edges: Vec<String> = circle.iter().map(among).collect();
            found.push(format!("{folder}: {}", edges.join("; ")));
        }
    }
    assert!(found.is_empty(), "modules import each other:\n{}", found.join("\n"));
}

#[test]
fn paths_are_found_in_groups_and_relative() {
    let source = "use crate::{a::{B, c::D as E}, f, self};\n/// crate::no\nlet x = crate::g::h(\"crate::no\");\n\
                  #[cfg(test)]\nmod tests { use crate::no; }\nuse crate::i::*;";
    let found: Vec<String> = paths(&code(source), "crate::").iter().map(|path| path.join("::")).collect();
    assert_eq!(found, ["a::B", "a::c::D", "f", "self", "g::h", "i"]);
}

#[test]
fn circle_of_three_modules_is_found() {
    let set = |names: &[&str]| names.iter().map(|name| (*name).to_owned()).collect::<BTreeSet<_>>();
    let graph: Graph = [("a", set(&["b"])), ("b", set(&["c"])), ("c", set(&["a", "d"])), ("d", set(&[]))]
        .map(|(name, uses)| (name.to_owned(), uses))
        .into();
    assert_eq!(circles(&graph), [vec!["a".to_owned(), "b".to_owned(), "c".to_owned()]].into());
}
