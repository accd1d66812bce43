use std::path::{Path, PathBuf};

use bytemuck::Pod;
use lazygrid::{Neighbors, Pair};
use lexical_core::ToLexical;

use super::atomic_file::STDOUT;
use super::encoder::uncompressed;
use super::text::Rows;
use super::{AtomicFile, TableFormat, npy_header};
use crate::Error;

/// The output of pairs or neighbors.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Output {
    /// File, compressed for `.gz` or `.zst`; `None` for standard output.
    pub path: Option<PathBuf>,
    /// Format.
    pub format: TableFormat,
}

impl Output {
    /// Returns the files to write.
    pub fn files(&self, neighbors: bool, ids: bool) -> Vec<PathBuf> {
        match &self.path {
            None => Vec::new(),
            Some(path) if neighbors && self.format == TableFormat::Npy => {
                let names = ["offsets", "indices"].into_iter().chain(ids.then_some("ids"));
                names.map(|name| sibling(path, name)).collect()
            }
            Some(path) => vec![path.clone()],
        }
    }

    /// Returns its name in messages.
    pub fn name(&self) -> &Path {
        self.path.as_deref().unwrap_or(Path::new(STDOUT))
    }

    fn file(&self) -> Result<AtomicFile, Error> {
        self.path.as_ref().map_or_else(AtomicFile::stdout, AtomicFile::create)
    }
}

fn sibling(path: &Path, name: &str) -> PathBuf {
    let plain = path.with_file_name(uncompressed(path).file_name().unwrap_or_default());
    let mut name = plain.with_extension(name).into_os_string();
    name.push(".npy");
    if plain != path {
        name.push(".");
        name.push(path.extension().unwrap_or_default());
    }
    name.into()
}

/// A table `i,j` of zero-based pairs, or `id_i,id_j` of ids.
#[derive(Debug)]
pub struct PairFile<'a> {
    file: AtomicFile,
    format: TableFormat,
    ids: Option<&'a [i64]>,
    /// Promised and written rows.
    rows: [u64; 2],
}

impl<'a> PairFile<'a> {
    /// Creates a table for `pairs` pairs, with `ids` of spheres if given.
    ///
    /// # Errors
    /// [`Error::Write`].
    pub fn create(output: &Output, pairs: u64, ids: Option<&'a [i64]>) -> Result<Self, Error> {
        let mut file = output.file()?;
        file.write_with(|out| match output.format {
            TableFormat::Csv => out.write_all(header_line(ids.is_some())),
            TableFormat::Npy => {
                let kind = if ids.is_some() { "i8" } else { "u4" };
                out.write_all(&npy_header(kind, &format!("({pairs}, 2)")))
            }
        })?;
        Ok(Self { file, format: output.format, ids, rows: [pairs, 0] })
    }

    /// Adds rows.
    ///
    /// # Errors
    /// [`Error::Write`].
    pub fn add(&mut self, pairs: &[Pair]) -> Result<(), Error> {
        self.rows[1] += pairs.len() as u64;
        match self.ids {
            None => {
                let rows: &[[u32; 2]] = bytemuck::cast_slice(pairs);
                add(&mut self.file, self.format, rows)
            }
            Some(ids) => pairs.chunks(1 << 16).try_for_each(|pairs| {
                let ids_of_pair = |pair: &Pair| [ids[pair.i as usize], ids[pair.j as usize]];
                let rows: Vec<[i64; 2]> = pairs.iter().map(ids_of_pair).collect();
                add(&mut self.file, self.format, &rows)
            }),
        }
    }

    /// Returns the complete, uncommitted file.
    ///
    /// # Errors
    /// [`Error::RowCount`] if the header of an array has another number of rows.
    pub fn finish(self) -> Result<AtomicFile, Error> {
        match (self.format, self.rows) {
            (TableFormat::Npy, [expected, found]) if expected != found => {
                Err(Error::RowCount { path: self.file.path().to_owned(), expected, found })
            }
            _ => Ok(self.file),
        }
    }
}

fn add<T: Pod + ToLexical>(
    file: &mut AtomicFile,
    format: TableFormat,
    pairs: &[[T; 2]],
) -> Result<(), Error> {
    file.write_with(|out| match format {
        TableFormat::Npy => out.write_all(bytemuck::cast_slice(pairs)),
        TableFormat::Csv => {
            let mut rows = Rows::new(out);
            pairs.iter().try_for_each(|&pair| rows.row(pair, b','))?;
            rows.flush()
        }
    })
}

