//! Calibrations: what is drawn, what is counted, the same bytes by every way, and what is refused.

use crate::folders::{files, table};
use kalmems::progress::{Progress, Silent};
use kalmems::results::{Metrics, Output, Verdict};
use kalmems::rigs::published;
use kalmems::simulate::{ComputedRecording, described};
use kalmems::study::{
    ClaimFinding, JournalError, StudyCalibrationSummary, StudyError, StudyOptions, StudyPlan, Summary,
};
use kalmems::workflow::estimate_computed;
use std::collections::BTreeMap;
use std::fs;
use std::num::NonZero;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// The shipped simulation of the scanner, short and from its motion on, with a filter that has the stiffness as a state and one that has
/// not.
fn experiment() -> String {
    let example = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/shared_scanner/simulation.toml");
    let mut text = fs::read_to_string(example).unwrap();
    for (long, short) in [
        ("duration = \"60 ms\"", "duration = \"4 ms\""),
        ("integration_rate = \"10 MHz\"", "integration_rate = \"1 MHz\""),
        (
            "angle = \"1e-4 rad\", rate = \"0 rad/s\" } # from",
            "angle = \"0.117 rad\", rate = \"12.8e3 rad/s\" } # from",
        ),
        ("skip = \"45 ms\"", "skip = \"2 ms\""),
        ("start = { angle = \"1e-4 rad\", rate = \"0 rad/s\" }\n", "start = \"from_signal\"\n"),
        (
            "start_sd = { angle = \"1e-3 rad\", rate = \"100 rad/s\" }",
            "start_sd = { angle = \"0.15 rad\", rate = \"15e3 rad/s\" }",
        ),
    ] {
        assert!(text.contains(long), "{long}");
        text = text.replace(long, short);
    }
    let filter = text.split("[[estimate.filter]]").nth(1).unwrap().replace("EKF", "EKF, stiffness");
    format!("{text}\n[[estimate.filter]]{filter}\nstates = {{ stiffness = {{ start_sd = \"0.2 %\" }} }}\n")
}

const STIFFNESS: &str = "device.shared_scanner.resonator.stiffness";

struct Folder(TempDir);

impl Folder {
    fn with(experiment: &str) -> Self {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("experiment.toml"), experiment).unwrap();
        Self(folder)
    }

    /// The same with a study.
    fn study(self, text: &str) -> Self {
        let head = "name = \"calibrated\"\nexperiment = \"experiment.toml\"\n";
        fs::write(self.path("study.toml"), format!("{head}{text}")).unwrap();
        self
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn plan(&self, file: &str, runs: u64) -> Result<StudyPlan, StudyError> {
        StudyPlan::calibration(published(), &self.path(file), NonZero::new(runs))
    }

    fn run(
        &self,
        plan: &StudyPlan,
        out: &str,
        (shard, threads): (&str, usize),
        progress: &dyn Progress,
    ) -> Result<PathBuf, StudyError> {
        let options = StudyOptions { shard: shard.parse()?, threads: NonZero::new(threads), force: false };
        plan.run_all(&self.path(out), options, progress).map(|progressed| progressed.journal)
    }

    /// Joins journals, by a plan that is known from them alone.
    fn written(&self, out: &str, journals: &[PathBuf]) -> (Summary, BTreeMap<String, Vec<u8>>) {
        let plan = StudyPlan::from_journal(published(), &journals[0]).unwrap();
        let output = Output::begin(&self.path(out), &plan.work()).unwrap();
        let summary = plan.write_results(journals, &output).unwrap();
        output.commit().unwrap();
        (summary, files(&self.path(out)))
    }

    fn calibrated(&self, file: &str, runs: u64) -> StudyCalibrationSummary {
        let plan = self.plan(file, runs).unwrap();
        let journal = self.run(&plan, "out", ("1/1", 2), &Silent).unwrap();
        let (summary, _) = self.written("out", &[journal]);
        assert_eq!(summary.failed(), 0, "{:?}", summary.failures);
        summary.calibration.unwrap()
    }

    fn refused(&self, file: &str) -> String {
        let refused = self.plan(file, 2).unwrap_err().to_string();
        refused.replace(&format!("{}/", self.0.path().display()), "")
    }
}

/// Stops after so many runs.
struct After(u64);

