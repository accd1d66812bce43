//! Compiles the shim to Bullet where the feature `bullet` asks for it.

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    #[cfg(feature = "bullet")]
    bullet();
}

/// `BULLET_INCLUDE` names Bullet's headers where they are not where Debian has them.
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
