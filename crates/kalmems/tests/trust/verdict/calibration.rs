//! Whether verdicts and claims hold over devices that are drawn from what their filters are told.

use crate::devices::{Device, Setting};
use kalmems::progress::Silent;
use kalmems::results::Output;
use kalmems::rigs::published;
use kalmems::study::{ClaimFinding, Shard, StudyCalibrationSummary, StudyOptions, StudyPlan, Summary};
use std::num::NonZero;

/// A device, what of it is set, and how often it is drawn.
struct Case {
    words: &'static str,
    device: &'static str,
    settings: &'static [(&'static str, &'static str)],
    runs: u64,
    /// Whether its filters are those of four parameters that are known well.
    has_four: bool,
}

/// Filters of the scanner that have four parameters as states, with what is known of these before.
fn of_four(methods: &[&str], states: &str) -> String {
    let each = methods.iter().map(|method| {
        format!(
            "{{ name = \"{method}\", method = \"{method}\", start = \"from_signal\", start_sd = {{ angle = \"0.15 rad\", rate = \
             \"15e3 rad/s\" }}, states = {states} }}"
        )
    });
    format!("[{}]", each.collect::<Vec<_>>().join(", "))
}

/// What is known of four parameters: well, as a laboratory may know them, and next to nothing.
const FOUR: [&str; 3] = [
    r#"{ stiffness = { start_sd = "0.1 %" }, damping = { start_sd = "1 %" }, gain = { start_sd = "0.1 %" }, offset = { start_sd = "5 mV" } }"#,
    r#"{ stiffness = { start_sd = "0.3 %" }, damping = { start_sd = "5 %" }, gain = { start_sd = "1 %" }, offset = { start_sd = "50 mV" } }"#,
    r#"{ stiffness = { start_sd = "1 %" }, damping = { start_sd = "10 %" }, gain = { start_sd = "5 %" }, offset = { start_sd = "200 mV" } }"#,
];

const CONSIDER: &[(&str, &str)] = &[
    ("estimate.filter.0.method", "\"consider_ekf\""),
    ("estimate.filter.0.smooth", "false"),
    ("estimate.filter.0.states", "{ mass = { start_sd = \"5 %\" }, spring = { start_sd = \"5 %\" } }"),
];

const CASES: [Case; 9] = [
    Case { words: "shared scanner", device: "shared scanner", settings: &[], runs: 300, has_four: false },
    Case {
        words: "shared scanner, four parameters",
        device: "shared scanner",
        settings: &[],
        runs: 300,
        has_four: true,
    },
    Case {
        words: "two axes, stiffnesses",
        device: "two axes",
        settings: &[(
            "estimate.filter.0.states",
            "{ stiffness_x = { start_sd = \"0.1 %\" }, stiffness_y = { start_sd = \"0.1 %\" } }",
        )],
        runs: 200,
        has_four: false,
    },
    Case {
        words: "threshold scanner, three parameters",
        device: "threshold scanner",
        settings: &[(
            "estimate.filter.0.states",
            "{ natural_frequency = { start_sd = \"0.1 %\" }, gain = { start_sd = \"1 %\" }, feedthrough = { start_sd = \"5 %\" } }",
        )],
        runs: 300,
        has_four: false,
    },
    Case { words: "accelerometer", device: "accelerometer", settings: &[], runs: 300, has_four: false },
    Case {
        words: "accelerometer, mass and spring considered",
        device: "accelerometer",
        settings: CONSIDER,
        runs: 300,
        has_four: false,
    },
    Case { words: "micro-stage", device: "micro-stage", settings: &[], runs: 300, has_four: false },
    Case {
        words: "micro-stage, resonance and gap",
        device: "micro-stage",
        settings: &[(
            "estimate.filter.0.states",
            "{ natural_frequency = { start_sd = \"0.1 %\" }, damping_ratio = { start_sd = \"5 %\" }, gap = { start_sd = \"0.1 %\" } }",
        )],
        runs: 300,
        has_four: false,
    },
    Case {
        words: "piston mirror, gain and stray capacitance",
        device: "piston mirror",
        settings: &[(
            "estimate.filter.0.states",
            "{ gain = { start_sd = \"0.1 %\" }, stray_capacitance = { start_sd = \"10 aF\" } }",
        )],
        runs: 150,
        has_four: false,
    },
];

impl Case {
    fn calibrated(&self, runs: u64) -> Summary {
        let settings = self.settings.iter().map(|(key, value)| (*key, (*value).to_owned()));
        let four = self.has_four.then(|| ("estimate.filter", of_four(&["ekf", "ukf"], FOUR[0])));
        calibrated(self.device, &settings.chain(four).collect::<Vec<_>>(), runs)
    }
}

