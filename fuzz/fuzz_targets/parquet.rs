#![no_main]

use kalmems_formats::Format;

/// The reader takes a panic of the libraries that it uses for a damaged file; none may be its own. One that is not caught
/// ends the run in any case.
fn end_at_other_panics() {
    let before = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |panic| {
        let is_own = panic.location().is_none_or(|place| place.file().contains("kalmems-"));
        if is_own || !kalmems_formats::panic_is_caught() {
            before(panic);
        }
    }));
}

libfuzzer_sys::fuzz_target!(init: end_at_other_panics(), |data: &[u8]| kalmems_fuzz::table::read(Format::Parquet, data));
