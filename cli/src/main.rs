//! The `lazygrid` command.

use std::process::ExitCode;

fn main() -> ExitCode {
    quiet_wayland();
    #[cfg(target_os = "linux")]
    if closed_output::IS_CLOSED.load(std::sync::atomic::Ordering::Relaxed) {
        lazygrid_cli::set_output_closed();
    }
    lazygrid_cli::run(std::env::args_os()).into()
}

/// Silences libwayland's message about a missing run-time directory: Mesa's device-select layer asks for a
/// compositor.
fn quiet_wayland() {
    const RUNTIME_DIRECTORY: &str = "XDG_RUNTIME_DIR";
    let missing = !std::env::var_os(RUNTIME_DIRECTORY)
        .is_some_and(|directory| std::path::Path::new(&directory).is_absolute());
    if cfg!(target_os = "linux") && missing {
        // SAFETY: `main` has just begun, and neither this program nor a library has started a thread. So no
        // other code uses the environment at the same time.
        unsafe { std::env::set_var(RUNTIME_DIRECTORY, "/dev/null") };
    }
}

/// Tests for a closed standard output before Rust's runtime replaces it.
#[cfg(target_os = "linux")]
mod closed_output {
    use std::ffi::c_int;
    use std::sync::atomic::{AtomicBool, Ordering};

    pub(super) static IS_CLOSED: AtomicBool = AtomicBool::new(false);

    #[used]
    // SAFETY: the loader calls the functions of this section once, before `main`, by the C calling
    // convention. `ask` needs nothing of Rust's runtime.
    #[unsafe(link_section = ".init_array")]
    static ASK: extern "C" fn() = ask;

    extern "C" fn ask() {
        unsafe extern "C" {
            fn fcntl(file: c_int, command: c_int, ...) -> c_int;
        }
        const STDOUT: c_int = 1;
        const F_GETFD: c_int = 1;
        // SAFETY: `fcntl` with F_GETFD takes no further argument, and reads the flags of a descriptor or
        // fails.
        let flags = unsafe { fcntl(STDOUT, F_GETFD) };
        IS_CLOSED.store(flags == -1, Ordering::Relaxed);
    }
}
