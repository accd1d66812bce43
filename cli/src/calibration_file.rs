//! The measurements of `lazygrid calibrate`: `$XDG_CACHE_HOME/lazygrid/calibration.json` on Linux.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use lazygrid::gpu::{Calibration, Crossover, SkinCosts};
use lazygrid_io::write::AtomicFile;
use serde::{Deserialize, Serialize};

use crate::error::CliError;

#[derive(Default, Serialize, Deserialize)]
struct CalibrationFile {
    calibrations: Vec<Entry>,
}

#[derive(Serialize, Deserialize)]
struct Entry {
    adapter: String,
    driver: String,
    lazygrid: String,
    naive_below: u32,
    per_class: u32,
    /// Other versions may omit this or a later field.
    #[serde(default)]
    radix_sort_from: Option<u32>,
    #[serde(default)]
    skin: Option<Skin>,
    #[serde(default)]
    device_from: Option<u32>,
    #[serde(default)]
    tests_per_second: Option<f64>,
}

#[derive(Clone, Copy, Serialize, Deserialize)]
struct Skin {
    search_ns: f32,
    find_ns: f32,
    keep_ns: f32,
    measure_ns: f32,
    test_ns: f32,
    call_ns: f32,
}

/// Ignores an invalid file with a warning.
pub(crate) fn load() -> Vec<Calibration> {
    let Some(path) = path() else { return Vec::new() };
    match read(&path).and_then(checked) {
        Ok(file) => file.calibrations.into_iter().filter_map(Entry::calibration).collect(),
        Err(error) => {
            log::warn!(
                "{}: {error}; the file is ignored; rewrite it with `lazygrid calibrate`",
                path.display()
            );
            Vec::new()
        }
    }
}

pub(crate) fn check_writable() -> Result<(), CliError> {
    create_file().map(drop)
}

pub(crate) fn store(measured: &Calibration) -> Result<PathBuf, CliError> {
    let (path, mut file) = create_file()?;
    let mut all = load();
    all.retain(|known| known.adapter != measured.adapter);
    all.push(measured.clone());
    let stored = CalibrationFile { calibrations: all.into_iter().map(Entry::from).collect() };
    file.write_with(|out| {
        serde_json::to_writer_pretty(&mut *out, &stored)?;
        out.write_all(b"\n")
    })?;
    file.commit()?;
    Ok(path)
}

fn create_file() -> Result<(PathBuf, AtomicFile), CliError> {
    let path = path().ok_or(CliError::NoCacheDirectory)?;
    if let Some(directory) = path.parent() {
        let failed = |source| lazygrid_io::Error::Write { path: path.clone(), source };
        fs::create_dir_all(directory).map_err(failed)?;
    }
    let file = AtomicFile::create(&path)?;
    Ok((path, file))
}

fn path() -> Option<PathBuf> {
    Some(dirs::cache_dir()?.join("lazygrid").join("calibration.json"))
}

fn read(path: &Path) -> io::Result<CalibrationFile> {
    match fs::read(path) {
        Ok(bytes) => serde_json::from_slice(&bytes).map_err(io::Error::from),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(CalibrationFile::default()),
        Err(error) => Err(error),
    }
}

/// A device with a rate far from these would run each workgroup by itself, or a call in one dispatch.
const TESTS_PER_SECOND: std::ops::RangeInclusive<f64> = 1e6..=1e14;

/// Refuses values that would test all pairs of millions of spheres.
fn checked(file: CalibrationFile) -> io::Result<CalibrationFile> {
    let most = Crossover::MAX;
    for entry in &file.calibrations {
        let Entry { adapter, naive_below, per_class, skin, tests_per_second, .. } = entry;
        if tests_per_second.is_some_and(|rate| !TESTS_PER_SECOND.contains(&rate)) {
            let [least, most] = [TESTS_PER_SECOND.start(), TESTS_PER_SECOND.end()];
            return Err(io::Error::other(format!(
                "the tests per second of {adapter} must be from {least:e} to {most:e}"
            )));
        }
        if *naive_below.max(per_class) > most {
            return Err(io::Error::other(format!(
                "naive_below {naive_below} and per_class {per_class} of {adapter} cannot have been measured, at most {most}"
            )));
        }
        if skin.is_some_and(|skin| !SkinCosts::from(skin).is_valid()) {
            return Err(io::Error::other(format!(
                "the costs of a skin of {adapter} cannot have been measured: they are not negative, and a search costs something"
            )));
        }
    }
    Ok(file)
}

