//! Inlines WGSL functions whose body is one `return` statement.

struct Single {
    name: String,
    parameters: Vec<String>,
    body: String,
}

pub(crate) fn inlined(text: &str) -> String {
    let mut text = text.to_owned();
    for _ in 0..8 {
        let before = text.clone();
        for single in singles(&before) {
            text = expanded(&text, &single);
        }
        if text == before {
            break;
        }
    }
    text
}

fn singles(text: &str) -> Vec<Single> {
    let text = format!("\n{text}");
    text.split("\nfn ").skip(1).filter_map(single).collect()
}

fn single(function: &str) -> Option<Single> {
    let (header, rest) = function.split_once(" {\n")?;
    let (name, parameters) = header.split_once('(')?;
    let (parameters, _) = parameters.rsplit_once(") -> ")?;
    if parameters.contains("ptr<") {
        return None;
    }
    let (body, _) = rest.trim_start().strip_prefix("return ")?.split_once(";\n}")?;
    if body.contains(';') {
        return None;
    }
    let names = parameters.split(", ").filter_map(|parameter| parameter.split_once(':'));
    let parameters = names.map(|(name, _)| name.trim().to_owned()).collect();
    Some(Single { name: name.to_owned(), parameters, body: body.trim_end_matches(';').to_owned() })
}

fn expanded(text: &str, single: &Single) -> String {
    let call = format!("{}(", single.name);
    let mut result = String::new();
    let mut rest = text;
    while let Some(at) = rest.find(&call) {
        let before = &rest[..at];
        let is_other = before.ends_with(|c: char| is_word(c) || c == '.') || before.ends_with("fn ");
        let inside = &rest[at + call.len()..];
        match arguments(inside).filter(|_| !is_other) {
            None => {
                result += &rest[..at + call.len()];
                rest = inside;
            }
            Some((arguments, after)) => {
                result += before;
                result += &format!("({})", substituted(&single.body, &single.parameters, &arguments));
                rest = after;
            }
        }
    }
    result + rest
}

fn is_word(c: char) -> bool {
    c.is_alphanumeric() || c == '_'
}

fn arguments(text: &str) -> Option<(Vec<String>, &str)> {
    let (mut depth, mut start, mut found) = (0, 0, Vec::new());
    for (at, c) in text.char_indices() {
        match c {
            '(' | '[' => depth += 1,
            ')' if depth == 0 => {
                found.push(text[start..at].trim().to_owned());
                found.retain(|argument| !argument.is_empty());
                return Some((found, &text[at + 1..]));
            }
            ')' | ']' => depth -= 1,
            ',' if depth == 0 => {
                found.push(text[start..at].trim().to_owned());
                start = at + 1;
            }
            _ => {}
        }
    }
    None
}

fn substituted(body: &str, parameters: &[String], arguments: &[String]) -> String {
    let mut result = String::new();
    let mut rest = body;
    while let Some(at) = rest.find(is_word) {
        let (before, word) = rest.split_at(at);
        result += before;
        let end = word.find(|c| !is_word(c)).unwrap_or(word.len());
        let (word, after) = word.split_at(end);
        let is_member = result.ends_with('.');
        match parameters.iter().position(|name| name == word).filter(|_| !is_member) {
            Some(number) => result += &format!("({})", arguments[number]),
            None => result += word,
        }
        rest = after;
    }
    result + rest
}
