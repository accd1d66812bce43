//! A run on disk, to go on from.

use std::io::Write;
use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::{Error, State, output};

/// Everything that is needed to continue a run bit for bit.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Checkpoint {
    /// The scenario as it was read; another one cannot go on from here.
    pub scenario: String,
    /// The seed.
    pub seed: u64,
    /// The name of the back end that computed it.
    pub backend: String,
    /// Steps between rows, between frames, and between those of the animation, 0 where there is none.
    pub every: [u32; 3],
    /// The length of each file that the run appends to.
    pub lengths: Vec<u64>,
    /// Where the run stands.
    pub state: State,
}

/// The file's first bytes: what it is, and the version of its layout.
const MAGIC: &[u8] = b"lazygrid checkpoint 4\n";

impl Checkpoint {
    /// Writes a checkpoint in place of the one before, which is untouched until this one is complete.
    ///
    /// # Errors
    /// [`Error::Write`].
    pub fn write(&self, path: &Path) -> Result<(), Error> {
        output::replace(path, |out| {
            let bytes = postcard::to_extend(self, MAGIC.to_vec()).map_err(std::io::Error::other)?;
            out.write_all(&bytes)
        })
    }

    /// Reads a checkpoint.
    ///
    /// # Errors
    /// [`Error::Read`]; [`Error::Checkpoint`] for a file that is not a whole checkpoint of this version.
    pub fn read(path: &Path) -> Result<Self, Error> {
        let bytes = std::fs::read(path).map_err(|source| Error::Read { path: path.to_owned(), source })?;
        let refused = |message: String| Error::Checkpoint { path: path.to_owned(), message };
        let Some(body) = bytes.strip_prefix(MAGIC) else {
            return Err(refused("this is no checkpoint of this version; start the run anew".to_owned()));
        };
        let (checkpoint, rest) = postcard::take_from_bytes::<Self>(body)
            .map_err(|error| refused(format!("the checkpoint is damaged ({error}); start the run anew")))?;
        if !rest.is_empty() || !checkpoint.is_whole() {
            return Err(refused("the checkpoint is damaged; start the run anew".to_owned()));
        }
        Ok(checkpoint)
    }

    /// Whether all columns are of one length.
    fn is_whole(&self) -> bool {
        let particles = &self.state.particles;
        let n = particles.len();
        let velocities = particles.velocity.each_ref().map(Vec::len);
        particles.position.iter().all(|column| column.len() == n)
            && (velocities == [n; 3] || velocities == [0; 3])
            && particles.radius.len() == n
            && particles.species.len() == n
    }
}
