use crate::error::CliError;
use crate::print;

/// Keeps the first failure to print until [`finish`](Self::finish): a closed standard output must not stop
/// the work or hide its verdict.
#[derive(Debug, Default)]
pub(crate) struct Printer {
    failure: Option<CliError>,
}

impl Printer {
    pub(crate) fn print(&mut self, text: impl AsRef<[u8]>) {
        if self.failure.is_none() {
            self.failure = print(text).err();
        }
    }

    pub(crate) fn finish(self) -> Result<(), CliError> {
        self.failure.map_or(Ok(()), Err)
    }

    #[cfg(test)]
    pub(crate) fn closed() -> Self {
        Self { failure: Some(CliError::Stdout(std::io::ErrorKind::BrokenPipe.into())) }
    }
}