impl Progress for After {
    fn begin(&self, _: &str, _: u64) {}

    fn reached(&self, done: u64) -> ControlFlow<()> {
        if done >= self.0 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }
}

#[test]
fn threads_interruptions_and_shards_change_no_byte_of_a_calibration() {
    let folder = Folder::with(&experiment());
    let plan = folder.plan("experiment.toml", 20).unwrap();
    let journal = folder.run(&plan, "one", ("1/1", 1), &Silent).unwrap();
    let (summary, one) = folder.written("one", &[journal]);
    // Each filter has a truth that is drawn from what it holds as uncertain.
    assert_eq!((summary.points, summary.runs, summary.failed()), (2, 40, 0));
    for name in ["calibration.csv", "calibration.json", "results.csv", "figures/calibration_1_ekf.svg"] {
        assert!(one.contains_key(name), "{name}: {:?}", one.keys());
    }
    let rows = table(&one, "results.csv");
    let drawn = |row: &&BTreeMap<String, String>| !row["drawn.stiffness"].is_empty();
    assert!(rows.iter().all(|row| drawn(&row) == (row["estimator"] == "ekf_stiffness")));
    assert_eq!(rows.iter().filter(drawn).count(), 20);

    let stopped = folder.run(&plan, "stopped", ("1/1", 2), &After(5)).unwrap_err();
    assert!(matches!(stopped, StudyError::Interrupted { done: 5.., total: 40, .. }), "{stopped}");
    let journal = folder.run(&plan, "stopped", ("1/1", 2), &Silent).unwrap();
    assert_eq!(folder.written("stopped", &[journal]).1, one);

    let parts = ["2/2", "1/2"].map(|shard| folder.run(&plan, "parts", (shard, 2), &Silent).unwrap());
    assert_eq!(folder.written("parts", &parts).1, one);

    // Another number of runs is another calibration, and a study of the same files is none.
    let other = folder.plan("experiment.toml", 21).unwrap();
    let refused = folder.run(&other, "one", ("1/1", 2), &Silent).unwrap_err();
    assert!(matches!(refused, StudyError::Journal(JournalError::Other { .. })), "{refused}");
}

/// The second way: the truth put together by hand from the table, simulated, and estimated by the filter as the file has it.
#[test]
fn a_run_is_a_simulation_of_what_was_drawn() {
    let text = experiment();
    let folder = Folder::with(&text);
    let plan = folder.plan("experiment.toml", 4).unwrap();
    let journal = folder.run(&plan, "out", ("1/1", 2), &Silent).unwrap();
    let (_, results) = folder.written("out", &[journal]);
    let rows = table(&results, "results.csv");
    let row = rows.iter().find(|row| row["estimator"] == "ekf_stiffness").unwrap();
    let deviation: f64 = row["drawn.stiffness"].parse().unwrap();
    assert!(deviation != 0.0 && deviation.abs() < 0.01, "{deviation}");

    let path = folder.path("experiment.toml");
    let truth = text
        .replace("seed = 1", &format!("seed = {}", row["seed"]))
        .replace("1.10e-4 N m", &format!("{:?} N m", 1.10e-4 * (1.0 + deviation)));
    let truth = published().parse(&truth, &path).unwrap();
    let simulation = published().rig(&truth).unwrap().simulate(&truth).unwrap();
    let simulated = ComputedRecording::of(&*simulation, &Silent).unwrap();
    let told = described(&published().parse(&text, &path).unwrap(), &*simulation);
    let metrics = Metrics::of(&estimate_computed(published(), &told, &simulated, &Silent).unwrap());
    let estimator = metrics.estimators().find(|estimator| estimator.key == "ekf_stiffness").unwrap();
    assert_eq!(row["consistency.mean_nis"], format!("{:?}", estimator.consistency.unwrap().mean_nis));
    let parameter = &estimator.parameters[0];
    assert_eq!(row["parameters.stiffness.end"], format!("{:?}", parameter.end));
    // It has found the device that was drawn, and not the one that it was told.
    assert!((parameter.end - deviation).abs() < 4.0 * parameter.end_sd, "{parameter:?}, {deviation}");
}

