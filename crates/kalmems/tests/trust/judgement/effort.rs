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

/// Two numbers that are off, of which no single one explains the recording: after the causes of one number the rows are used up.
#[test]
fn what_is_left_out_is_named_and_a_thorough_diagnosis_tries_it() {
    let folder = usual(3000, 81);
    let text = format!("{LAG}{EKF}")
        .replace("tau = \"1 ms\"", "tau = \"1.3 ms\"")
        .replace("c = \"1\"", "c = \"1.2\"");
    let experiment = parsed(&text, &folder);
    let [few, thorough] = [DiagnosisEffort::Rows(30 * 3000), DiagnosisEffort::Thorough].map(|effort| {
        diagnose_with(published(), &experiment, (None, effort), &kalmems::progress::Silent).unwrap()
    });
    assert!(few.left_out.iter().any(|left_out| left_out.starts_with("pairs")), "{}", few.to_text());
    let told = few.to_text();
    assert!(told.contains("Left out") && told.contains("`--thorough` tries them"), "{told}");
    assert!(thorough.left_out.is_empty(), "{:?}", thorough.left_out);
    assert!(thorough.tried > few.tried, "{} {}", thorough.tried, few.tried);
}

/// A drive that is held, in a text that has it linear: half a sample of time, so that the two are not told apart.
#[test]
fn an_interpolation_that_is_wrong_is_among_the_causes() {
    let folder = usual(3000, 83);
    let text = format!("{LAG}{EKF}").replace("\"hold\"", "\"linear\"");
    let found = diagnose_with(
        published(),
        &parsed(&text, &folder),
        (None, DiagnosisEffort::Usual),
        &kalmems::progress::Silent,
    )
    .unwrap();
    assert!(found.causes.iter().any(|cause| cause.name.contains("which is `hold`")), "{}", found.to_text());
}
