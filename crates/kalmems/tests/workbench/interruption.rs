//! The evaluation ends where the work is stopped, as reading and filtering do.

use kalmems::progress::{Progress, Silent};
use kalmems::rigs::published;
use kalmems::workflow;
use std::cell::{Cell, RefCell};
use std::ops::ControlFlow;
use std::path::Path;
use std::time::Duration;

/// Stops the work on the first look after a stage begins, which it makes come at once.
struct StopsIn<'a> {
    stage: &'a str,
    stages: RefCell<Vec<String>>,
    stopped_at: Cell<Option<u64>>,
}

impl Progress for StopsIn<'_> {
    fn begin(&self, what: &str, _: u64) {
        self.stages.borrow_mut().push(what.to_owned());
        if what == self.stage {
            // Longer than work goes on between two looks at the clock.
            std::thread::sleep(Duration::from_millis(80));
        }
    }

    fn reached(&self, done: u64) -> ControlFlow<()> {
        if self.stages.borrow().last().is_none_or(|what| what != self.stage) {
            return ControlFlow::Continue(());
        }
        self.stopped_at.set(self.stopped_at.get().or(Some(done)));
        ControlFlow::Break(())
    }
}

#[test]
fn an_evaluation_that_is_stopped_is_an_interruption_and_no_result() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples");
    for example in ["shared_scanner/experiment.toml", "threshold_scanner/experiment.toml"] {
        let experiment = published().load(&root.join(example)).unwrap();
        let progress =
            StopsIn { stage: "evaluating", stages: RefCell::default(), stopped_at: Cell::default() };
        let error = workflow::estimate(published(), &experiment, &progress).unwrap_err();
        assert!(error.is_interruption(), "{example}: {error}");
        // Before any of it was done.
        assert_eq!(progress.stopped_at.get(), Some(0), "{example}");
        assert!(workflow::estimate(published(), &experiment, &Silent).is_ok(), "{example}");
    }
}
