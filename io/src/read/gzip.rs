use std::io::{self, BufRead, Read};

use flate2::bufread::GzDecoder;

/// Reads one or more members. Zero bytes after a member are padding, as on tapes and in disk images.
pub(super) struct GzipReader<R> {
    member: Option<GzDecoder<R>>,
}

impl<R: BufRead> GzipReader<R> {
    pub(super) fn new(input: R) -> Self {
        Self { member: Some(GzDecoder::new(input)) }
    }
}

impl<R: BufRead> Read for GzipReader<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        while let Some(member) = &mut self.member {
            let read = member.read(buffer).map_err(damaged)?;
            if read > 0 || buffer.is_empty() {
                return Ok(read);
            }
            let Some(ended) = self.member.take() else { break };
            self.member = next_member(ended.into_inner())?;
        }
        Ok(0)
    }
}

fn next_member<R: BufRead>(mut input: R) -> io::Result<Option<GzDecoder<R>>> {
    loop {
        let bytes = input.fill_buf()?;
        let zeros = bytes.iter().take_while(|&&byte| byte == 0).count();
        let (is_end, is_member) = (bytes.is_empty(), zeros < bytes.len());
        input.consume(zeros);
        if is_end {
            return Ok(None);
        }
        if is_member {
            return Ok(Some(GzDecoder::new(input)));
        }
    }
}

/// Keeps errors of the system, such as of a disk.
fn damaged(error: io::Error) -> io::Error {
    use io::ErrorKind::{InvalidData, InvalidInput, UnexpectedEof};
    match error.kind() {
        UnexpectedEof => io::Error::new(UnexpectedEof, "the gzip data end early"),
        kind @ (InvalidData | InvalidInput) if error.raw_os_error().is_none() => {
            io::Error::new(kind, format!("the gzip data are damaged: {error}"))
        }
        _ => error,
    }
}
