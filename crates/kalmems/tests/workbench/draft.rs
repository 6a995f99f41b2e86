//! Experiment files to begin with.

use kalmems::config::Experiment;
use kalmems::diagnose::{DiagnosisFinding, diagnose_recording, load_with_noise};
use kalmems::draft::{self, DraftError, DraftRequest, ExaminedRecording, RecordingToExamine};
use kalmems::evaluate::Grade;
use kalmems::progress::Silent;
use kalmems::results::{EstimatorMetrics, Metrics};
use kalmems::rigs::published;
use kalmems::simulate::{ComputedRecording, described};
use kalmems::workflow::{estimate, estimate_computed};
use std::fs;
use std::ops::ControlFlow;
use std::path::Path;

fn template(device: &str) -> String {
    draft::of_device(published(), device).unwrap()
}

fn parsed(text: &str, path: &Path) -> Experiment {
    published().parse(text, path).unwrap_or_else(|e| panic!("{e}\n{text}"))
}

/// What its filters claim passes, and their errors are within it where there is something to compare.
fn assert_passes(metrics: &Metrics, what: &str) {
    let estimators: Vec<&EstimatorMetrics> = metrics.estimators().collect();
    assert!(!estimators.is_empty());
    for estimator in estimators {
        let passes = estimator.grade.is_none_or(|grade| grade <= Grade::PassesWithRemarks);
        assert!(passes, "{what}, {}: {:?} {:?}", estimator.name, estimator.grade, estimator.tests);
    }
}

#[test]
fn what_a_template_simulates_its_filters_estimate() {
    for rig in published().rigs() {
        for seed in [1_u64, 20_261_124] {
            let mut experiment = parsed(&template(rig.name()), Path::new("own.toml"));
            experiment.simulate.as_mut().unwrap().seed = seed;
            let simulation = rig.simulate(&experiment).unwrap();
            let simulated = ComputedRecording::of(&*simulation, &Silent).unwrap();
            let told = described(&experiment, &*simulation);
            let outcome = estimate_computed(published(), &told, &simulated, &Silent).unwrap();
            assert_passes(&Metrics::of(&outcome), &format!("{}, seed {seed}", rig.name()));
        }
    }
}

/// A device whose resonance is not quite the stated one: the diagnosis offers a number as a state, and a filter of the template has it.
fn assert_a_filter_has_the_state_that_is_offered(device: &str, right: &str, wrong: &str) {
    let rig = published().rigs().find(|rig| rig.name() == device).unwrap();
    let text = template(device);
    let real = parsed(&text, Path::new("own.toml"));
    let simulation = rig.simulate(&real).unwrap();
    let simulated = ComputedRecording::of(&*simulation, &Silent).unwrap();
    let [right, wrong] = [right, wrong].map(|number| format!("= \"{number}\""));
    let told = parsed(&text.replacen(&right, &wrong, 1), Path::new("own.toml"));
    let told = described(&told, &*simulation);
    let layout = rig.layout(&told, rig.wanted(&told).unwrap()[0]).unwrap();
    let recording = simulated.recorded(&layout).unwrap();
    let found = diagnose_recording(published(), &told, None, recording, &Silent).unwrap();
    assert_eq!(found.finding, DiagnosisFinding::Explained, "{device}: {:?}", found.tests);
    let offered = found.causes.iter().flat_map(|cause| &cause.states);
    let offered: Vec<&str> = offered.filter_map(|entry| entry.split(' ').next()).collect();
    let filters = &told.estimate.as_ref().unwrap().filters;
    let has = |name: &str| filters.iter().any(|filter| filter.states.contains_key(name));
    assert!(offered.iter().any(|name| has(name)), "{device}: {offered:?}");
}

#[test]
#[ignore = "long: `.ci/run --all` runs it"]
fn long_a_template_has_a_filter_with_the_state_that_a_diagnosis_asks_for() {
    assert_a_filter_has_the_state_that_is_offered("shared_scanner", "1.10e-4 N m", "1.104e-4 N m");
    assert_a_filter_has_the_state_that_is_offered("equations", "4.7374 N/m", "4.7474 N/m");
}

#[test]
#[ignore = "a minute"]
fn slow_templates_of_all_devices_have_the_states_that_a_diagnosis_asks_for() {
    for (device, right, wrong) in [
        ("shared_scanner.second_axis", "1.10e-4 N m", "1.101e-4 N m"),
        ("threshold_scanner", "624.6 Hz", "626.5 Hz"),
        ("micro_stage", "1714.5 Hz", "1790 Hz"),
    ] {
        assert_a_filter_has_the_state_that_is_offered(device, right, wrong);
    }
}