#[test]
fn a_claim_that_is_too_small_is_found() {
    let noise = |variance: &str| {
        format!("repeats = 30\n[truth]\n\"device.shared_scanner.readout.noise_variance\" = \"{variance}\"\n")
    };
    // As the filters are told, and with a noise of three times the standard deviation.
    for (variance, finds) in [("1.92e-4 V^2", false), ("1.728e-3 V^2", true)] {
        let found = Folder::with(&experiment()).study(&noise(variance)).calibrated("study.toml", 0);
        assert_eq!(found.filters.len(), 2, "{found:?}");
        for filter in &found.filters {
            assert_eq!(filter.doubted.share, if finds { 1.0 } else { 0.0 }, "{filter:?}");
            let angle = filter.claims.iter().find(|claim| claim.quantity == "angle").unwrap();
            assert_eq!(angle.finding == ClaimFinding::Overconfident, finds, "{angle:?}");
            assert_eq!(angle.coverage[1].found.upper < angle.coverage[1].claimed, finds, "{angle:?}");
        }
        let parameter = &found.filters[1].claims[1];
        assert_eq!((parameter.quantity.as_str(), parameter.errors, parameter.ranked), ("stiffness", 30, 30));
    }
}

#[test]
fn what_cannot_be_calibrated_is_refused_with_what_to_write() {
    let folder = Folder::with(&experiment()).study(&format!("[truth]\n\"{STIFFNESS}\" = \"1.2e-4 N m\"\n"));
    let refused = folder.refused("study.toml");
    assert!(
        refused.starts_with("study.toml:4: truth.") && refused.contains("leave it out here"),
        "{refused}"
    );
    let varied = "[[vary]]\nkey = \"device.shared_scanner.resonator.stiffness\"\napplies_to = \"truth\"\n\
                  normal = { mean = \"1.1e-4 N m\", sd = \"1e-6 N m\" }\n";
    let refused = Folder::with(&experiment()).study(varied).refused("study.toml");
    assert!(refused.starts_with("study.toml:4: vary[0].key:"), "{refused}");
    // A study that varies nothing is one only as a calibration.
    let nothing = Folder::with(&experiment()).study("repeats = 2\n");
    let refused = StudyPlan::load(published(), &nothing.path("study.toml")).unwrap_err().to_string();
    assert!(refused.contains("add a table headed `[[vary]]`"), "{refused}");
    assert_eq!(nothing.plan("study.toml", 0).unwrap().runs(), 4);

    let example = |name: &str| {
        fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples").join(name)).unwrap()
    };
    let refused = Folder::with(&example("shared_scanner/experiment.toml")).refused("experiment.toml");
    assert!(refused.contains("simulate: the key is missing; a calibration simulates"), "{refused}");
    // Without a number that could be drawn there is no truth.
    let threshold = example("threshold_scanner/simulation.toml");
    let folder = Folder::with(&threshold.replace("feedthrough_capacitance = \"0.2 pF\"\n", ""));
    let refused = folder.refused("experiment.toml");
    assert!(refused.contains("feedthrough"), "{refused}");
}

/// The verdict on each run's filter with the signs as the experiment states them: the drawn truth put together by hand, simulated and
/// estimated without a calibration.
fn verdicts_as_written(
    text: &str,
    rows: &[BTreeMap<String, String>],
    drawn: &[(&str, &str, f64)],
) -> Vec<Verdict> {
    let path = Path::new("experiment.toml");
    let told = published().parse(text, path).unwrap();
    let verdict = |row: &BTreeMap<String, String>| {
        let mut truth = text.replace("seed = 1", &format!("seed = {}", row["seed"]));
        for (column, written, nominal) in drawn {
            let deviation: f64 = row[*column].parse().unwrap();
            assert!(truth.contains(written), "{written}");
            truth = truth.replace(written, &format!("stiffness = \"{:?} N m\"", nominal * (1.0 + deviation)));
        }
        let truth = published().parse(&truth, path).unwrap();
        let simulation = published().rig(&truth).unwrap().simulate(&truth).unwrap();
        let simulated = ComputedRecording::of(&*simulation, &Silent).unwrap();
        let told = described(&told, &*simulation);
        let metrics = Metrics::of(&estimate_computed(published(), &told, &simulated, &Silent).unwrap());
        metrics.estimators().find(|estimator| estimator.key == row["estimator"]).unwrap().verdict
    };
    rows.iter().map(verdict).collect()
}

