//! Records the commit, and compiles the Bullet shim.

include!("../cli/commit.rs");

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

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rerun-if-changed=../cli/commit.rs");
    let commit = commit(&CRATES, &["bench/build.rs", "bench/shim"]);
    println!("cargo::rustc-env=LAZYGRID_COMMIT={}", commit.unwrap_or_else(|| "unknown".to_owned()));
    #[cfg(feature = "bullet")]
    bullet();
}

/// `BULLET_INCLUDE` overrides Debian's path of the headers.
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
