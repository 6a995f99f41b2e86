#![no_main]

use kalmems_formats::Format;

libfuzzer_sys::fuzz_target!(|data: &[u8]| kalmems_fuzz::table::read(Format::Npz, data));