/// Devices whose stiffness is drawn so widely that the motion turns against its drive by up to half a turn and more: the sign of the
/// first turning point is that of each device, and no filter fails by the sign that the experiment states for one of them.
fn signs_are_those_of_each_device(text: &str, drawn: &[(&str, &str, f64)]) {
    let folder = Folder::with(text);
    let plan = folder.plan("experiment.toml", 16).unwrap();
    let journal = folder.run(&plan, "out", ("1/1", 2), &Silent).unwrap();
    let (summary, results) = folder.written("out", &[journal]);
    assert_eq!(summary.failed(), 0, "{:?}", summary.failures);
    let rows = table(&results, "results.csv");
    assert_eq!(rows.len(), 16);
    let as_written = verdicts_as_written(text, &rows, drawn);
    let wrong = as_written.iter().filter(|verdict| **verdict == Verdict::WrongSign).count();
    let calibrated: Vec<&str> = rows.iter().map(|row| row["verdict"].as_str()).collect();
    println!("{wrong} of 16 have the wrong sign as written: {as_written:?}, calibrated {calibrated:?}");
    assert!(wrong >= 3, "{as_written:?}");
    assert!(calibrated.iter().all(|verdict| *verdict != "wrong_sign"), "{calibrated:?}");
}

#[test]
fn signs_of_a_scanner_are_those_of_each_device_that_is_drawn() {
    let text = experiment().replace("start_sd = \"0.2 %\"", "start_sd = \"2 %\"");
    // The filter with the stiffness as a state alone.
    let parts: Vec<&str> = text.split("[[estimate.filter]]").collect();
    let text = format!("{}[[estimate.filter]]{}", parts[0], parts[2]);
    signs_are_those_of_each_device(&text, &[("drawn.stiffness", "stiffness = \"1.10e-4 N m\"", 1.10e-4)]);
}

#[test]
#[ignore = "long: `.ci/run --all` runs it"]
fn long_signs_of_two_axes_are_those_of_each_device_that_is_drawn() {
    let example = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/shared_scanner/two_axes.toml");
    let mut text = fs::read_to_string(example).unwrap();
    for (long, short) in [
        ("duration = \"24 ms\"", "duration = \"6 ms\""),
        ("integration_rate = \"10 MHz\"", "integration_rate = \"1 MHz\""),
        ("skip = \"10 ms\"", "skip = \"3 ms\""),
    ] {
        assert!(text.contains(long), "{long}");
        text = text.replace(long, short);
    }
    let filter = text.find("[[estimate.filter]]\nname = \"UKF\"").unwrap();
    text.truncate(filter);
    text += "states = { stiffness_x = { start_sd = \"1 %\" }, stiffness_y = { start_sd = \"2 %\" } }\n";
    let drawn = [
        ("drawn.stiffness_x", "stiffness = \"1.10e-4 N m\"", 1.10e-4),
        ("drawn.stiffness_y", "stiffness = \"1.00e-4 N m\"", 1.00e-4),
    ];
    signs_are_those_of_each_device(&text, &drawn);
}

/// Filters that share what they hold as uncertain are told of the same recordings, at each point of the grid.
#[test]
fn each_point_of_a_study_is_calibrated_by_itself() {
    let vary = "repeats = 3\n[[vary]]\nkey = \"estimate.process_noise.angular_acceleration\"\nname = \"q\"\n\
                values = [\"1e4 rad^2/s^3\", \"1e8 rad^2/s^3\"]\n";
    let text = experiment().replace("states = { stiffness = { start_sd = \"0.2 %\" } }", "");
    let found = Folder::with(&text).study(vary).calibrated("study.toml", 0);
    let labels: Vec<(&str, &str, u64)> =
        found.filters.iter().map(|f| (f.point.as_str(), f.estimator.as_str(), f.runs)).collect();
    assert_eq!(
        labels,
        [
            ("q 1e4 rad^2/s^3", "ekf", 3),
            ("q 1e4 rad^2/s^3", "ekf_stiffness", 3),
            ("q 1e8 rad^2/s^3", "ekf", 3),
            ("q 1e8 rad^2/s^3", "ekf_stiffness", 3),
        ]
    );
}
