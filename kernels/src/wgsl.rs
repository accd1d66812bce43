//! A preprocessor for WGSL.

use std::fmt::Write;

/// Resolves `#include NAME` and `#include NAME ARGUMENT` from `includes`, and the conditions `#ifdef NAME`, `#else` and
/// `#endif` (not nested in one file). The argument replaces `#{ARGUMENT}` in an include. Lines after `#standard` are
/// kept if `STANDARD` is defined. An include without an argument appears once; an unknown name is omitted.
pub fn expand(source: &str, includes: &[(&str, &str)], is_defined: &dyn Fn(&str) -> bool) -> String {
    let mut expansion = Expansion { includes, is_defined, included: Vec::new(), text: String::new() };
    expansion.append(source);
    expansion.text
}

struct Expansion<'a> {
    includes: &'a [(&'a str, &'a str)],
    is_defined: &'a dyn Fn(&str) -> bool,
    included: Vec<String>,
    text: String,
}

impl Expansion<'_> {
    fn append(&mut self, source: &str) {
        let mut kept = true;
        for line in source.lines() {
            match line.split_once(' ').unwrap_or((line, "")) {
                ("#ifdef", name) => kept = (self.is_defined)(name),
                ("#else", _) => kept = !kept,
                ("#endif", _) => kept = true,
                _ if !kept => {}
                ("#standard", rest) if (self.is_defined)("STANDARD") => self.append_line(rest),
                ("#standard", _) => {}
                ("#include", rest) => self.include(rest),
                _ => self.append_line(line),
            }
        }
    }

    fn append_line(&mut self, line: &str) {
        self.text += line;
        self.text.push('\n');
    }

    fn include(&mut self, what: &str) {
        let (name, argument) = what.split_once(' ').unwrap_or((what, ""));
        if argument.is_empty() {
            if self.included.iter().any(|included| included == name) {
                return;
            }
            self.included.push(name.to_owned());
        }
        let found = self.includes.iter().find(|(include, _)| *include == name);
        let source = found.map_or("", |(_, source)| source).replace("#{ARGUMENT}", argument);
        self.append(&source);
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
    fn includes_and_conditions_are_resolved() {
        let pieces = [("one", "a #{ARGUMENT}\n#include two\n"), ("two", "#ifdef B\nb\n#endif\n")];
        let source = "#include one 7\n#ifdef A\nx\n#else\ny\n#endif\nz\n#include three\n";
        assert_eq!(expand(source, &pieces, &|name| name == "A"), "a 7\nx\nz\n");
        assert_eq!(expand(source, &pieces, &|name| name == "B"), "a 7\nb\ny\nz\n");
        let twice = "#include two\n#include one 1\n#include one 2\n";
        assert_eq!(expand(twice, &pieces, &|name| name == "B"), "b\na 1\na 2\n");
    }
}
