use std::env;

use lazygrid_io::arguments::shell_command;

const PACKAGE: &str = env!("CARGO_PKG_NAME");

pub(crate) fn command() -> String {
    let mut words = env::args_os().map(|word| word.to_string_lossy().into_owned());
    let program = words.next().unwrap_or_else(|| PACKAGE.to_owned());
    let by_cargo = env::var("CARGO_PKG_NAME").is_ok_and(|name| name == PACKAGE);
    let mut command = if by_cargo { cargo_run() } else { vec![program] };
    command.extend(words);
    shell_command(&command)
}

fn cargo_run() -> Vec<String> {
    let profile: &[&str] = if cfg!(debug_assertions) { &[] } else { &["--release"] };
    let features: &[&str] = if cfg!(feature = "bullet") { &["--features", "bullet"] } else { &[] };
    let parts = [&["cargo", "run"], profile, &["-p", PACKAGE], features, &["--"]];
    parts.concat().into_iter().map(str::to_owned).collect()
}
