//! The report of a run. Its page contains the plots and, in its last line, the checksums of the tables. It thus
//! identifies the other files.

use std::fs::{self, File};
use std::io::{self, BufRead, BufReader, BufWriter, Write};
use std::path::Path;

use super::directory::{is_file, is_regular, refuse_file, refuse_page, remove_file, remove_where};
use super::write_atomically;
use super::{Draft, PLOTS};
use crate::Error;
use crate::checksum::{Digest, DigestWriter};

pub(super) const REPORT: &str = "report.html";
pub(crate) const TABLES: [&str; 4] =
    ["impulse-response.csv", "interference.csv", "bit-errors.csv", "by-symbol.csv"];

/// Begins the last line of each page.
const MARK: &str = "<!-- tables of lazygrid simulate:";

pub type TableWriter<'a> = Box<dyn Fn(&mut dyn Write) -> io::Result<()> + 'a>;

/// The files of a report, for [`write_report`].
pub struct Report<'a> {
    /// The content of `report.html`.
    pub page: &'a str,
    /// Name and content of each plot, for `plots`.
    pub plots: Vec<(&'a str, &'a str)>,
    /// Name and content of each table: `impulse-response.csv`, `interference.csv`, `bit-errors.csv`, `by-symbol.csv`.
    pub tables: Vec<(&'a str, TableWriter<'a>)>,
}

/// Writes the files of a report in place of the former ones.
///
/// # Errors
/// [`Error::Write`], also for a page, plot or table of others, unless `overwrite`.
pub fn write_report(directory: &Path, report: &Report<'_>, overwrite: bool) -> Result<(), Error> {
    let former = match overwrite {
        true => former_report(directory),
        false => refuse_foreign_page(directory)?,
    };
    let (page, tables) = draft_tables(directory, report)?;
    if !overwrite {
        let plots = report.plots.iter().map(|(plot, _)| *plot);
        refuse_others(directory, plots, report.tables.iter().map(|(name, _)| *name), [&former, &page])?;
    }
    remove_plots_and_tables(directory, &former)?;
    // The page first: it identifies the other files.
    write_atomically(&directory.join(REPORT), |out| out.write_all(page.as_bytes()))?;
    tables.into_iter().try_for_each(Draft::publish)?;
    let folder = directory.join(PLOTS);
    fs::create_dir_all(&folder).map_err(|source| Error::Write { path: folder, source })?;
    report.plots.iter().try_for_each(|(plot, svg)| {
        write_atomically(&directory.join(plot_name(plot)), |out| out.write_all(svg.as_bytes()))
    })
}

fn plot_name(plot: &str) -> String {
    format!("{PLOTS}/{plot}.svg")
}

/// Returns the page with the checksums of the tables, which stay unpublished: before the page, they would count as
/// files of others.
fn draft_tables(directory: &Path, report: &Report<'_>) -> Result<(String, Vec<Draft>), Error> {
    let mut page = format!("{}\n{MARK}", report.page.trim_end());
    let mut drafts = Vec::new();
    for (name, write) in &report.tables {
        drafts.push(Draft::write(&directory.join(name), |out| {
            let mut out = BufWriter::new(DigestWriter::new(out, Digest::new()));
            write(&mut out)?;
            out.flush()?;
            page += &entry(name, out.get_ref().digest());
            Ok(())
        })?);
    }
    Ok((page + " -->\n", drafts))
}

fn entry(name: &str, digest: &Digest) -> String {
    format!(" {name} {} {:016x};", digest.length(), digest.checksum())
}

/// Returns the page of the report, empty without one. Refuses a page that no report wrote.
pub(crate) fn refuse_foreign_page(directory: &Path) -> Result<String, Error> {
    let former = former_report(directory);
    if former.is_empty() {
        refuse_page(directory, REPORT)?;
    }
    Ok(former)
}

/// Refuses plots and tables that the `former` page does not have and the next report may replace.
pub(crate) fn refuse_foreign_files(
    directory: &Path,
    former: &str,
    plots: &[&str],
    tables: &[&str],
) -> Result<(), Error> {
    refuse_others(directory, plots.iter().copied(), tables.iter().copied(), [former, ""])
}

fn refuse_others<'a>(
    directory: &Path,
    plots: impl IntoIterator<Item = &'a str>,
    tables: impl IntoIterator<Item = &'a str>,
    pages: [&str; 2],
) -> Result<(), Error> {
    for plot in plots {
        let name = plot_name(plot);
        let path = directory.join(&name);
        if !pages.iter().any(|page| is_plot_of(page, &path)) {
            refuse_file(directory, &name)?;
        }
    }
    for name in tables {
        let path = directory.join(name);
        if is_file(&path) && !pages.iter().any(|page| is_table_of(page, name, &path)) {
            refuse_file(directory, name)?;
        }
    }
    Ok(())
}

