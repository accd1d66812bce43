#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::ffi::OsStr;
use std::io::Write;
use std::process::{Child, Command, Output, Stdio};
use std::thread;
use std::time::Duration;

use crate::command::Program;

/// A command that is killed if a test fails before it [ends](Self::end).
pub struct Running(Option<Child>);

impl Program {
    /// Starts a command that logs errors only.
    pub fn start(
        self,
        args: impl IntoIterator<Item = impl AsRef<OsStr>>,
        input: Stdio,
        output: Stdio,
    ) -> Running {
        let mut command = self.command(args);
        command.env("RUST_LOG", "error").stdin(input).stdout(output).stderr(Stdio::piped());
        Running(Some(command.spawn().unwrap()))
    }
}

impl Running {
    pub fn write(&mut self, input: &[u8]) {
        self.child().stdin.as_mut().unwrap().write_all(input).unwrap();
    }

    /// Waits until `holds` returns `true`, for any time: the machine may be busy.
    ///
    /// # Panics
    /// Panics if the command ends first.
    pub fn wait_until(mut self, mut holds: impl FnMut() -> bool) -> Self {
        while !holds() {
            if self.child().try_wait().unwrap().is_some() {
                let ended = self.finish();
                panic!("{}: {}", ended.status, String::from_utf8_lossy(&ended.stderr));
            }
            thread::sleep(Duration::from_millis(10));
        }
        self
    }

    /// Sends a signal such as `-INT`, and waits for the end. Standard input stays open.
    pub fn end(mut self, signal: &str) -> Output {
        let _input = self.child().stdin.take();
        let id = self.child().id().to_string();
        assert!(Command::new("kill").args([signal, &id]).status().unwrap().success());
        self.finish()
    }

    /// Closes standard input, and waits for the end.
    pub fn finish(mut self) -> Output {
        self.0.take().unwrap().wait_with_output().unwrap()
    }

    fn child(&mut self) -> &mut Child {
        self.0.as_mut().unwrap()
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        if let Some(child) = &mut self.0 {
            let _ = child.kill();
            let _ = child.wait();
        }
    }
}
