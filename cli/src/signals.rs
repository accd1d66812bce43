use std::sync::Arc;
use std::sync::atomic::{AtomicI32, Ordering};

use lazygrid_io::write::remove_temporaries;

use crate::error::CliError;

#[derive(Clone, Default)]
pub(crate) struct StopSignal(Arc<AtomicI32>);

impl StopSignal {
    pub(crate) const CTRL_C: i32 = 2;

    pub(crate) fn signal(&self) -> Option<i32> {
        Some(self.0.load(Ordering::Relaxed)).filter(|&signal| signal != 0)
    }
}

/// Removes incomplete files, then ends the process by the signal.
pub(crate) fn install_cleanup_handler() -> Result<(), CliError> {
    on_signal(end)
}

/// The first signal asks the command to stop, the second ends it.
pub(crate) fn install_stop_handler() -> Result<StopSignal, CliError> {
    let stop_signal = StopSignal::default();
    let handler_signal = stop_signal.clone();
    on_signal(move |signal| {
        if handler_signal.0.swap(signal, Ordering::Relaxed) != 0 {
            end(signal);
        }
    })?;
    Ok(stop_signal)
}

/// Handles signals in a thread; leaves SIGHUP alone if it is ignored, as under `nohup`.
#[cfg(unix)]
fn on_signal(handle: impl Fn(i32) + Send + 'static) -> Result<(), CliError> {
    use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
    use signal_hook::iterator::Signals;

    let hangup = (!is_ignored(SIGHUP)).then_some(SIGHUP);
    let mut signals = Signals::new([SIGINT, SIGTERM].into_iter().chain(hangup)).map_err(CliError::Signal)?;
    let listen = move || signals.forever().for_each(handle);
    std::thread::Builder::new().spawn(listen).map(drop).map_err(CliError::SignalThread)
}

/// Returns `true` if the process began with `signal` ignored, or if that is unknown.
#[cfg(unix)]
fn is_ignored(signal: i32) -> bool {
    let Ok(status) = std::fs::read_to_string("/proc/self/status") else { return true };
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    let mask = mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok());
    mask.is_none_or(|mask| mask >> (signal - 1) & 1 == 1)
}

#[cfg(not(unix))]
fn on_signal(handle: impl Fn(i32) + Send + 'static) -> Result<(), CliError> {
    ctrlc::set_handler(move || handle(StopSignal::CTRL_C)).map_err(CliError::Signal)
}

fn end(signal: i32) {
    remove_temporaries();
    #[cfg(unix)]
    let _ = signal_hook::low_level::emulate_default_handler(signal);
    std::process::exit(128 + signal);
}
