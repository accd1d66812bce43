//! The bytes of a file, whose reading a flag ends.

use std::fs::File;
use std::io::{self, Cursor, Read};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::thread::Builder;

use crate::interruptible::SIGNAL_POLL;

const BLOCK: usize = 1 << 16;

/// Opens a file. `is_regular` tells that reads return soon, unlike those of a pipe.
pub(crate) fn open(
    path: PathBuf,
    is_regular: bool,
    cancel: Arc<AtomicBool>,
) -> io::Result<Box<dyn Read + Send>> {
    if is_regular {
        return Ok(Box::new(RegularFile { file: File::open(path)?, cancel }));
    }
    // Opening and reading wait for the other end. A thread that waits after a cancelled read ends with the process.
    lazygrid::check_thread_memory(1).map_err(io::Error::other)?;
    let (to, blocks) = sync_channel(1);
    Builder::new().name("lazygrid read".into()).spawn(move || {
        if let Err(refused) = File::open(path).and_then(|file| send_blocks(file, &to)) {
            let _ = to.send(Err(refused));
        }
    })?;
    Ok(Box::new(Pipe { blocks, block: Cursor::default(), cancel }))
}

fn check(cancel: &AtomicBool) -> io::Result<()> {
    match cancel.load(Ordering::Relaxed) {
        true => Err(io::Error::other("the caller cancelled the read")),
        false => Ok(()),
    }
}

struct RegularFile {
    file: File,
    cancel: Arc<AtomicBool>,
}

impl Read for RegularFile {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        check(&self.cancel)?;
        self.file.read(buffer)
    }
}

type Block = io::Result<Vec<u8>>;

/// Ends at the end of the file, or if the receiver is dropped.
fn send_blocks(mut file: File, to: &SyncSender<Block>) -> io::Result<()> {
    loop {
        let mut block = vec![0; BLOCK];
        match file.read(&mut block) {
            Ok(0) => return Ok(()),
            Ok(length) => block.truncate(length),
            Err(error) if error.kind() == io::ErrorKind::Interrupted => continue,
            Err(error) => return Err(error),
        }
        if to.send(Ok(block)).is_err() {
            return Ok(());
        }
    }
}

struct Pipe {
    blocks: Receiver<Block>,
    block: Cursor<Vec<u8>>,
    cancel: Arc<AtomicBool>,
}

impl Read for Pipe {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        while self.block.position() == self.block.get_ref().len() as u64 {
            check(&self.cancel)?;
            match self.blocks.recv_timeout(SIGNAL_POLL) {
                Ok(block) => self.block = Cursor::new(block?),
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => return Ok(0),
            }
        }
        self.block.read(buffer)
    }
}
