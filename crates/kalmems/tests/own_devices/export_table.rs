//! Which filters of the examples can be exported, and why the others cannot.

use super::export::{example, request};
use kalmems::export::{ExportRequest, SourceLanguage};
use kalmems::rigs::published;
use kalmems::source::source;
use std::fmt::Write as _;
use std::num::NonZeroU32;

pub const EXAMPLES: [&str; 13] = [
    "shared_scanner/microcontroller.toml",
    "shared_scanner/experiment.toml",
    "shared_scanner/stiffness_state.toml",
    "shared_scanner/two_axes.toml",
    "threshold_scanner/as_published.toml",
    "micro_stage/as_published.toml",
    "accelerometer/experiment.toml",
    "accelerometer/one_bit.toml",
    "piston_mirror/experiment.toml",
    "comb_resonator/experiment.toml",
    "tuning_fork/experiment.toml",
    "thermal_mirror/experiment.toml",
    "vibrating_gyroscope/experiment.toml",
];

/// One line for each filter of each example. What is exported has been rehearsed over the recording, where the example has one, and is within 0.02 of its
/// claimed standard deviation of the estimate.
#[test]
fn every_filter_of_the_examples_is_exported_or_refused_with_its_reason() {
    let mut table = String::new();
    for path in EXAMPLES {
        let experiment = example(path);
        for filter in &experiment.estimate.as_ref().unwrap().filters {
            let wanted = ExportRequest {
                interval_s: experiment.recordings.is_empty().then_some(1e-6),
                ..request(SourceLanguage::C, &filter.name.to_string())
            };
            let said = match source(published(), &experiment, &wanted) {
                Ok(exported) => format!("exported, {} files", exported.files.len()),
                Err(why) => why.to_string(),
            };
            let _ = writeln!(table, "{path}, {}: {said}", filter.name);
        }
    }
    insta::assert_snapshot!(table);
}

/// Corrected by one sample in four, as the estimate of the recording is without the others.
#[test]
fn a_source_that_corrects_by_one_sample_in_four_is_the_filter_of_these_samples() {
    for target in [SourceLanguage::C, SourceLanguage::Rust] {
        let wanted = ExportRequest { update_every: NonZeroU32::new(4).unwrap(), ..request(target, "EKF") };
        let exported = source(published(), &example("shared_scanner/microcontroller.toml"), &wanted).unwrap();
        let (_, text) = exported.files.iter().find(|(name, _)| name.starts_with("scanner_filter.")).unwrap();
        assert!(
            text.contains("one sample in 4") && text.contains("4U") | text.contains("UPDATE_EVERY: u32 = 4"),
            "{text}"
        );
    }
}
