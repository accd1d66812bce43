use std::io::{self, BufWriter, PipeWriter, Read, Write};
use std::path::Path;
use std::thread::JoinHandle;

use flate2::write::GzEncoder;
use ruzstd::encoding::{CompressionLevel, FrameCompressor};

const BUFFER: usize = 1 << 20;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Compression {
    Gzip,
    Zstandard,
}

impl Compression {
    fn from_extension(path: &Path) -> Option<Self> {
        match path.extension()?.to_str()? {
            "gz" => Some(Self::Gzip),
            "zst" => Some(Self::Zstandard),
            _ => None,
        }
    }
}

pub(super) fn uncompressed(path: &Path) -> &Path {
    match (Compression::from_extension(path), path.file_stem()) {
        // Drops the directory, which callers do not use.
        (Some(_), Some(stem)) => Path::new(stem),
        _ => path,
    }
}

pub(super) trait Encoder: Write + Send {
    fn finish(self: Box<Self>) -> io::Result<()>;
}

pub(super) fn encoder(path: &Path, out: impl Write + Send + 'static) -> io::Result<Box<dyn Encoder>> {
    let out = buffered(out)?;
    Ok(match Compression::from_extension(path) {
        None => Box::new(out),
        Some(Compression::Gzip) => Box::new(GzEncoder::new(out, flate2::Compression::default())),
        Some(Compression::Zstandard) => Box::new(Zstandard::new(out)?),
    })
}

/// Fails if memory is refused, for which `BufWriter` would end the process. Requires as much again for small
/// allocations.
fn buffered<W: Write>(out: W) -> io::Result<BufWriter<W>> {
    Vec::<u8>::new().try_reserve_exact(2 * BUFFER)?;
    Ok(BufWriter::with_capacity(BUFFER, out))
}

impl<W: Write + Send> Encoder for BufWriter<W> {
    fn finish(mut self: Box<Self>) -> io::Result<()> {
        self.flush()
    }
}

impl<W: Write + Send> Encoder for GzEncoder<W> {
    fn finish(self: Box<Self>) -> io::Result<()> {
        (*self).finish()?.flush()
    }
}

/// One frame. A thread runs the compressor, which pulls its input from a pipe.
struct Zstandard {
    running: Option<(BufWriter<PipeWriter>, JoinHandle<io::Result<()>>)>,
}

impl Zstandard {
    fn new(out: impl Write + Send + 'static) -> io::Result<Self> {
        lazygrid::check_thread_memory(1).map_err(io::Error::other)?;
        let (source, into) = io::pipe()?;
        let into = buffered(into)?;
        let thread =
            std::thread::Builder::new().name("zstd".to_owned()).spawn(move || compress(source, out))?;
        Ok(Self { running: Some((into, thread)) })
    }

    /// Hides `BrokenPipe`, which callers take for an output that its reader has closed.
    fn piped<T>(&mut self, write: impl FnOnce(&mut BufWriter<PipeWriter>) -> io::Result<T>) -> io::Result<T> {
        let failed = || io::Error::other("the compressor has failed");
        let (into, _) = self.running.as_mut().ok_or_else(failed)?;
        write(into).map_err(|error| if error.kind() == io::ErrorKind::BrokenPipe { failed() } else { error })
    }
}

impl Write for Zstandard {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.piped(|into| into.write(bytes))
    }

    fn flush(&mut self) -> io::Result<()> {
        self.piped(BufWriter::flush)
    }
}

impl Encoder for Zstandard {
    fn finish(mut self: Box<Self>) -> io::Result<()> {
        let Some((mut into, thread)) = self.running.take() else { return Ok(()) };
        let flushed = into.flush();
        // Closes the pipe, which ends the compressor.
        drop(into);
        thread.join().unwrap_or_else(|_| Err(io::Error::other("the compressor has failed")))?;
        flushed
    }
}

/// Reports write errors at the end, because the compressor expects writing to succeed.
fn compress(source: impl Read, out: impl Write) -> io::Result<()> {
    struct DeferredErrors<W> {
        out: W,
        failed: io::Result<()>,
    }

    impl<W: Write> Write for DeferredErrors<W> {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            if self.failed.is_ok() {
                self.failed = self.out.write_all(bytes);
            }
            Ok(bytes.len())
        }

        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    let mut deferred = DeferredErrors { out, failed: Ok(()) };
    let mut compressor = FrameCompressor::new(CompressionLevel::Fastest);
    compressor.set_source(source);
    compressor.set_drain(&mut deferred);
    compressor.compress();
    drop(compressor);
    deferred.failed?;
    deferred.out.flush()
}

#[cfg(test)]
mod tests {
    use std::sync::{Arc, Mutex};

    use super::*;

    #[derive(Clone, Default)]
    struct SharedBuffer(Arc<Mutex<Vec<u8>>>);

    impl Write for SharedBuffer {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            self.0.lock().unwrap().write(bytes)
        }

        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    #[test]
    fn compressed_text_reads_back() {
        let rows: Vec<u8> = (0..200_000).flat_map(|k| format!("{},{}\n", k / 3, k).into_bytes()).collect();
        for name in ["a.csv", "a.csv.gz", "a.csv.zst"] {
            for bytes in [&rows[..], b"", b"x"] {
                let out = SharedBuffer::default();
                let mut encoder = encoder(Path::new(name), out.clone()).unwrap();
                bytes.chunks(100_003).for_each(|chunk| encoder.write_all(chunk).unwrap());
                encoder.finish().unwrap();
                let written = out.0.lock().unwrap().clone();
                let mut read = Vec::new();
                match name {
                    "a.csv.gz" => flate2::read::GzDecoder::new(&written[..]).read_to_end(&mut read).unwrap(),
                    "a.csv.zst" => ruzstd::decoding::StreamingDecoder::new(&written[..])
                        .unwrap()
                        .read_to_end(&mut read)
                        .unwrap(),
                    _ => (&written[..]).read_to_end(&mut read).unwrap(),
                };
                assert!(read == bytes, "{name}");
                assert!(bytes.len() < 100 || name == "a.csv" || written.len() < bytes.len() / 2, "{name}");
            }
        }
    }

    #[test]
    #[cfg(target_os = "linux")]
    fn a_full_disk_is_an_error_of_every_compression() {
        for name in ["a.csv", "a.csv.gz", "a.csv.zst"] {
            let full = std::fs::File::options().write(true).open("/dev/full").unwrap();
            let mut encoder = encoder(Path::new(name), full).unwrap();
            encoder.write_all(b"fits the buffer").unwrap();
            let error = encoder.finish().unwrap_err();
            assert_eq!(error.kind(), io::ErrorKind::StorageFull, "{name}");
        }
    }

    struct Broken;

    impl Write for Broken {
        fn write(&mut self, _: &[u8]) -> io::Result<usize> {
            panic!("on purpose")
        }

        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    #[test]
    fn a_compressor_that_ends_is_no_closed_output() {
        let mut encoder = encoder(Path::new("a.csv.zst"), Broken).unwrap();
        let noise: Vec<u8> = (0..1_u32 << 22).map(|k| (k.wrapping_mul(2_654_435_769) >> 24) as u8).collect();
        let error = (0..4).find_map(|_| encoder.write_all(&noise).err());
        assert_eq!(error.map(|error| error.kind()), Some(io::ErrorKind::Other));
        assert_eq!(encoder.finish().unwrap_err().kind(), io::ErrorKind::Other);
    }
}
