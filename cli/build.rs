//! Records the commit that the page names.

include!("commit.rs");

const CRATES: [&str; 6] = ["kernels", "host-fallback", "engine", "io", "check", "cli"];

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rerun-if-changed=commit.rs");
    let commit = commit(&CRATES, &[]);
    println!("cargo::rustc-env=LAZYGRID_COMMIT={}", commit.unwrap_or_else(|| "unknown".to_owned()));
}
