//! What `lazygrid calibrate` measured, kept for later runs: one JSON file in the user's cache directory
//! (`$XDG_CACHE_HOME/lazygrid/calibration.json` on Linux).

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use lazygrid::gpu::{Calibration, Crossover};
use lazygrid_io::write::Draft;
use serde::{Deserialize, Serialize};

use crate::failure::Failure;

/// The file.
#[derive(Default, Serialize, Deserialize)]
struct Kept {
    calibrations: Vec<Entry>,
}

#[derive(Serialize, Deserialize)]
struct Entry {
    adapter: String,
    driver: String,
    lazygrid: String,
    naive_below: u32,
    per_class: u32,
}

/// What was kept. A file that cannot be read or makes no sense is worth a warning, and otherwise as good as none.
pub(crate) fn load() -> Vec<Calibration> {
    let Some(path) = path() else { return Vec::new() };
    match read(&path).and_then(checked) {
        Ok(kept) => kept.calibrations.into_iter().map(Calibration::from).collect(),
        Err(error) => {
            log::warn!(
                "{}: {error}; nothing of it is used; `lazygrid calibrate` writes it anew",
                path.display()
            );
            Vec::new()
        }
    }
}

/// Keeps a calibration in place of an earlier one of the same adapter, and says where.
pub(crate) fn keep(measured: &Calibration) -> Result<PathBuf, Failure> {
    let path = path().ok_or(Failure::NoCacheDirectory)?;
    if let Some(directory) = path.parent() {
        let failed = |source| lazygrid_io::Error::Write { path: path.clone(), source };
        fs::create_dir_all(directory).map_err(failed)?;
    }
    let mut all = load();
    all.retain(|known| known.adapter != measured.adapter);
    all.push(measured.clone());
    let kept = Kept { calibrations: all.into_iter().map(Entry::from).collect() };
    let mut draft = Draft::create(&path)?;
    draft.put(|out| {
        serde_json::to_writer_pretty(&mut *out, &kept)?;
        out.write_all(b"\n")
    })?;
    draft.publish()?;
    Ok(path)
}

fn path() -> Option<PathBuf> {
    Some(dirs::cache_dir()?.join("lazygrid").join("calibration.json"))
}

fn read(path: &Path) -> io::Result<Kept> {
    match fs::read(path) {
        Ok(bytes) => serde_json::from_slice(&bytes).map_err(io::Error::from),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(Kept::default()),
        Err(error) => Err(error),
    }
}

/// Refuses what no calibration can have measured: with it, all pairs of millions of spheres would be tested.
fn checked(kept: Kept) -> io::Result<Kept> {
    let most = Crossover::MOST;
    match kept.calibrations.iter().find(|entry| entry.naive_below.max(entry.per_class) > most) {
        None => Ok(kept),
        Some(Entry { adapter, naive_below, per_class, .. }) => Err(io::Error::other(format!(
            "naive_below {naive_below} and per_class {per_class} of {adapter} cannot have been measured, at most {most}"
        ))),
    }
}

impl From<Entry> for Calibration {
    fn from(entry: Entry) -> Self {
        let Entry { adapter, driver, lazygrid: version, naive_below, per_class } = entry;
        Self { adapter, driver, version, crossover: Crossover { naive_below, per_class } }
    }
}

impl From<Calibration> for Entry {
    fn from(measured: Calibration) -> Self {
        let Calibration { adapter, driver, version: lazygrid, crossover } = measured;
        let Crossover { naive_below, per_class } = crossover;
        Self { adapter, driver, lazygrid, naive_below, per_class }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_cannot_have_been_measured_is_refused() {
        for (naive_below, per_class, good) in [
            (0, 0, true),
            (Crossover::MOST, Crossover::MOST, true),
            (Crossover::MOST + 1, 0, false),
            (4_000_000_000, 0, false),
            (100, u32::MAX, false),
        ] {
            let [adapter, driver, lazygrid] = [(); 3].map(|()| String::new());
            let kept =
                Kept { calibrations: vec![Entry { adapter, driver, lazygrid, naive_below, per_class }] };
            assert_eq!(checked(kept).is_ok(), good, "{naive_below}, {per_class}");
        }
    }
}
