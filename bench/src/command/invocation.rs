use std::env;

const PACKAGE: &str = env!("CARGO_PKG_NAME");

/// Returns a command to type again: `cargo run` with this build's profile and features, or the program's path.
pub(crate) fn command() -> String {
    let mut words = env::args_os().map(|word| word.to_string_lossy().into_owned());
    let program = words.next().unwrap_or_else(|| PACKAGE.to_owned());
    let by_cargo = env::var("CARGO_PKG_NAME").is_ok_and(|name| name == PACKAGE);
    let mut command = if by_cargo { cargo_run() } else { vec![program] };
    command.extend(words);
    typed(&command)
}

fn cargo_run() -> Vec<String> {
    let profile: &[&str] = if cfg!(debug_assertions) { &[] } else { &["--release"] };
    let features: &[&str] = if cfg!(feature = "bullet") { &["--features", "bullet"] } else { &[] };
    let parts = [&["cargo", "run"], profile, &["-p", PACKAGE], features, &["--"]];
    parts.concat().into_iter().map(str::to_owned).collect()
}

fn typed(words: &[String]) -> String {
    words.iter().map(|word| quoted(word)).collect::<Vec<_>>().join(" ")
}

fn quoted(word: &str) -> String {
    let is_plain = |c: char| c.is_alphanumeric() || "-_./=,:+@%".contains(c);
    if !word.is_empty() && word.chars().all(is_plain) {
        word.to_owned()
    } else {
        format!("'{}'", word.replace('\'', r"'\''"))
    }
}

#[cfg(test)]
mod tests {
    use super::typed;

    #[test]
    fn words_are_quoted_for_a_shell() {
        let words = ["lazygrid-bench", "--only", "3a,4", "my folder", "it's", ""].map(str::to_owned);
        assert_eq!(typed(&words), r"lazygrid-bench --only 3a,4 'my folder' 'it'\''s' ''");
    }
}
