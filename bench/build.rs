//! Records the commit of the build, and compiles the Bullet shim if the feature `bullet` is enabled.

use std::path::Path;
use std::process::Command;

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rustc-env=LAZYGRID_COMMIT={}", commit().unwrap_or_else(|| "unknown".to_owned()));
    #[cfg(feature = "bullet")]
    bullet();
}

/// The folders of the crates that figures depend on.
const CRATES: [&str; 9] = [
    "kernels",
    "host-fallback",
    "engine",
    "distributed/ranks",
    "io",
    "simulator",
    "check",
    "report",
    "bench",
];

/// The commit of the source tree, marked if the sources differ from it. `None` without git or outside a clone.
fn commit() -> Option<String> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent()?;
    let git = |args: &[&str]| {
        let output = Command::new("git").arg("-C").arg(root).args(args).output().ok()?;
        output.status.success().then(|| String::from_utf8_lossy(&output.stdout).trim().to_owned())
    };
    let watch = |path: &Path| {
        // Cargo treats a missing file as changed at each build.
        if path.exists() {
            println!("cargo::rerun-if-changed={}", path.display());
        }
    };
    let mut sources = vec!["Cargo.toml".to_owned(), "Cargo.lock".to_owned()];
    sources.extend(CRATES.iter().flat_map(|name| [format!("{name}/Cargo.toml"), format!("{name}/src")]));
    sources.push("bench/build.rs".to_owned());
    sources.push("bench/shim".to_owned());
    sources.iter().for_each(|source| watch(&root.join(source)));
    // The sources may be a copy inside another repository.
    git(&["ls-files", "--error-unmatch", "bench/build.rs"])?;
    // Commits, checkouts and rebases each add a line to the log of HEAD.
    for name in ["HEAD", "logs/HEAD"] {
        watch(&root.join(git(&["rev-parse", "--git-path", name])?));
    }
    let commit = git(&["rev-parse", "--short", "HEAD"])?;
    let mut status = vec!["--no-optional-locks", "status", "--porcelain", "--"];
    status.extend(sources.iter().map(String::as_str));
    let changes = git(&status)?;
    Some(if changes.is_empty() { commit } else { format!("{commit} with changes") })
}

/// Compiles the shim. `BULLET_INCLUDE` overrides Debian's path of Bullet's headers.
#[cfg(feature = "bullet")]
fn bullet() {
    const DEBIAN: &str = "/usr/include/bullet";
    println!("cargo::rerun-if-changed=shim/bullet.cpp");
    println!("cargo::rerun-if-env-changed=BULLET_INCLUDE");
    let include = std::env::var("BULLET_INCLUDE").unwrap_or_else(|_| DEBIAN.to_owned());
    cc::Build::new()
        .cpp(true)
        .file("shim/bullet.cpp")
        .include(include)
        .flag_if_supported("-Wno-unused-parameter")
        .opt_level(3)
        .compile("lazygrid_bullet_shim");
    println!("cargo::rustc-link-lib=BulletCollision");
    println!("cargo::rustc-link-lib=LinearMath");
}
