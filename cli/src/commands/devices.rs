use std::fmt::Write;
use std::thread::available_parallelism;

use lazygrid::gpu::{AdapterSummary, adapters};
use lazygrid::{Backend, Config, Detector, Simd};

use crate::error::CliError;
use crate::print;

pub(crate) fn run() -> Result<(), CliError> {
    let mut text = format!("cpu  {}\n", cpu());
    let found = adapters();
    found.iter().enumerate().for_each(|(index, adapter)| text += &described(index, adapter));
    if found.is_empty()
        && let Err(error) = Detector::new(Config::default().backend(Backend::Gpu))
    {
        let _ = writeln!(text, "gpu  none: {error}");
    }
    print(text)
}

pub(crate) fn cpu() -> String {
    let threads = available_parallelism().map_or(1, usize::from);
    format!("{threads} threads, {}", Simd::detect())
}

pub(crate) fn subgroups(adapter: &AdapterSummary) -> String {
    match (adapter.has_subgroups, adapter.subgroup_sizes) {
        (false, _) => "no subgroups".to_owned(),
        (true, [least, most]) if least == most => format!("subgroups of {least}"),
        (true, [least, most]) => format!("subgroups of {least} to {most}"),
    }
}

fn described(index: usize, adapter: &AdapterSummary) -> String {
    let kind = if adapter.is_hardware { "hardware" } else { "software" };
    let subgroups = subgroups(adapter);
    let timestamps = if adapter.has_timestamps { "timestamps" } else { "no timestamps" };
    format!(
        "gpu  {index}: {}, {kind}\n     {} by {}, {subgroups}, {timestamps}\n     \
         {} MiB per storage binding, {} MiB per buffer, {} KiB per workgroup, {} workgroups per dimension\n",
        adapter.name,
        adapter.driver,
        adapter.api,
        adapter.storage_binding >> 20,
        adapter.buffer >> 20,
        adapter.workgroup_memory >> 10,
        adapter.groups_per_dimension,
    )
}
