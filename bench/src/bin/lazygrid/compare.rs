use std::fmt::Write;
use std::fs;
use std::path::Path;

use lazygrid_bench::figures::Results;
use lazygrid_bench::figures::compare::{Change, Difference, differences};

use crate::args::Compare;
use crate::failure::Failure;
use crate::print;

/// Says what changed between two result folders by more than the noise.
pub(crate) fn run(args: &Compare) -> Result<(), Failure> {
    let (old, new) = (read(&args.old)?, read(&args.new)?);
    let mut differences = differences(&old, &new);
    differences.sort_by(|a, b| a.change.cmp(&b.change).then(b.ratio.total_cmp(&a.ratio)));
    let mut text = String::new();
    if old.environment.machine() != new.environment.machine() {
        text += "note: the two ran on different machines\n";
    }
    for difference in differences.iter().filter(|d| d.change != Change::Same) {
        add(&mut text, difference);
    }
    let count = |change| differences.iter().filter(|d| d.change == change).count();
    let (slower, broken) = (count(Change::Slower), count(Change::Broken));
    // Writing to a string cannot fail.
    let _ = writeln!(
        text,
        "{} measurements in both: {broken} broken, {slower} slower, {} faster, {} within the noise",
        differences.len(),
        count(Change::Faster),
        count(Change::Same),
    );
    print(text)?;
    if slower + broken > 0 { Err(Failure::Slower { slower, broken }) } else { Ok(()) }
}

fn add(text: &mut String, difference: &Difference<'_>) {
    let Difference { old, new, ratio, change } = difference;
    let at = new.at.map_or_else(String::new, |at| format!(" at {at}"));
    let what = format!("{} {} {}{at}, {}", new.figure, new.scene, new.n, new.engine);
    let _ = match change {
        Change::Broken => writeln!(text, "broken   {what}: {}", new.reason),
        Change::Slower | Change::Faster | Change::Same => {
            let word = if *change == Change::Slower { "slower" } else { "faster" };
            let (before, after) = (old.median(), new.median());
            writeln!(text, "{word}   {what}: {before:.3e} s -> {after:.3e} s, {ratio:.2} times the time")
        }
    };
}

fn read(folder: &Path) -> Result<Results, Failure> {
    let path = folder.join("results.json");
    let failure = |reason: String| Failure::Figures(format!("{}: cannot read: {reason}", path.display()));
    let bytes = fs::read(&path).map_err(|e| failure(e.to_string()))?;
    serde_json::from_slice(&bytes).map_err(|e| failure(e.to_string()))
}
