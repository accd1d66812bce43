use std::path::{Path, PathBuf};

use lazygrid::{Neighbors, Pair};

use super::text::Rows;
use super::{Draft, TableFormat, npy_header};
use crate::Error;

/// A table `i,j` of pairs, zero-based, written as they come.
#[derive(Debug)]
pub struct PairFile {
    draft: Draft,
    format: TableFormat,
}

impl PairFile {
    /// A table for so many `pairs`, which then have to be added.
    ///
    /// # Errors
    /// [`Error::Write`].
    pub fn create(path: &Path, format: TableFormat, pairs: u64) -> Result<Self, Error> {
        let mut draft = Draft::create(path)?;
        draft.put(|out| match format {
            TableFormat::Csv => out.write_all(b"i,j\n"),
            TableFormat::Npy => out.write_all(&npy_header("u4", &format!("({pairs}, 2)"))),
        })?;
        Ok(Self { draft, format })
    }

    /// Adds rows.
    ///
    /// # Errors
    /// [`Error::Write`].
    pub fn add(&mut self, pairs: &[Pair]) -> Result<(), Error> {
        self.draft.put(|out| match self.format {
            TableFormat::Npy => out.write_all(bytemuck::cast_slice(pairs)),
            TableFormat::Csv => {
                let mut rows = Rows::new(out);
                pairs.iter().try_for_each(|pair| rows.row([pair.i, pair.j], b','))?;
                rows.flush()
            }
        })
    }

    /// The complete file, not published yet.
    pub fn finish(self) -> Draft {
        self.draft
    }
}

/// The files that [`PairFile`], or [`neighbors`], write for this name.
pub fn files_of(path: &Path, format: TableFormat, neighbors: bool) -> Vec<PathBuf> {
    match (neighbors, format) {
        (true, TableFormat::Npy) => ["offsets.npy", "indices.npy"].map(|end| path.with_extension(end)).into(),
        _ => vec![path.to_owned()],
    }
}

/// Writes neighbour lists, not published yet.
///
/// As CSV one table `i,j` in which every pair stands twice, by `i`, then `j`. As NumPy two files, for `near.npy`
/// `near.offsets.npy`, `n + 1` numbers of type `u8` (64 bits), and `near.indices.npy` of type `u4`; the neighbours
/// of sphere `k` are `indices[offsets[k]:offsets[k + 1]]`.
///
/// # Errors
/// [`Error::Write`].
pub fn neighbors(path: &Path, format: TableFormat, lists: Neighbors<'_>) -> Result<Vec<Draft>, Error> {
    match format {
        TableFormat::Csv => Ok(vec![table(path, lists)?]),
        TableFormat::Npy => {
            let files = files_of(path, format, true);
            let offsets = array(&files[0], "u8", lists.offsets)?;
            let indices = array(&files[1], "u4", lists.indices)?;
            Ok(vec![offsets, indices])
        }
    }
}

fn table(path: &Path, lists: Neighbors<'_>) -> Result<Draft, Error> {
    let mut draft = Draft::create(path)?;
    draft.put(|out| {
        out.write_all(b"i,j\n")?;
        let mut rows = Rows::new(out);
        for i in 0..lists.len() {
            lists.of(i).iter().try_for_each(|&j| rows.row([i as u32, j], b','))?;
        }
        rows.flush()
    })?;
    Ok(draft)
}

fn array<T: bytemuck::Pod>(path: &Path, kind: &str, values: &[T]) -> Result<Draft, Error> {
    let mut draft = Draft::create(path)?;
    draft.put(|out| {
        out.write_all(&npy_header(kind, &format!("({},)", values.len())))?;
        out.write_all(bytemuck::cast_slice(values))
    })?;
    Ok(draft)
}
