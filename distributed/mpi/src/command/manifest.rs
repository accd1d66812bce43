use lazygrid_io::write::{AtomicFile, CompleteFile, TableFormat};
use serde_json::json;

use super::output::Target;

/// Scripts depend on its names.
pub(crate) fn write(
    target: &Target,
    pairs: &[u64],
    spheres: u64,
    wide: bool,
) -> Result<CompleteFile, lazygrid_io::Error> {
    let of_ranks: Vec<_> = (0..)
        .zip(pairs)
        .map(|(rank, pairs)| {
            let file = target.rank_file(rank);
            // Relative: files and manifest can be moved together.
            let name = file.file_name().unwrap_or_default().to_string_lossy();
            json!({ "rank": rank, "file": name, "pairs": pairs })
        })
        .collect();
    let format = match target.format() {
        TableFormat::Csv => "csv",
        TableFormat::Npy => "npy",
    };
    let manifest = json!({
        "format": format,
        "columns": ["i", "j"],
        "type": if wide { "u64" } else { "u32" },
        "spheres": spheres,
        "pairs": pairs.iter().sum::<u64>(),
        "ranks": pairs.len(),
        "files": of_ranks,
    });
    let mut file = AtomicFile::create(target.manifest())?;
    file.write_with(|out| writeln!(out, "{manifest:#}"))?;
    file.finish()
}
