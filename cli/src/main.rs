//! The `lazygrid` command: overlapping pairs of the spheres in a file.

use std::process::ExitCode;

fn main() -> ExitCode {
    quiet_wayland();
    lazygrid_cli::run(std::env::args_os()).into()
}

/// Keeps libwayland from complaining on standard error, as if the complaint were ours, if there is no run-time
/// directory: it says so when Mesa's layer that chooses a device asks for a compositor, and wgpu lets it ask.
fn quiet_wayland() {
    const RUNTIME_DIRECTORY: &str = "XDG_RUNTIME_DIR";
    let missing = !std::env::var_os(RUNTIME_DIRECTORY)
        .is_some_and(|directory| std::path::Path::new(&directory).is_absolute());
    if cfg!(target_os = "linux") && missing {
        // Nothing can lie below it, so no compositor is found there, as before.
        // SAFETY: `main` has just begun. No thread has been started, by this program or by a library that is loaded
        // with it, so nobody reads or writes the environment at the same time.
        unsafe { std::env::set_var(RUNTIME_DIRECTORY, "/dev/null") };
    }
}