fn header_line(ids: bool) -> &'static [u8] {
    if ids { b"id_i,id_j\n" } else { b"i,j\n" }
}

/// Writes neighbor lists into uncommitted files.
///
/// CSV: a table `i,j` or `id_i,id_j` with every pair twice, sorted. NumPy: for `near.npy`, compressed sparse
/// rows in `near.offsets.npy` (`u8`) and `near.indices.npy` (`u4`), with ids also `near.ids.npy`
/// (`i8`), which cannot go to standard output.
///
/// # Errors
/// [`Error::Write`].
pub fn neighbors(
    output: &Output,
    lists: Neighbors<'_>,
    ids: Option<&[i64]>,
) -> Result<Vec<AtomicFile>, Error> {
    let files = output.files(true, ids.is_some());
    match (files.as_slice(), output.format, ids) {
        ([offsets, indices], TableFormat::Npy, _) => {
            Ok(vec![array(offsets, "u8", lists.offsets())?, array(indices, "u4", lists.indices())?])
        }
        ([offsets, indices, names], TableFormat::Npy, Some(ids)) => Ok(vec![
            array(offsets, "u8", lists.offsets())?,
            array(indices, "u4", lists.indices())?,
            array(names, "i8", ids)?,
        ]),
        _ => Ok(vec![table(output, lists, ids)?]),
    }
}

fn table(output: &Output, lists: Neighbors<'_>, ids: Option<&[i64]>) -> Result<AtomicFile, Error> {
    let mut file = output.file()?;
    file.write_with(|out| {
        out.write_all(header_line(ids.is_some()))?;
        let mut rows = Rows::new(out);
        for i in 0..lists.len() {
            let neighbors = lists.neighbors_of(i).iter();
            match ids {
                None => neighbors.copied().try_for_each(|j| rows.row([i as u32, j], b','))?,
                Some(ids) => {
                    neighbors.copied().try_for_each(|j| rows.row([ids[i], ids[j as usize]], b','))?
                }
            }
        }
        rows.flush()
    })?;
    Ok(file)
}

fn array<T: Pod>(path: &Path, kind: &str, values: &[T]) -> Result<AtomicFile, Error> {
    let mut file = AtomicFile::create(path)?;
    file.write_with(|out| {
        out.write_all(&npy_header(kind, &format!("({},)", values.len())))?;
        out.write_all(bytemuck::cast_slice(values))
    })?;
    Ok(file)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn array_with_other_rows_than_its_header_is_refused() {
        let directory = tempfile::tempdir().unwrap();
        let finished = |format, pairs: u64| {
            let output = Output { path: Some(directory.path().join("pairs")), format };
            let mut file = PairFile::create(&output, pairs, None).unwrap();
            file.add(&[Pair { i: 0, j: 1 }]).unwrap();
            file.add(&[Pair { i: 1, j: 2 }]).unwrap();
            file.finish().map(drop).map_err(|error| error.to_string())
        };
        assert_eq!(finished(TableFormat::Npy, 2), Ok(()));
        assert_eq!(finished(TableFormat::Csv, 3), Ok(()));
        let refused = finished(TableFormat::Npy, 3).unwrap_err();
        assert!(refused.contains("pairs: the header promises 3 pairs, but the search found 2"), "{refused}");
    }

    #[test]
    fn neighbors_are_several_files() {
        let files = |name: &str, format, neighbors, ids| {
            let output = Output { path: Some(name.into()), format };
            let files = output.files(neighbors, ids);
            files.iter().map(|file| file.to_str().unwrap().to_owned()).collect::<Vec<_>>().join(" ")
        };
        use TableFormat::{Csv, Npy};
        assert_eq!(files("a/near.npy", Npy, true, false), "a/near.offsets.npy a/near.indices.npy");
        assert_eq!(
            files("a.b/near.npy.gz", Npy, true, true),
            "a.b/near.offsets.npy.gz a.b/near.indices.npy.gz a.b/near.ids.npy.gz"
        );
        assert_eq!(files("near.npy", Npy, false, true), "near.npy");
        assert_eq!(files("near.csv.zst", Csv, true, true), "near.csv.zst");
    }
}
