//! A preprocessor for WGSL.

use std::fmt::Write;

/// Resolves `#include NAME` and `#include NAME ARGUMENT` from `includes`, and the conditions `#ifdef NAME`, `#else` and
/// `#endif` (not nested in one file). `#{ARGUMENT}` in an include is replaced by the argument. Lines after `#standard` are
/// kept if `STANDARD` is defined. Includes may include others; an unknown name is left out.
pub fn expand(source: &str, pieces: &[(&str, &str)], is_defined: &dyn Fn(&str) -> bool) -> String {
    let mut text = String::new();
    append(source, pieces, is_defined, &mut text);
    text
}

fn append(source: &str, pieces: &[(&str, &str)], is_defined: &dyn Fn(&str) -> bool, text: &mut String) {
    let mut kept = true;
    for line in source.lines() {
        match line.split_once(' ').unwrap_or((line, "")) {
            ("#ifdef", name) => kept = is_defined(name),
            ("#else", _) => kept = !kept,
            ("#endif", _) => kept = true,
            _ if !kept => {}
            ("#standard", rest) if is_defined("STANDARD") => drop(writeln!(text, "{rest}")),
            ("#standard", _) => {}
            ("#include", rest) => {
                let (name, argument) = rest.split_once(' ').unwrap_or((rest, ""));
                let piece = pieces.iter().find(|(piece, _)| *piece == name);
                let source = piece.map_or("", |(_, source)| source).replace("#{ARGUMENT}", argument);
                append(&source, pieces, is_defined, text);
            }
            // Writing to a string does not fail.
            _ => drop(writeln!(text, "{line}")),
        }
    }
}

/// Writes each block between `#repeat NAME 4` and `#end` four times, with `#{NAME}` replaced by 0, 1, 2 and 3.
pub fn repeated(source: &str) -> String {
    let mut text = String::new();
    let mut lines = source.lines();
    while let Some(line) = lines.next() {
        match line.strip_prefix("#repeat ").and_then(|rest| rest.split_once(' ')) {
            None => drop(writeln!(text, "{line}")),
            Some((name, times)) => {
                let block: String =
                    lines.by_ref().take_while(|line| *line != "#end").flat_map(|line| [line, "\n"]).collect();
                for time in 0..times.parse().unwrap_or(0) {
                    text += &block.replace(&format!("#{{{name}}}"), &u32::to_string(&time));
                }
            }
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pieces_and_conditions() {
        let pieces = [("one", "a #{ARGUMENT}\n#include two\n"), ("two", "#ifdef B\nb\n#endif\n")];
        let source = "#include one 7\n#ifdef A\nx\n#else\ny\n#endif\nz\n#include three\n";
        assert_eq!(expand(source, &pieces, &|name| name == "A"), "a 7\nx\nz\n");
        assert_eq!(expand(source, &pieces, &|name| name == "B"), "a 7\nb\ny\nz\n");
    }
}