impl Entry {
    fn calibration(self) -> Option<Calibration> {
        let Self { adapter, driver, lazygrid: version, naive_below, per_class, .. } = self;
        let crossover = Crossover::new(naive_below, per_class);
        let (radix_sort_from, skin, device_from) =
            (self.radix_sort_from?, self.skin?.into(), self.device_from?);
        let names = [adapter, driver, version];
        let calibration = Calibration::new(names, crossover, radix_sort_from, skin, device_from);
        Some(calibration.with_tests_per_second(self.tests_per_second?))
    }
}

impl From<Calibration> for Entry {
    fn from(measured: Calibration) -> Self {
        let Calibration { adapter, driver, version: lazygrid, crossover, skin, .. } = measured;
        let Crossover { naive_below, per_class, .. } = crossover;
        let skin = Some(Skin::from(skin));
        let [radix_sort_from, device_from] = [measured.radix_sort_from, measured.device_from].map(Some);
        let tests_per_second = Some(measured.tests_per_second);
        Self {
            adapter,
            driver,
            lazygrid,
            naive_below,
            per_class,
            radix_sort_from,
            skin,
            device_from,
            tests_per_second,
        }
    }
}

impl From<SkinCosts> for Skin {
    fn from(costs: SkinCosts) -> Self {
        let SkinCosts { search_ns, find_ns, keep_ns, measure_ns, test_ns, call_ns, .. } = costs;
        Self { search_ns, find_ns, keep_ns, measure_ns, test_ns, call_ns }
    }
}

impl From<Skin> for SkinCosts {
    fn from(skin: Skin) -> Self {
        let Skin { search_ns, find_ns, keep_ns, measure_ns, test_ns, call_ns } = skin;
        Self { search_ns, levels_ns: 0.0, find_ns, keep_ns, measure_ns, test_ns, call_ns }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn impossible_measurements_are_refused() {
        let costs =
            Skin { search_ns: 1.0, find_ns: 0.0, keep_ns: 0.0, measure_ns: 0.0, test_ns: 0.0, call_ns: 0.0 };
        for (naive_below, per_class, skin, tests_per_second, good) in [
            (0, 0, Some(costs), 1e9, true),
            (0, 0, None, 1e9, true),
            (Crossover::MAX, Crossover::MAX, Some(costs), 1e9, true),
            (Crossover::MAX + 1, 0, Some(costs), 1e9, false),
            (4_000_000_000, 0, None, 1e9, false),
            (100, u32::MAX, Some(costs), 1e9, false),
            (100, 0, Some(Skin { search_ns: 0.0, ..costs }), 1e9, false),
            (100, 0, Some(Skin { test_ns: -1.0, ..costs }), 1e9, false),
            (100, 0, Some(costs), 1e300, false),
            (100, 0, Some(costs), 1.0, false),
        ] {
            let [adapter, driver, lazygrid] = [(); 3].map(|()| String::new());
            let radix_sort_from = Some(1 << 19);
            let device_from = Some(4096);
            let entry = Entry {
                adapter,
                driver,
                lazygrid,
                naive_below,
                per_class,
                radix_sort_from,
                skin,
                device_from,
                tests_per_second: Some(tests_per_second),
            };
            let has_skin = entry.skin.is_some();
            let file = checked(CalibrationFile { calibrations: vec![entry] });
            assert_eq!(file.is_ok(), good, "{naive_below}, {per_class}, {has_skin}, {tests_per_second}");
            let mut read = file.into_iter().flat_map(|file| file.calibrations).filter_map(Entry::calibration);
            assert_eq!(read.next().is_some(), good && has_skin, "of an earlier version");
        }
    }
}
