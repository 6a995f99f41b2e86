#![no_main]

use kalmems_formats::Format;

/// The reader takes a panic of the library that it uses for a damaged file; none may be its own.
fn end_at_other_panics() {
    let before = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |panic| {
        if !panic.location().is_some_and(|place| place.file().contains("/parquet-")) {
            before(panic);
        }
    }));
}

libfuzzer_sys::fuzz_target!(init: end_at_other_panics(), |data: &[u8]| kalmems_fuzz::table::read(Format::Parquet, data));
