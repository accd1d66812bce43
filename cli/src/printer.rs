use crate::error::CliError;
use crate::print;

/// Prints reports of work whose result is elsewhere. A closed standard output must neither stop such work nor hide its
/// verdict, so the first failure is kept until [`finish`](Self::finish).
#[derive(Debug, Default)]
pub(crate) struct Printer {
    failure: Option<CliError>,
}

impl Printer {
    /// Writes nothing after a failure.
    pub(crate) fn print(&mut self, text: impl AsRef<[u8]>) {
        if self.failure.is_none() {
            self.failure = print(text).err();
        }
    }

    /// Returns the first failure.
    pub(crate) fn finish(self) -> Result<(), CliError> {
        self.failure.map_or(Ok(()), Err)
    }

    #[cfg(test)]
    pub(crate) fn closed() -> Self {
        Self { failure: Some(CliError::Stdout(std::io::ErrorKind::BrokenPipe.into())) }
    }
}