/// Removes the former report, its page last: it identifies the other files.
pub(crate) fn remove_report(directory: &Path) -> Result<(), Error> {
    let former = former_report(directory);
    remove_plots_and_tables(directory, &former)?;
    if former.is_empty() { Ok(()) } else { remove_file(directory.join(REPORT)) }
}

fn remove_plots_and_tables(directory: &Path, page: &str) -> Result<(), Error> {
    remove_plots(directory, page)?;
    let tables = TABLES.into_iter().filter(|name| is_table_of(page, name, &directory.join(name)));
    tables.into_iter().try_for_each(|name| remove_file(directory.join(name)))
}

pub(super) fn remove_own_plots(directory: &Path) -> Result<(), Error> {
    remove_plots(directory, &former_report(directory))
}

fn remove_plots(directory: &Path, page: &str) -> Result<(), Error> {
    let plots = directory.join(PLOTS);
    let is_directory = fs::symlink_metadata(&plots).is_ok_and(|plots| plots.is_dir());
    if page.is_empty() || !is_directory {
        return Ok(());
    }
    remove_where(&plots, |name| is_plot(name) && is_plot_of(page, &plots.join(name)))?;
    // A directory with other files remains.
    let _ = fs::remove_dir(plots);
    Ok(())
}

/// Returns an empty text without a report, or for a page of others.
fn former_report(directory: &Path) -> String {
    let path = directory.join(REPORT);
    // Opening a pipe would wait.
    let page = if path.is_file() { fs::read_to_string(path).unwrap_or_default() } else { String::new() };
    if last_line(&page).is_some() { page } else { String::new() }
}

fn last_line(page: &str) -> Option<&str> {
    page.trim_end().lines().next_back().filter(|line| line.starts_with(MARK))
}

pub(super) fn is_plot(name: &str) -> bool {
    name.ends_with(".svg")
}

fn is_plot_of(page: &str, path: &Path) -> bool {
    is_regular(path) && fs::read_to_string(path).is_ok_and(|svg| !svg.is_empty() && page.contains(&svg))
}

fn is_table_of(page: &str, name: &str, path: &Path) -> bool {
    let Some(line) = last_line(page).filter(|_| is_regular(path)) else { return false };
    table_digest(path).is_ok_and(|digest| line.contains(&entry(name, &digest)))
}

/// Skips carriage returns, which copies to other systems add.
fn table_digest(path: &Path) -> io::Result<Digest> {
    let (mut reader, mut digest) = (BufReader::new(File::open(path)?), Digest::new());
    loop {
        let bytes = reader.fill_buf()?;
        if bytes.is_empty() {
            return Ok(digest);
        }
        bytes.split(|&byte| byte == b'\r').for_each(|line| digest.add(line));
        let read = bytes.len();
        reader.consume(read);
    }
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;

    use super::*;

    #[test]
    fn tables_are_written_once_and_belong_to_their_page() {
        let directory = tempfile::tempdir().unwrap();
        let at = |name: &str| directory.path().join(name);
        let calls = Cell::new(0);
        let rows = |out: &mut dyn Write| {
            calls.set(calls.get() + 1);
            (0..10_000).try_for_each(|row| writeln!(out, "{row},{}", calls.get()))
        };
        let write = |page: &str| {
            let tables: Vec<(&str, TableWriter<'_>)> = vec![(TABLES[0], Box::new(rows))];
            write_report(directory.path(), &Report { page, plots: vec![("a", "<svg/>")], tables }, false)
        };
        for (nth, page) in [(1, "first <svg/>"), (2, "second <svg/>")] {
            write(page).unwrap();
            assert_eq!(calls.get(), nth);
            assert_eq!(
                fs::read_to_string(at(TABLES[0])).unwrap().lines().last(),
                Some(&*format!("9999,{nth}"))
            );
            let former = refuse_foreign_page(directory.path()).unwrap();
            assert!(former.starts_with(page) && is_table_of(&former, TABLES[0], &at(TABLES[0])));
        }
        fs::write(at(TABLES[0]), "the work of years\n").unwrap();
        let page = fs::read(at(REPORT)).unwrap();
        let error = write("third <svg/>").unwrap_err().to_string();
        assert!(error.contains("it holds a file impulse-response.csv"), "{error}");
        assert_eq!(fs::read_to_string(at(TABLES[0])).unwrap(), "the work of years\n");
        assert!(fs::read(at(REPORT)).unwrap() == page);
        let names = fs::read_dir(directory.path()).unwrap().map(|entry| entry.unwrap().file_name());
        assert_eq!(names.count(), 3, "drafts are left");
    }
}
