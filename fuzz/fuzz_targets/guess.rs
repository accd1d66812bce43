#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| lazygrid_fuzz::read(None, bytes));
