use std::fmt::Write;
use std::fs;
use std::path::Path;

use lazygrid_bench::figures::Results;
use lazygrid_bench::figures::compare::{Change, Difference, circumstances, differences};

use crate::command::args::Compare;
use crate::command::failure::Failure;
use crate::print;

pub(crate) fn run(args: &Compare) -> Result<(), Failure> {
    let (old, new) = (read(&args.old)?, read(&args.new)?);
    let mut differences = differences(&old, &new);
    differences.sort_by(|a, b| a.change.cmp(&b.change).then(b.ratio.total_cmp(&a.ratio)));
    let mut text = String::new();
    for note in circumstances(&old, &new) {
        let _ = writeln!(text, "note: {note}");
    }
    differences.iter().for_each(|difference| add(&mut text, difference));
    let count = |change| differences.iter().filter(|d| d.change == change).count();
    let [broken, lost, slower, larger] =
        [Change::Broken, Change::Lost, Change::Slower, Change::Larger].map(count);
    let _ = writeln!(
        text,
        "{} measurements: {broken} broken, {lost} lost, {slower} slower, {} faster, {} within the noise, {} with too \
         few runs to say; memory: {larger} larger, {} smaller",
        differences.len(),
        count(Change::Faster),
        count(Change::Same),
        count(Change::TooFew),
        count(Change::Smaller),
    );
    let verdict = match broken + lost + slower + larger {
        0 => Ok(()),
        _ => Err(Failure::Worse { broken, lost, slower, larger }),
    };
    let printed = print(text);
    verdict.and(printed)
}

fn add(text: &mut String, difference: &Difference<'_>) {
    let Difference { old, new, ratio, change } = difference;
    let at = old.at.map_or_else(String::new, |at| format!(" at {at}"));
    let what = format!("{} {} {}{at}, {}", old.figure, old.scene, old.n, old.engine);
    let reason = match new {
        None => "not in the new run",
        Some(new) if new.reason.is_empty() => "without its measurement",
        Some(new) => &new.reason,
    };
    let times = || {
        let (before, after) = (old.median(), new.map_or(f64::NAN, |new| new.median()));
        format!("{before:.3e} s -> {after:.3e} s, {ratio:.2} times the time")
    };
    let bytes = || {
        let [before, after] = [Some(*old), *new].map(|row| row.and_then(|row| row.bytes).unwrap_or(f64::NAN));
        format!("{before:.0} -> {after:.0} bytes per sphere")
    };
    let _ = match change {
        Change::Broken => writeln!(text, "broken   {what}: {reason}"),
        Change::Lost => writeln!(text, "lost     {what}: {reason}"),
        Change::Slower => writeln!(text, "slower   {what}: {}", times()),
        Change::Faster => writeln!(text, "faster   {what}: {}", times()),
        Change::Larger => writeln!(text, "larger   {what}: {}", bytes()),
        Change::Smaller => writeln!(text, "smaller  {what}: {}", bytes()),
        _ => Ok(()),
    };
}

fn read(folder: &Path) -> Result<Results, Failure> {
    let path = folder.join("results.json");
    let failure = |reason: String| Failure::Figures(format!("{}: cannot read: {reason}", path.display()));
    let bytes = fs::read(&path).map_err(|e| failure(e.to_string()))?;
    serde_json::from_slice(&bytes).map_err(|e| failure(e.to_string()))
}
