use std::io::Write;
use std::path::Path;

use lazygrid::{Neighbors, Pair};

use super::text::Rows;
use super::{Draft, TableFormat, npy_header};
use crate::Error;

/// A table `i,j` of pairs, zero-based, written as they come.
#[derive(Debug)]
pub struct PairFile {
    draft: Draft,
    format: TableFormat,
    rows: u64,
}

impl PairFile {
    /// A table without rows.
    ///
    /// # Errors
    /// [`Error::Write`].
    pub fn create(path: &Path, format: TableFormat) -> Result<Self, Error> {
        let mut draft = Draft::create(path)?;
        draft.put(|out| match format {
            TableFormat::Csv => out.write_all(b"i,j\n"),
            TableFormat::Npy => out.write_all(&npy_header("u4", "(0, 2)")),
        })?;
        Ok(Self { draft, format, rows: 0 })
    }

    /// Adds rows.
    ///
    /// # Errors
    /// [`Error::Write`].
    pub fn add(&mut self, pairs: &[Pair]) -> Result<(), Error> {
        self.rows += pairs.len() as u64;
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
    ///
    /// # Errors
    /// [`Error::Write`].
    pub fn finish(mut self) -> Result<Draft, Error> {
        if self.format == TableFormat::Npy {
            self.draft.put_at_start(&npy_header("u4", &format!("({}, 2)", self.rows)))?;
        }
        Ok(self.draft)
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
            let offsets = array(&path.with_extension("offsets.npy"), "u8", lists.offsets)?;
            let indices = array(&path.with_extension("indices.npy"), "u4", lists.indices)?;
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
