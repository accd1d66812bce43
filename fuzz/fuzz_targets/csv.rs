#![no_main]

use lazygrid_io::read::Format;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| lazygrid_fuzz::read(Some(Format::Csv), bytes));
