#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| kalmems_fuzz::equations::read(data));
