//! Tint, the compiler of Chromium and Dawn, rejects some texts that naga accepts, and proves that whole workgroups
//! reach barriers.
//!
//! `npm ci --prefix kernels/tint` installs it. Without it the test is skipped, unless `LAZYGRID_REQUIRE_TINT` is set.

#[path = "../../tests/src/skip.rs"]
mod skip;
mod texts;

use std::fs;
use std::path::Path;
use std::process::Command;

use lazygrid_kernels::kernel::Kernel;
use skip::skip;

#[test]
fn tint_accepts_every_text() {
    let tint = Path::new(env!("CARGO_MANIFEST_DIR")).join("tint");
    if !tint.join("node_modules").exists() {
        let why = "Tint is not installed; `npm ci --prefix kernels/tint` does that";
        return skip(Some("LAZYGRID_REQUIRE_TINT"), why);
    }
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("wgsl");
    let _ = fs::remove_dir_all(&folder);
    fs::create_dir_all(&folder).expect("a folder");
    for text in texts::all(Kernel::strict_wgsl) {
        fs::write(folder.join(text.name).with_extension("wgsl"), text.wgsl).expect("written");
    }
    let run = Command::new("node").arg(tint.join("check.mjs")).arg(&folder).output().expect("node runs");
    let said = format!("{}{}", String::from_utf8_lossy(&run.stdout), String::from_utf8_lossy(&run.stderr));
    assert!(run.status.success(), "{said}the texts are in {}", folder.display());
}
