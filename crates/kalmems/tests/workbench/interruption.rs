//! Work that is interrupted ends.

use kalmems::diagnose::identify;
use kalmems::identify::IdentifyError;
use kalmems::progress::Progress;
use kalmems::rigs::published;
use std::cell::Cell;
use std::ops::ControlFlow;
use std::path::Path;

/// Stops the search for the likeliest numbers when it asks for the thirtieth time.
#[derive(Default)]
struct Thirty {
    searches: Cell<bool>,
    asked: Cell<u32>,
}

impl Progress for Thirty {
    fn begin(&self, what: &str, _: u64) {
        self.searches.set(self.searches.get() || what == "searching the likeliest numbers");
    }

    fn reached(&self, _: u64) -> ControlFlow<()> {
        self.asked.set(self.asked.get() + u32::from(self.searches.get()));
        if self.asked.get() < 30 { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
    }
}

#[test]
fn a_search_for_the_likeliest_numbers_asks_before_each_run_whether_it_is_to_stop() {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/comb_resonator/experiment.toml");
    let experiment = published().parse(&std::fs::read_to_string(&file).unwrap(), &file).unwrap();
    let found = identify(published(), &experiment, &Thirty::default());
    assert!(matches!(found, Err(IdentifyError::Interrupted)), "{:?}", found.is_ok());
}
