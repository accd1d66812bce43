use std::path::{Path, PathBuf};

use lazygrid_io::write::{AtomicFile, CompleteFile, TableFormat, npy_header};
use lazygrid_mpi::{Distributed, Error, agree};
use mpi::topology::SimpleCommunicator;
use mpi::traits::Communicator;

use super::args::Detect;
use super::{input, manifest, refused};

#[derive(Debug)]
pub(crate) struct Target {
    path: PathBuf,
    format: TableFormat,
    gather: bool,
}

impl Target {
    pub(crate) fn from_args(world: &SimpleCommunicator, args: &Detect) -> Result<Option<Self>, String> {
        let Some(path) = &args.output else { return Ok(None) };
        let Some(format) = TableFormat::from_extension(path) else {
            return Err(format!(
                "{}: unknown output format; name it .csv or .npy, optionally followed by .gz or .zst",
                path.display()
            ));
        };
        let target = Self { path: path.clone(), format, gather: args.gather };
        // Each rank compares only the file that it reads.
        let input = input::rank_input(args, world.rank()).unwrap_or_else(|| args.file.clone());
        target.refuse_input(&input, world.size() as u32).map(|()| Some(target))
    }

    fn refuse_input(&self, input: &Path, ranks: u32) -> Result<(), String> {
        let Ok(read) = input.canonicalize() else { return Ok(()) };
        let files = std::iter::once(self.path.clone()).chain(self.files(ranks));
        let same = |file: &PathBuf| file.canonicalize().is_ok_and(|file| file == read);
        files.into_iter().find(same).map_or(Ok(()), |file| {
            let (input, file) = (input.display(), file.display());
            Err(format!("{input}: the output {file} is this input; choose another --output"))
        })
    }

    fn files(&self, ranks: u32) -> Vec<PathBuf> {
        match self.gather {
            true => vec![self.path.clone()],
            false => {
                let of_ranks = (0..ranks).map(|rank| self.rank_file(rank));
                std::iter::once(self.manifest()).chain(of_ranks).collect()
            }
        }
    }

    /// `pairs.3.npy.gz` for rank 3 of `pairs.npy.gz`.
    pub(crate) fn rank_file(&self, rank: u32) -> PathBuf {
        self.renamed(|stem, ending| format!("{stem}.{rank}{ending}"))
    }

    pub(crate) fn manifest(&self) -> PathBuf {
        self.renamed(|stem, _| format!("{stem}.manifest.json"))
    }

    fn renamed(&self, name: impl Fn(&str, &str) -> String) -> PathBuf {
        let file = self.path.file_name().unwrap_or_default().to_string_lossy();
        let dot = [".csv", ".npy"].iter().filter_map(|ending| file.rfind(ending)).max().unwrap_or(file.len());
        self.path.with_file_name(name(&file[..dot], &file[dot..]))
    }

    pub(crate) fn format(&self) -> TableFormat {
        self.format
    }
}

/// Returns the files of all ranks. Collective.
pub(crate) fn write(
    world: &SimpleCommunicator,
    distributed: &mut Distributed,
    target: &Target,
    pairs: Vec<[u64; 2]>,
) -> Result<Vec<PathBuf>, Error> {
    let rank = world.rank() as u32;
    let wide = distributed.report().owned.total > u64::from(u32::MAX);
    let failed = |error: lazygrid_io::Error| refused(world, error.to_string());
    if target.gather {
        let mut all = distributed.gather(&pairs)?;
        all.sort_unstable();
        let written = match rank {
            0 => table(&target.path, target, &all, wide).and_then(AtomicFile::commit).map_err(failed),
            _ => Ok(()),
        };
        return agree(world, written).map(|()| vec![target.path.clone()]);
    }
    let file = table(&target.rank_file(rank), target, &pairs, wide).and_then(AtomicFile::finish);
    let file = agree(world, file.map_err(failed))?;
    let counts = distributed.gather(&[pairs.len() as u64])?;
    let manifest = (rank == 0)
        .then(|| manifest::write(target, &counts, distributed.report().owned.total, wide))
        .transpose();
    let manifest = agree(world, manifest.map_err(failed))?;
    // The manifest, committed last, names complete files.
    agree(world, file.commit().map_err(failed))?;
    agree(world, manifest.map_or(Ok(()), CompleteFile::commit).map_err(failed))?;
    Ok(target.files(world.size() as u32))
}

fn table(
    path: &Path,
    target: &Target,
    pairs: &[[u64; 2]],
    wide: bool,
) -> Result<AtomicFile, lazygrid_io::Error> {
    let mut file = AtomicFile::create(path)?;
    let header = match target.format {
        TableFormat::Csv => b"i,j\n".to_vec(),
        TableFormat::Npy => npy_header(if wide { "u8" } else { "u4" }, &format!("({}, 2)", pairs.len())),
    };
    file.write_with(|out| {
        out.write_all(&header)?;
        let mut each = pairs.iter();
        match (target.format, wide) {
            (TableFormat::Csv, _) => each.try_for_each(|[i, j]| writeln!(out, "{i},{j}")),
            (TableFormat::Npy, true) => out.write_all(bytemuck::cast_slice(pairs)),
            (TableFormat::Npy, false) => {
                each.try_for_each(|pair| out.write_all(bytemuck::bytes_of(&pair.map(|id| id as u32))))
            }
        }
    })?;
    Ok(file)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_rank_has_a_file() {
        let names = |path: &str| {
            let target = Target { path: path.into(), format: TableFormat::Npy, gather: false };
            [target.rank_file(3), target.manifest()].map(|path| path.to_str().unwrap().to_owned())
        };
        assert_eq!(names("pairs.npy"), ["pairs.3.npy", "pairs.manifest.json"]);
        assert_eq!(names("a.csv/pairs.b.csv.gz"), ["a.csv/pairs.b.3.csv.gz", "a.csv/pairs.b.manifest.json"]);
    }
}
