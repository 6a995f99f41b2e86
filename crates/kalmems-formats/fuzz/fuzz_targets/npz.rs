#![no_main]

use kalmems_formats::Format;

libfuzzer_sys::fuzz_target!(|data: &[u8]| kalmems_formats_fuzz::read(Format::Npz, data));
