//! Gives the shared library its SONAME, so that programs load a compatible version.

use std::env;

fn main() {
    println!("cargo:rerun-if-changed=build.rs");
    let part = |name: &str| env::var(format!("CARGO_PKG_VERSION_{name}")).unwrap_or_default();
    let (major, minor) = (part("MAJOR"), part("MINOR"));
    // Before 1.0 a minor version may change the interface.
    let number = if major == "0" { format!("0.{minor}") } else { major };
    match env::var("CARGO_CFG_TARGET_OS").as_deref() {
        Ok("windows") => {}
        Ok("macos" | "ios") => {
            println!("cargo:rustc-cdylib-link-arg=-Wl,-install_name,@rpath/liblazygrid.{number}.dylib");
        }
        _ => println!("cargo:rustc-cdylib-link-arg=-Wl,-soname,liblazygrid.so.{number}"),
    }
}
