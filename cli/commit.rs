// Shared by the build scripts of `cli` and `bench`.

use std::path::Path;
use std::process::Command;

/// Returns the commit, marked if the sources of `crates` or `more` differ; `None` outside a clone.
fn commit(crates: &[&str], more: &[&str]) -> Option<String> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent()?;
    let git = |args: &[&str]| {
        let output = Command::new("git").arg("-C").arg(root).args(args).output().ok()?;
        output.status.success().then(|| String::from_utf8_lossy(&output.stdout).trim().to_owned())
    };
    let watch = |path: &Path| {
        // Cargo treats a missing file as changed.
        if path.exists() {
            println!("cargo::rerun-if-changed={}", path.display());
        }
    };
    let mut sources = vec!["Cargo.toml".to_owned(), "Cargo.lock".to_owned()];
    sources.extend(crates.iter().flat_map(|name| [format!("{name}/Cargo.toml"), format!("{name}/src")]));
    sources.extend(more.iter().map(|&path| path.to_owned()));
    sources.iter().for_each(|source| watch(&root.join(source)));
    // A copy of the sources may lie inside another repository.
    git(&["ls-files", "--error-unmatch", "cli/commit.rs"])?;
    // Commits add a line to HEAD's log.
    for name in ["HEAD", "logs/HEAD"] {
        watch(&root.join(git(&["rev-parse", "--git-path", name])?));
    }
    let commit = git(&["rev-parse", "--short", "HEAD"])?;
    let mut status = vec!["--no-optional-locks", "status", "--porcelain", "--"];
    status.extend(sources.iter().map(String::as_str));
    let changes = git(&status)?;
    Some(if changes.is_empty() { commit } else { format!("{commit} with changes") })
}
