mod bundle;
mod checks;
mod scenes;

use flate2::Compression;
use flate2::write::GzEncoder;
use lazygrid::gpu::plan::Planner;
use lazygrid::gpu::{DeviceLimits, GpuConfig, wgpu};
use lazygrid_io::write::{AtomicFile, base64};

use crate::args::{PageArgs, PlanArgs};
use crate::commands::check_memory_with_threads;
use crate::error::CliError;
use crate::progress::Progress;

const PAGE: &str = include_str!("page/page.html");
/// Scripts in the order in which they use each other's names.
const SCRIPTS: [&str; 6] = [
    include_str!("page/player.js"),
    include_str!("page/bundle.js"),
    include_str!("page/stage.js"),
    include_str!("page/check.js"),
    include_str!("page/measure.js"),
    include_str!("page/main.js"),
];

/// Bytes for the contents before they are compressed.
const NEEDED_BYTES: u64 = 128 << 20;

pub(crate) fn run(args: &PageArgs) -> Result<(), CliError> {
    check_memory_with_threads("the page", NEEDED_BYTES)?;
    let progress = Progress::new(None);
    progress.say("counting the pairs of all scenes");
    let contents = bundle::contents(env!("CARGO_PKG_VERSION"), env!("LAZYGRID_COMMIT"))?;
    let mut draft = AtomicFile::create_or_stdout(&args.output)?;
    draft.write_with(|out| {
        let mut packed = GzEncoder::new(Vec::new(), Compression::best());
        serde_json::to_writer(&mut packed, &contents)?;
        let packed = packed.finish()?;
        let (before, rest) = PAGE.split_once("{{data}}").unwrap_or((PAGE, ""));
        let (between, after) = rest.split_once("{{script}}").unwrap_or((rest, ""));
        out.write_all(before.as_bytes())?;
        base64(out, &packed)?;
        out.write_all(between.as_bytes())?;
        out.write_all(SCRIPTS.concat().as_bytes())?;
        out.write_all(after.as_bytes())
    })?;
    Ok(draft.commit()?)
}

pub(crate) fn plan(args: &PlanArgs) -> Result<(), CliError> {
    let config = GpuConfig::default().algorithm(args.algorithm).pair_capacity(args.pairs).space(args.space());
    let mut limits = wgpu::Limits { max_storage_buffers_per_shader_stage: 10, ..wgpu::Limits::default() };
    limits.max_storage_buffer_binding_size = args.binding << 20;
    limits.max_buffer_size = limits.max_buffer_size.max(limits.max_storage_buffer_binding_size);
    limits.max_compute_workgroup_storage_size = args.workgroup_memory << 10;
    let planner = Planner::new(config, DeviceLimits::from(&limits)).subgroups(args.subgroups);
    let plan = planner.count_in_buffer(args.count_in_buffer).plan(args.spheres).map_err(CliError::Setting)?;
    let mut draft = match &args.output {
        Some(path) => AtomicFile::create_or_stdout(path)?,
        None => AtomicFile::stdout()?,
    };
    draft.write_with(|out| {
        serde_json::to_writer(&mut *out, &plan)?;
        out.write_all(b"\n")
    })?;
    Ok(draft.commit()?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn page_has_a_place_for_data_and_scripts_and_asks_nothing_of_a_network() {
        let rest = PAGE.split_once("{{data}}").and_then(|(_, rest)| rest.split_once("{{script}}"));
        assert!(rest.is_some());
        for text in SCRIPTS.iter().chain([&PAGE]) {
            assert!(!text.contains("://"), "an address");
            assert!(text.lines().count() <= 400);
        }
        assert!(SCRIPTS.iter().all(|script| !script.contains("</script")));
    }
}