/// So many devices that are drawn from what the filters of this one hold as uncertain.
pub fn calibrated(device: &str, settings: &[Setting], runs: u64) -> Summary {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("experiment.toml");
    std::fs::write(&file, Device::named(device).text(settings)).unwrap();
    let plan = StudyPlan::calibration(published(), &file, NonZero::new(runs)).unwrap();
    let out = folder.path().join("out");
    let options = StudyOptions { shard: Shard::WHOLE, threads: None, force: false };
    let progressed = plan.run_all(&out, options, &Silent).unwrap();
    let output = Output::begin(&out, &plan.work()).unwrap();
    let summary = plan.write_results(&[progressed.journal], &output).unwrap();
    output.commit().unwrap();
    summary
}

/// The rows of the book.
fn print(words: &str, StudyCalibrationSummary { filters }: &StudyCalibrationSummary) {
    for filter in filters {
        for claim in &filter.claims {
            let coverage = claim.coverage.map(|level| {
                let [share, lower, upper] =
                    [level.found.share, level.found.lower, level.found.upper].map(|x| 100.0 * x);
                format!("{share:.1} ({lower:.1} … {upper:.1})")
            });
            println!(
                "| {words} | {} | {} | {:.0} | {} | {:.2} | {} | {} |",
                filter.name,
                claim.quantity.replace('_', " "),
                claim.independent,
                coverage.join(" | "),
                claim.rms,
                claim.ranks.as_ref().map_or_else(|| "–".to_owned(), |ranks| format!("{:.1e}", ranks.p_value)),
                claim.finding,
            );
        }
    }
}

#[test]
#[ignore = "long: `.ci/run --all` runs it"]
fn long_claims_of_an_accelerometer_hold_over_devices_drawn_from_its_stated_uncertainty() {
    let summary = CASES[4].calibrated(40);
    assert_eq!((summary.runs, summary.failed()), (40, 0));
    let calibration = summary.calibration.unwrap();
    assert_eq!(calibration.filters.len(), 2, "{calibration:?}");
    for filter in &calibration.filters {
        assert_eq!((filter.runs, filter.doubted.share), (40, 0.0), "{filter:?}");
        assert_eq!(filter.claims.len(), 3);
        for claim in &filter.claims {
            assert_eq!(claim.finding, ClaimFinding::Holds, "{claim:?}");
            // So many errors show that a standard deviation is claimed a hundredth too large, which is no fault.
            let [one, ..] = claim.coverage;
            assert!((one.found.share - one.claimed).abs() < 0.01, "{claim:?}");
        }
    }
}

/// The table of the book on filters: what a wide prior makes of a claim. It has no bound: what it prints is what is to be known.
#[test]
#[ignore = "2 minutes in a release build"]
fn slow_what_wide_priors_make_of_the_claim_of_a_gain() {
    for states in FOUR {
        let filters = of_four(&["ekf", "ukf", "iterated_ekf"], states);
        let summary = calibrated("shared scanner", &[("estimate.filter", filters)], 100);
        let gains = summary.calibration.as_ref().unwrap().filters.iter().map(|filter| {
            let claim = filter.claims.iter().find(|claim| claim.quantity == "gain").unwrap();
            format!("{} {:.2}", filter.name, claim.rms)
        });
        let gains: Vec<String> = gains.collect();
        let lost = summary.calibration.as_ref().unwrap().filters.iter().map(|filter| {
            filter.grades.iter().find(|count| count.grade == "no estimate").map_or(0, |count| count.runs)
        });
        println!(
            "{states}: {}; no estimate {:?}, {} failed",
            gains.join(", "),
            lost.collect::<Vec<_>>(),
            summary.failed()
        );
    }
}

#[test]
#[ignore = "10 minutes in a release build"]
fn slow_verdicts_and_claims_hold_over_devices_drawn_from_their_stated_uncertainty() {
    let (mut runs, mut doubted) = (0, 0);
    println!(
        "| device | filter | quantity | independent errors | within 1 sd | within 2 sd | within 3 sd | rms | p | finding |"
    );
    let mut all = Vec::new();
    for case in &CASES {
        let summary = case.calibrated(case.runs);
        assert_eq!(summary.failed(), 0, "{}: {:?}", case.words, summary.failures);
        let calibration = summary.calibration.unwrap();
        print(case.words, &calibration);
        all.push((case.words, calibration));
    }
    println!("| device | filter | runs | grades | doubtful or worse |");
    for (words, calibration) in &all {
        for filter in &calibration.filters {
            let grades: Vec<String> =
                filter.grades.iter().map(|count| format!("{} {}", count.runs, count.grade)).collect();
            let [share, lower, upper] =
                [filter.doubted.share, filter.doubted.lower, filter.doubted.upper].map(|x| 100.0 * x);
            println!(
                "| {words} | {} | {} | {} | {share:.1} % ({lower:.1} … {upper:.1}) |",
                filter.name,
                filter.runs,
                grades.join(", ")
            );
            for test in filter.tests.iter().filter(|test| test.failed > 0) {
                println!("    {}: {} of {:.0}", test.test, test.failed, test.rate.of);
            }
            runs += filter.runs;
            #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a number of runs
            {
                doubted += (filter.doubted.share * filter.runs as f64).round() as u64;
            }
        }
    }
    println!("{doubted} of {runs} doubted");
    assert!(doubted * 1000 <= 2 * runs, "{doubted} of {runs}");
}
