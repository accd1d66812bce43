//! A preprocessor for WGSL.

use std::fmt::Write;

/// Resolves `#include NAME`, `#include NAME ARGUMENT`, `#ifdef NAME`, `#else` and `#endif` (not nested in one file).
/// The argument replaces `#{ARGUMENT}` in the include. Without one, the include appears once; unknown names are
/// omitted. The rest of a line that begins with `#standard` is kept if `STANDARD` is defined.
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
        let mut is_included = true;
        for line in source.lines() {
            if !line.starts_with('#') {
                if is_included {
                    self.append_line(line);
                }
                continue;
            }
            match line.split_once(' ').unwrap_or((line, "")) {
                ("#ifdef", name) => is_included = (self.is_defined)(name),
                ("#else", _) => is_included = !is_included,
                ("#endif", _) => is_included = true,
                _ if !is_included => {}
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

/// Replaces `#{NAME}` by the constants.
pub fn with_constants(source: &str, constants: &[(&str, u32)]) -> String {
    let (mut text, mut rest) = (String::with_capacity(source.len()), source);
    while let Some((before, after)) = rest.split_once("#{") {
        text += before;
        let value = |name| constants.iter().find(|(constant, _)| *constant == name).map(|(_, value)| value);
        let known = after.split_once('}').and_then(|(name, after)| Some((value(name)?, after)));
        match known {
            Some((value, _)) => drop(write!(text, "{value}")),
            None => text += "#{",
        }
        rest = known.map_or(after, |(_, after)| after);
    }
    text + rest
}

/// Repeats each block between `#repeat NAME 4` and `#end` with `#{NAME}` replaced by 0, 1, 2 and 3.
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
                    text += &with_constants(&block, &[(name, time)]);
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
    fn constants_are_replaced_and_other_names_stay() {
        let constants = [("A", 7), ("LONG", 12)];
        assert_eq!(with_constants("#{A}#{LONG}+#{B}-#{A", &constants), "712+#{B}-#{A");
        assert_eq!(with_constants("#{#{A}}", &constants), "#{7}");
        assert_eq!(with_constants("", &constants), "");
    }

    #[test]
    fn includes_and_conditions_are_resolved() {
        let includes = [("one", "a #{ARGUMENT}\n#include two\n"), ("two", "#ifdef B\nb\n#endif\n")];
        let source = "#include one 7\n#ifdef A\nx\n#else\ny\n#endif\nz\n#include three\n";
        assert_eq!(expand(source, &includes, &|name| name == "A"), "a 7\nx\nz\n");
        assert_eq!(expand(source, &includes, &|name| name == "B"), "a 7\nb\ny\nz\n");
        let twice = "#include two\n#include one 1\n#include one 2\n";
        assert_eq!(expand(twice, &includes, &|name| name == "B"), "b\na 1\na 2\n");
    }
}