/// Every key of a device in its template has a value that its own parser takes, and a reader finds a word on where numbers come from.
#[test]
fn a_template_names_the_source_of_its_numbers() {
    for rig in published().rigs() {
        let text = template(rig.name());
        assert!(text.contains("# "), "{}", rig.name());
        assert!(text.contains("\n[simulate]\n") && text.contains("\n[estimate]\n"), "{}", rig.name());
        assert!(text.find("\n[simulate]\n") < text.find("\n[estimate]\n"), "{}", rig.name());
    }
}

fn simulated_files(device: &str, folder: &Path) {
    let experiment = parsed(&template(device), &folder.join("own.toml"));
    let rig = published().rig(&experiment).unwrap();
    let mut names: Vec<&str> = vec!["time_s"];
    let simulation = rig.simulate(&experiment).unwrap();
    names.extend(simulation.recorded().iter().map(|channel| channel.column));
    let mut rows = names.join(",") + "\n";
    simulation
        .run(&mut |sample| {
            rows += &format!("{}", sample.time_s);
            sample.recorded.iter().for_each(|value| rows += &format!(",{value}"));
            rows.push('\n');
            ControlFlow::Continue(())
        })
        .unwrap();
    fs::write(folder.join("shake 1.csv"), rows).unwrap();
}

fn examined(path: &Path) -> ExaminedRecording {
    let recording = RecordingToExamine {
        path: path.to_owned(),
        role: None,
        stated: kalmems::inspect::StatedFile::default(),
    };
    draft::examine(&recording, &mut |_, _| ControlFlow::Continue(())).unwrap()
}

/// From a recording alone, whose columns have the names that a simulation gives them, comes an experiment whose filters pass.
#[test]
fn a_recording_gives_an_experiment_that_runs() {
    for device in
        ["shared_scanner", "shared_scanner.second_axis", "threshold_scanner", "micro_stage", "piston_mirror"]
    {
        let folder = tempfile::tempdir().unwrap();
        simulated_files(device, folder.path());
        let recording = folder.path().join("shake 1.csv");
        let recordings = [examined(&recording)];
        let wanted = DraftRequest {
            device,
            recordings: &recordings,
            channels: &[],
            numbers: &[],
            rate: None,
            folder: folder.path(),
        };
        let sorted = draft::sort(published(), &wanted).unwrap();
        assert!(sorted.questions.is_empty(), "{device}: {:?}", sorted.questions);
        let draft = draft::write(published(), sorted, &wanted).unwrap();
        let path = folder.path().join("shake.toml");
        fs::write(&path, &draft.text).unwrap();
        let (experiment, noises) = load_with_noise(published(), &path, &Silent).unwrap();
        assert!(!noises.is_empty(), "{device}");
        assert!(experiment.simulate.is_none() && draft.text.contains("file = \"shake 1.csv\""));
        // What is told of the recording: its swing.
        assert!(
            draft.recognised.iter().any(|sentence| sentence.contains("a swing")),
            "{:?}",
            draft.recognised
        );
        let outcome = estimate(published(), &experiment, &Silent).unwrap();
        assert_passes(&Metrics::of(&outcome), device);
    }
}

#[test]
fn a_channel_that_the_recording_does_not_determine_is_asked_for() {
    let folder = tempfile::tempdir().unwrap();
    let recording = folder.path().join("scope.csv");
    let rows: Vec<String> = (0..200).map(|k| format!("{k}e-6,{},{}\n", k % 7, k % 5)).collect();
    fs::write(&recording, format!("time_s,CH1_V,CH2_V\n{}", rows.concat())).unwrap();
    let recordings = [examined(&recording)];
    let mut wanted = DraftRequest {
        device: "shared_scanner",
        recordings: &recordings,
        channels: &[],
        numbers: &[],
        rate: None,
        folder: folder.path(),
    };
    let sorted = draft::sort(published(), &wanted).unwrap();
    let open = draft::write(published(), sorted, &wanted).unwrap_err();
    assert_eq!(
        open.to_string(),
        "`scope.csv`: `drive`, the voltage that drives the device, may be `CH1_V` and `CH2_V`; state which, such as `--channel drive=CH1_V`\n\
         `scope.csv`: `signal`, the output of the readout, may be `CH1_V` and `CH2_V`; state which, such as `--channel signal=CH1_V`"
    );
    let stated = [("signal".to_owned(), "CH1_V".to_owned())];
    wanted.channels = &stated;
    let sorted = draft::sort(published(), &wanted).unwrap();
    let draft = draft::write(published(), sorted, &wanted).unwrap();
    assert!(draft.text.contains("noise_variance = \"from_recording\""), "{}", draft.text);
    assert!(draft.text.contains("channels = { signal = \"CH1_V\", drive = \"CH2_V\" }"), "{}", draft.text);
    wanted.device = "piston";
    let unknown = draft::sort(published(), &wanted).unwrap_err();
    assert!(matches!(&unknown, DraftError::Device { found, .. } if found == "piston"), "{unknown}");
}
