//! What a diagnosis leaves out, and what an interrupted one has found.

use super::{EKF, LAG, parsed, usual};
use kalmems::diagnose::{DiagnosisEffort, DiagnosisFinding, diagnose, diagnose_with};
use kalmems::progress::Progress;
use kalmems::rigs::published;
use std::cell::Cell;
use std::ops::ControlFlow;

/// Ends the work when causes are tried for a second time.
#[derive(Default)]
struct EndsAmongCauses(Cell<u32>);

impl Progress for EndsAmongCauses {
    fn begin(&self, what: &str, _: u64) {
        self.0.set(self.0.get() + u32::from(what.starts_with("trying")));
    }

    fn reached(&self, _: u64) -> ControlFlow<()> {
        if self.0.get() > 1 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }
}

/// Two numbers that are off at once, which no single one explains.
#[test]
fn a_diagnosis_that_is_interrupted_gives_the_ranking_so_far() {
    let folder = usual(3000, 81);
    let text = format!("{LAG}{EKF}")
        .replace("tau = \"1 ms\"", "tau = \"1.3 ms\"")
        .replace("c = \"1\"", "c = \"1.2\"");
    let found = diagnose(published(), &parsed(&text, &folder), None, &EndsAmongCauses::default()).unwrap();
    assert_eq!(found.finding, DiagnosisFinding::Interrupted, "{}", found.to_text());
    assert!(
        !found.closest.is_empty() && found.closest.is_sorted_by(|a, b| a.gain >= b.gain),
        "{:?}",
        found.closest
    );
    assert!(found.closest.iter().all(|cause| cause.edits.is_empty()));
    assert!(found.to_text().contains("interrupted before"), "{}", found.to_text());
}

/// A filter with one state is cheap.
#[test]
fn what_a_diagnosis_leaves_out_is_nothing_for_a_small_device() {
    let folder = usual(3000, 82);
    let text = format!("{LAG}{EKF}").replace("tau = \"1 ms\"", "tau = \"1.1 ms\"");
    let experiment = parsed(&text, &folder);
    let found = [DiagnosisEffort::Usual, DiagnosisEffort::Thorough].map(|effort| {
        diagnose_with(published(), &experiment, (None, effort), &kalmems::progress::Silent).unwrap()
    });
    assert!(found.iter().all(|found| found.left_out.is_empty()), "{:?}", found[0].left_out);
    assert_eq!(found[0].to_text(), found[1].to_text());
    assert!(found[0].causes.iter().any(|cause| cause.name == "parameters.tau"), "{}", found[0].to_text());
}
