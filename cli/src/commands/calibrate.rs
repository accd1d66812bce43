use std::fmt::Write;

use lazygrid::gpu::{self, AdapterId, GpuDevice, SoftwareAdapter};
use lazygrid_io::memory_of_driver_threads;

use crate::calibration_file;
use crate::commands::check_memory;
use crate::error::CliError;
use crate::printer::Printer;

/// Bytes that a software driver maps (llvmpipe). It ends the process if memory is refused to it.
const NEEDED_BYTES: u64 = 576 << 20;

pub(crate) fn run(adapter: Option<&AdapterId>) -> Result<(), CliError> {
    check_memory("the calibration", NEEDED_BYTES + memory_of_driver_threads())?;
    let gpu = adapter.map_or_else(|| GpuDevice::shared(SoftwareAdapter::Allow), GpuDevice::shared_adapter);
    let gpu = gpu.map_err(CliError::Calibration)?;
    // Fails before measurements that take seconds.
    calibration_file::check_writable()?;
    let mut printer = Printer::default();
    printer.print(format!(
        "{}\n{}\n\nsizes  spheres       naive        grid\n",
        gpu.adapter.name, gpu.adapter.driver
    ));
    let measured = gpu::calibrate(&gpu, |sample| {
        let mut row = format!("{:>5}{:>9}", sample.classes, sample.spheres);
        for time in [sample.naive, sample.grid] {
            let mut shown = String::new();
            let _ = write!(shown, "{time:.2?}");
            let _ = write!(row, "{shown:>12}");
        }
        printer.print(row + "\n");
    });
    let measured = measured.map_err(CliError::Calibration)?;
    let path = calibration_file::store(&measured)?;
    let gpu::Crossover { naive_below, per_class, .. } = measured.crossover;
    let further = match per_class {
        0 => String::new(),
        more => format!(", and {more} more for every further size class"),
    };
    let gpu::SkinCosts { search_ns, find_ns, keep_ns, measure_ns, test_ns, call_ns, .. } = measured.skin;
    let (call_us, radix_sort_from) = (call_ns / 1e3, measured.radix_sort_from);
    let device = match measured.device_from {
        u32::MAX => "the CPU answers earlier than this adapter, however many spheres there are".to_owned(),
        from => format!("the CPU answers earlier than this adapter below {from} spheres"),
    };
    printer.print(format!(
        "\nall pairs are tested of fewer than {naive_below} spheres{further};\ncell lists are sorted by radix from \
        {radix_sort_from} spheres on;\n{device}\n\n\
        nanoseconds for each sphere: {search_ns:.3} to search, {keep_ns:.3} to store its reference position, {measure_ns:.3} to \
        measure its displacement;\nfor each candidate: {find_ns:.3} to find, {test_ns:.3} to test; {call_us:.1} microseconds more for \
        a call with a candidate list\n\nstored in {}\n",
        path.display()
    ));
    printer.finish()
}
