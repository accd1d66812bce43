use std::fmt::Write;
use std::thread::available_parallelism;

use lazygrid::{Backend, Config, Detector};
use lazygrid_host::Simd;

use crate::failure::Failure;
use crate::print;

/// Says what can run here.
pub(crate) fn run() -> Result<(), Failure> {
    let threads = available_parallelism().map_or(1, usize::from);
    let vectors = match Simd::detect() {
        Simd::Avx512 => "AVX-512, 16 lanes",
        Simd::Avx2 => "AVX2, 8 lanes",
        Simd::Portable => "portable vectors, 8 lanes",
    };
    let mut text = format!("cpu  {threads} threads, {vectors}\n");
    if let Err(error) = Detector::new(Config::default().backend(Backend::Gpu)) {
        // Writing to a string cannot fail.
        let _ = writeln!(text, "gpu  none: {error}");
    }
    print(text)
}
