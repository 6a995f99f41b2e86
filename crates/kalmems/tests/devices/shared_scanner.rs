//! The shared-electrode scanner's example through the public steps, against an independent filter.

mod regulation;

use kalmems::config::Experiment;
use kalmems::estimate::LockEvent;
use kalmems::evaluate::Grade;
use kalmems::figures::{Figure, Series, Shape};
use kalmems::progress::Silent;
use kalmems::results::{
    Metrics, Output, ResultWriteError, RunInfo, Verdict, Work, WriteOptions, estimate_figures, notices,
    write_estimate,
};
use kalmems::rigs::published;
use kalmems::workflow::{self, Outcome};
use std::path::PathBuf;

fn example(file: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../examples/shared_scanner").join(file)
}

/// An example's experiment with some of its text replaced.
fn changed(file: &str, changes: &[(&str, &str)]) -> Experiment {
    let path = example(file);
    let mut text = std::fs::read_to_string(&path).unwrap();
    for (from, to) in changes {
        assert!(text.contains(from), "{from}");
        text = text.replace(from, to);
    }
    published().parse(&text, &path).unwrap()
}

fn run(experiment: &Experiment) -> (Outcome, Metrics) {
    let outcome = workflow::estimate(published(), experiment, &Silent).unwrap();
    let metrics = Metrics::of(&outcome);
    (outcome, metrics)
}

const Q: &str = "1e8 rad^2/s^3";

#[test]
fn with_the_true_stiffness_the_filters_reach_what_an_independent_one_reached() {
    let expected: serde_json::Value =
        serde_json::from_str(&std::fs::read_to_string(example("expected.json")).unwrap()).unwrap();
    for q in ["1e4", "1e6", "1e8"] {
        let experiment = changed("true_stiffness.toml", &[(Q, &format!("{q} rad^2/s^3"))]);
        let (_, metrics) = run(&experiment);
        for estimator in metrics.estimators().filter(|e| e.key != "model_alone") {
            let power = q.trim_start_matches("1e");
            let achieved = &expected["achieved"][format!("{}2_q1e+0{power}", estimator.key)];
            let errors = estimator.errors.as_ref().unwrap();
            for (ours, key) in [
                (errors.angle.rmse_deg, "angle_rmse_deg"),
                (errors.peak_phase_rmse_deg.unwrap(), "peak_phase_rmse_deg"),
            ] {
                let theirs = achieved[key].as_f64().unwrap();
                // With the least process noise the independent filter's own steps and interpolation are the larger part of its error.
                let least = if q == "1e4" { 0.5 } else { 0.95 };
                assert!(
                    (least..1.05).contains(&(ours / theirs)),
                    "{} {q} {key}: {ours} {theirs}",
                    estimator.key
                );
            }
            assert!(estimator.lock.held() && !errors.sign_disagrees);
            assert_eq!(errors.peaks_without_partner, 0);
            assert_eq!(estimator.counts.updates, 24_001);
        }
    }
}

#[test]
fn with_a_wrong_stiffness_the_filter_is_ten_times_better_than_the_model_alone() {
    let (_, metrics) = run(&changed("experiment.toml", &[]));
    let errors = |key| metrics.estimators().find(|e| e.key == key).unwrap().errors.clone().unwrap();
    let (model, ekf) = (errors("model_alone"), errors("ekf"));
    assert!(model.angle.rmse_deg > 1.0, "the model alone misses by degrees: {}", model.angle.rmse_deg);
    assert!(model.angle.rmse_deg > 10.0 * ekf.angle.rmse_deg);
    assert!(model.peak_phase_rmse_deg.unwrap() > 10.0 * ekf.peak_phase_rmse_deg.unwrap());
    // The filter knows that something is wrong: the mean NIS is above its interval.
    let ekf = metrics.estimators().find(|e| e.key == "ekf").unwrap();
    assert_eq!(ekf.verdict, Verdict::Overconfident);
}

#[test]
fn a_filter_with_too_small_process_noise_loses_lock_and_reports_it() {
    let (_, metrics) = run(&changed("experiment.toml", &[(Q, "1e2 rad^2/s^3")]));
    for estimator in metrics.estimators() {
        let expected = if estimator.key == "model_alone" { Verdict::Astray } else { Verdict::LostLock };
        assert_eq!(estimator.verdict, expected, "{}", estimator.name);
        assert!(!estimator.lock.held());
    }
}

/// All bits of what the filters say.
fn bits(outcome: &Outcome) -> Vec<u64> {
    let trajectories = outcome.recordings[0].segments[0].estimate.trajectories.iter();
    trajectories
        .flat_map(|t| {
            let states = t.states.iter().flat_map(|s| s.mean.iter().chain(&s.sd));
            states.chain(&t.innovation).chain(&t.nis).map(|v| v.to_bits()).collect::<Vec<_>>()
        })
        .collect()
}

#[test]
fn deleting_the_reference_changes_no_estimate() {
    let with = run(&changed("experiment.toml", &[])).0;
    let folder = tempfile::tempdir().unwrap();
    std::fs::copy(example("recording.csv"), folder.path().join("recording.csv")).unwrap();
    let text = std::fs::read_to_string(example("experiment.toml")).unwrap();
    let start = text.find("[recording.reference]").unwrap();
    let end = text.find("[estimate]").unwrap();
    let path = folder.path().join("experiment.toml");
    std::fs::write(&path, format!("{}{}", &text[..start], &text[end..])).unwrap();
    let experiment = published().load(&path).unwrap();
    let (without, metrics) = run(&experiment);
    assert_eq!(bits(&with), bits(&without));
    assert!(metrics.estimators().all(|e| e.errors.is_none() && e.verdict != Verdict::WrongSign));

    // A reference of the opposite sign, too, is seen by the evaluation alone.
    let reference = std::fs::read_to_string(example("reference.csv")).unwrap();
    let mut mirrored = String::new();
    for (i, line) in reference.lines().enumerate() {
        let cells: Vec<&str> = line.split(',').collect();
        let negated = |cell: &str| cell.strip_prefix('-').map_or(format!("-{cell}"), str::to_owned);
        if i == 0 {
            mirrored += line;
        } else {
            mirrored += &format!("{},{},{}", cells[0], negated(cells[1]), negated(cells[2]));
        }
        mirrored += "\n";
    }
    std::fs::write(folder.path().join("reference.csv"), mirrored).unwrap();
    std::fs::write(&path, text).unwrap();
    let (opposite, metrics) = run(&published().load(&path).unwrap());
    assert_eq!(bits(&with), bits(&opposite));
    assert!(metrics.estimators().filter(|e| e.key != "model_alone").all(|e| e.verdict == Verdict::WrongSign));
    let says =
        |metrics: &Metrics, text: &str| notices(metrics).iter().any(|notice| notice.text.contains(text));
    assert!(says(&metrics, "estimate.first_peak") && !says(&metrics, "scale = -1"));
    // Of a device whose signal tells the sign there is no such key.
    let mut told_by_signal = metrics;
    told_by_signal.recordings[0].segments[0].sign_is_hidden = false;
    assert!(!says(&told_by_signal, "estimate.first_peak") && says(&told_by_signal, "scale = -1"));
}

#[test]
fn the_sign_is_an_input() {
    let (positive, _) = run(&changed("experiment.toml", &[]));
    let (negative, _) = run(&changed("experiment.toml", &[("\"positive\"", "\"negative\"")]));
    let (free, metrics) = run(&changed("experiment.toml", &[("first_peak = \"positive\"", "")]));
    let angle = |outcome: &Outcome, k: usize| {
        outcome.recordings[0].segments[0].estimate.trajectories[k].state("angle").unwrap().mean.clone()
    };
    for k in 0..3 {
        let mirrored: Vec<f64> = angle(&negative, k).iter().map(|a| -a).collect();
        assert_eq!(angle(&positive, k), mirrored);
    }
    // Without it the sign is that of the start, and nothing is mirrored.
    assert!(metrics.estimators().all(|e| !e.mirrored));
    assert_eq!(free.recordings[0].segments[0].estimate.trajectories.len(), 3);
    // Had the filter started mirrored, it would have said the mirrored thing to the last bit.
    let (other_start, _) =
        run(&changed("experiment.toml", &[("angle = \"0.05 rad\"", "angle = \"-0.05 rad\"")]));
    assert_eq!(angle(&positive, 1), angle(&other_start, 1));
}

#[test]
fn a_start_at_exactly_zero_is_refused_with_the_reason() {
    let experiment = changed("experiment.toml", &[("angle = \"0.05 rad\"", "angle = \"0 rad\"")]);
    let error = workflow::estimate(published(), &experiment, &Silent).unwrap_err().to_string();
    assert!(error.contains("experiment.toml:") && error.contains("estimate.filter[0].start"), "{error}");
    assert!(error.contains("symmetric"), "{error}");
    // Hardly more than zero is enough.
    let experiment = changed("experiment.toml", &[("angle = \"0.05 rad\"", "angle = \"1e-6 rad\"")]);
    let (_, metrics) = run(&experiment);
    assert!(metrics.estimators().find(|e| e.key == "ekf").unwrap().lock.held());
}

#[test]
fn a_change_of_branch_on_the_way_is_told() {
    // A stiffness 2 % wrong, held by much process noise; then no signal for some time, while the model runs away at
    // its own frequency, until the signal, which is even in the angle, catches the motion or its mirror image.
    let mut mirrored = 0;
    for gap in [1300, 1700, 1900, 2100, 2300] {
        let (folder, _) = edited(|row, mut cells| {
            if (12_000..12_000 + gap).contains(&row) {
                cells[2].clear();
            }
            Some(cells)
        });
        let toml = std::fs::read_to_string(example("experiment.toml")).unwrap();
        let toml = toml.replace("1.1033e-4 N m", "1.122e-4 N m").replace(Q, "1e10 rad^2/s^3");
        let experiment = published().parse(&toml, &folder.path().join("experiment.toml")).unwrap();
        let (_, metrics) = run(&experiment);
        for estimator in metrics.estimators().filter(|e| e.key != "model_alone") {
            // The reference knows: mirrored for the rest of the record, the error is that of twice the motion.
            let is_mirrored = estimator.errors.as_ref().unwrap().angle.rmse_deg > 5.0;
            // Each is told; the second leads back.
            let flips =
                estimator.lock.events.iter().filter(|e| matches!(e, LockEvent::Flipped { .. })).count();
            assert_eq!(flips % 2 == 1, is_mirrored, "{gap} {}: {:?}", estimator.name, estimator.lock);
            if is_mirrored {
                assert_eq!(estimator.verdict, Verdict::LostLock);
                mirrored += 1;
            }
        }
    }
    assert!(mirrored >= 2);
}

/// The example's recording with some rows changed by `f(row, cells)`; `None` leaves a row out.
fn edited(f: impl Fn(usize, Vec<String>) -> Option<Vec<String>>) -> (tempfile::TempDir, Experiment) {
    let folder = tempfile::tempdir().unwrap();
    let recording = std::fs::read_to_string(example("recording.csv")).unwrap();
    let mut text = String::new();
    for (row, line) in recording.lines().enumerate() {
        let cells = line.split(',').map(str::to_owned).collect();
        if let Some(cells) = if row == 0 { Some(cells) } else { f(row - 1, cells) } {
            text += &cells.join(",");
            text += "\n";
        }
    }
    std::fs::write(folder.path().join("recording.csv"), text).unwrap();
    for file in ["experiment.toml", "reference.csv"] {
        std::fs::copy(example(file), folder.path().join(file)).unwrap();
    }
    let experiment = published().load(&folder.path().join("experiment.toml")).unwrap();
    (folder, experiment)
}

#[test]
fn what_is_missing_is_predicted_and_counted() {
    // 40 samples without a signal, 30 without a drive, 200 rows left out.
    let (_folder, experiment) = edited(|row, mut cells| {
        if (12_000..12_040).contains(&row) {
            cells[2] = if row % 2 == 0 { String::new() } else { "nan".to_owned() };
        }
        if (14_000..14_030).contains(&row) {
            cells[1] = String::new();
        }
        (!(16_000..16_200).contains(&row)).then_some(cells)
    });
    let (outcome, metrics) = run(&experiment);
    let ekf = metrics.estimators().find(|e| e.key == "ekf").unwrap();
    assert_eq!(ekf.counts.without_signal, 40);
    assert_eq!(ekf.counts.drive_from_sine, 30);
    assert_eq!(ekf.counts.bridged, 200);
    assert_eq!(ekf.counts.updates, 24_001 - 240);
    assert!(ekf.lock.held(), "{:?}", ekf.lock);
    let trajectory = &outcome.recordings[0].segments[0].estimate.trajectories[1];
    assert!(trajectory.nis[12_010].is_nan() && trajectory.states[0].mean[12_010].is_finite());
    // Over the gap the variance of the angle grows by about q·t/2ω², what white acceleration does to an oscillator.
    let sd = &trajectory.states[0].sd;
    let grown = (sd[16_000].powi(2) - sd[15_999].powi(2)) / (1e8 * 200e-6 / (2.0 * (1.1033e-4 / 1.15e-14)));
    assert!((0.4..1.5).contains(&grown), "{grown}");
    assert!(ekf.errors.as_ref().unwrap().angle.rmse_deg < 0.1);
    assert_eq!(
        outcome.recordings[0].recording.diagnosis().len(),
        4,
        "{:?}",
        outcome.recordings[0].recording.diagnosis()
    );
}

#[test]
fn irregular_sampling_is_integrated_as_it_is() {
    // Every third of some samples left out: intervals of one and two.
    let (_folder, experiment) = edited(|row, cells| (row < 10_000 || row % 3 != 1).then_some(cells));
    let (_, metrics) = run(&experiment);
    let ekf = metrics.estimators().find(|e| e.key == "ekf").unwrap();
    assert!(ekf.lock.held());
    assert!(ekf.errors.as_ref().unwrap().angle.rmse_deg < 0.08, "{:?}", ekf.errors);
}

#[test]
fn a_drive_that_is_unknown_is_refused_where_filters_have_begun_and_passed_over_where_none_has() {
    // A drive that is no sine, with a hole.
    let with_hole = |hole: usize| {
        edited(move |row, mut cells| {
            let t = row as f64 * 1e-6;
            cells[1] = format!("{}", 90.0 * (std::f64::consts::TAU * (30e3 + 2e5 * t) * t).sin());
            if row == hole {
                cells[1] = String::new();
            }
            Some(cells)
        })
    };
    let (_folder, experiment) = with_hole(20_000);
    let error = workflow::estimate(published(), &experiment, &Silent).unwrap_err().to_string();
    assert!(error.contains("`drive_V`") && error.contains("0.02 s") && error.contains("split"), "{error}");
    let (_folder, experiment) = with_hole(700);
    let stretches = &workflow::estimate(published(), &experiment, &Silent).unwrap().recordings[0].stretches;
    let [left_out] = &stretches.first_left_out[..] else { panic!("{stretches:?}") };
    assert!(left_out.samples == 1024 && left_out.why.contains("7e-4 s"), "{left_out:?}");
    let (_folder, experiment) = edited(|row, cells| (row < 8000).then_some(cells));
    let error = workflow::estimate(published(), &experiment, &Silent).unwrap_err().to_string();
    assert!(error.contains("settling time"), "{error}");
    let (_folder, experiment) = edited(|_, mut cells| {
        cells[2] = String::new();
        Some(cells)
    });
    let error = workflow::estimate(published(), &experiment, &Silent).unwrap_err().to_string();
    assert!(error.contains("no finite sample"), "{error}");
}

#[test]
fn segments_are_estimated_each_by_itself() {
    let (folder, _) = edited(|_, cells| Some(cells));
    let recording = std::fs::read_to_string(example("recording.csv")).unwrap();
    let mut text = String::from("record,time_s,drive_V,cap_V\n");
    for label in ["first", "second"] {
        for line in recording.lines().skip(1) {
            text += &format!("{label},{line}\n");
        }
    }
    std::fs::write(folder.path().join("recording.csv"), text).unwrap();
    let toml = std::fs::read_to_string(example("experiment.toml")).unwrap();
    let toml = toml.replace("clock = {", "segments = { column = \"record\" }\nclock = {");
    let start = toml.find("[recording.reference]").unwrap();
    let end = toml.find("[estimate]").unwrap();
    let toml = format!("{}{}", &toml[..start], &toml[end..]);
    let experiment = published().parse(&toml, &folder.path().join("experiment.toml")).unwrap();
    let (outcome, _) = run(&experiment);
    let [first, second] = outcome.recordings[0].segments.as_slice() else { panic!() };
    assert_eq!(
        (first.estimate.segment.label.as_str(), second.estimate.segment.label.as_str()),
        ("first", "second")
    );
    assert_eq!(first.estimate.trajectories[1].states[0].mean, second.estimate.trajectories[1].states[0].mean);
}

/// All points of the series with this label in the figure with this name.
fn points(figures: &[Figure], id: &str, label: &str) -> Vec<[f64; 2]> {
    let figure = figures.iter().find(|figure| figure.id == id).unwrap();
    let series = |series: &&Series| series.label() == label;
    let found = figure.panels.iter().flat_map(|panel| &panel.series).find(series).unwrap();
    match found.shape() {
        Shape::Line(runs) => runs.concat(),
        Shape::Points(points) => points.clone(),
        other => panic!("{other:?}"),
    }
}

#[test]
fn the_pictures_show_the_figures_beside_them() {
    let (outcome, metrics) = run(&changed("experiment.toml", &[]));
    let segment = &outcome.recordings[0].segments[0];
    let figures = estimate_figures(&outcome.recordings[0], segment, "", None);
    let ids: Vec<&str> = figures.iter().map(|figure| figure.id.as_str()).collect();
    assert_eq!(ids, ["motion", "angle_error", "phase_error", "nis"]);
    for (estimator, trajectory) in metrics.estimators().zip(&segment.estimate.trajectories) {
        // Its answer is that of the EKF, as the captions say.
        if estimator.key == "ukf" {
            for id in ["angle_error", "nis"] {
                let figure = figures.iter().find(|figure| figure.id == id).unwrap();
                let labels = figure.panels.iter().flat_map(|panel| &panel.series).map(Series::label);
                assert!(labels.into_iter().all(|label| label != "UKF"), "{id}");
                assert!(figure.caption.contains("UKF agrees with EKF within 1 %"), "{}", figure.caption);
            }
            continue;
        }
        let label = if estimator.key == "model_alone" { "Model alone (astray)" } else { &estimator.name };
        let errors = estimator.errors.as_ref().unwrap();
        // The decimated error keeps its extremes.
        let drawn = points(&figures, "angle_error", label);
        let largest = drawn.iter().map(|p| p[1].abs()).fold(0.0, f64::max);
        assert!((largest - errors.angle.largest_deg).abs() < 1e-12);
        assert!(drawn.len() <= 4 * 800 && drawn.first().unwrap()[0] >= 0.008);
        // Each peak's phase error is there, and their root mean square is the one in the table.
        let drawn = points(&figures, "phase_error", label);
        assert_eq!(drawn.len(), errors.peaks);
        let rms = (drawn.iter().map(|p| p[1] * p[1]).sum::<f64>() / drawn.len() as f64).sqrt();
        assert!((rms - errors.peak_phase_rmse_deg.unwrap()).abs() < 1e-12);
        if estimator.key != "model_alone" {
            // The cycles' means after the settling time average to the mean NIS but for a cycle at each end.
            let drawn = points(&figures, "nis", label);
            let settled: Vec<f64> = drawn.iter().filter(|p| p[0] > 0.008).map(|p| p[1]).collect();
            let mean = settled.iter().sum::<f64>() / settled.len() as f64;
            assert!((mean - estimator.consistency.unwrap().mean_nis).abs() < 0.005, "{mean}");
        }
        // The close-up of the angle holds the trajectory's own samples.
        let name = if estimator.key == "model_alone" { "Model alone" } else { "EKF" };
        let angle = &trajectory.state("angle").unwrap().mean;
        for point in points(&figures, "motion", name) {
            let k = trajectory.time_s.iter().position(|t| *t == point[0]).unwrap();
            assert_eq!(angle[k].to_degrees(), point[1]);
        }
    }
    // What was predicted is what was measured less the innovation.
    let predicted = points(&figures, "motion", "predicted, EKF");
    let measured = points(&figures, "motion", "measured");
    let trajectory = &segment.estimate.trajectories[1];
    assert!(predicted.len() > 200 && predicted.len() == measured.len());
    for (p, m) in predicted.iter().zip(&measured) {
        let k = trajectory.time_s.iter().position(|t| *t == p[0]).unwrap();
        assert!((m[1] - p[1] - trajectory.innovation[k]).abs() < 1e-12);
    }
}

#[test]
fn writing_that_is_stopped_leaves_nothing() {
    let (outcome, metrics) = run(&changed("experiment.toml", &[]));
    let folder = tempfile::tempdir().unwrap();
    let target = folder.path().join("results");
    let info = RunInfo { started: std::time::SystemTime::UNIX_EPOCH, took: std::time::Duration::ZERO };
    // Stopped at each of the places where it looks, until it looks no more.
    let mut places = 0;
    loop {
        let looks = std::cell::Cell::new(0);
        let stop = || {
            looks.set(looks.get() + 1);
            looks.get() > places
        };
        let output = Output::begin(&target, &Work::named("estimate", "scanner")).unwrap();
        match write_estimate(&outcome, &metrics, &output, WriteOptions::default(), info, &stop) {
            Err(ResultWriteError::Interrupted) => {
                drop(output);
                assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0, "stopped at look {places}");
            }
            written => {
                written.unwrap();
                output.commit().unwrap();
                break;
            }
        }
        places += 1;
    }
    // Behind each trajectory and each figure at least; within them it looks by time.
    assert!(places >= 7, "{places}");
    assert!(target.join("report.html").is_file());
}

/// The notices of the example with its reference's rows changed by `f(row, cells)`.
fn notices_with_reference(f: impl Fn(usize, &mut Vec<String>)) -> Vec<String> {
    let (folder, experiment) = edited(|_, cells| Some(cells));
    let text = std::fs::read_to_string(example("reference.csv")).unwrap();
    let lines = text.lines().enumerate().map(|(row, line)| {
        let mut cells: Vec<String> = line.split(',').map(str::to_owned).collect();
        if row > 0 {
            f(row - 1, &mut cells);
        }
        cells.join(",")
    });
    let text = lines.collect::<Vec<_>>().join("\n") + "\n";
    std::fs::write(folder.path().join("reference.csv"), text).unwrap();
    let (_, metrics) = run(&experiment);
    notices(&metrics).iter().map(ToString::to_string).collect()
}

#[test]
fn what_is_wrong_with_the_reference_is_noted() {
    let said = notices_with_reference(|row, cells| {
        if (9000..9003).contains(&row) {
            cells[1].clear();
        }
    });
    let missing = |notice: &&String| notice.contains("reference.csv: line 9002, column `angle_rad`");
    let found = said.iter().find(missing).unwrap_or_else(|| panic!("{said:?}"));
    assert!(found.contains("the first of 3 cells"), "{found}");

    // A reference of another time: nothing to compare with, and that is said.
    let said = notices_with_reference(|_, cells| {
        let time: f64 = cells[0].parse().unwrap();
        cells[0] = format!("{:.6}", time + 1.0);
    });
    assert!(
        said.iter().any(|notice| notice.contains("no sample of this segment to compare with")),
        "{said:?}"
    );
    // The ordinary example has neither.
    let said = notices_with_reference(|_, _| ());
    assert!(!said.iter().any(|notice| notice.contains("reference.csv")), "{said:?}");
}

/// The claim is held against the reference with the reference's own accuracy, which the experiment may state.
#[test]
fn the_references_own_accuracy_counts() {
    let told = |lines: &str| {
        let table = format!("[recording.reference]\n{lines}");
        changed("experiment.toml", &[("[recording.reference]\n", &table), (Q, "1e7 rad^2/s^3")])
    };
    let claim = |lines: &str| {
        let (_, metrics) = run(&told(lines));
        let ekf = metrics.estimators().find(|e| e.key == "ekf").unwrap();
        (ekf.errors.as_ref().unwrap().angle.claim.unwrap(), ekf.grade)
    };
    let (exact, grade) = claim("");
    assert!(exact.fails() && grade == Some(Grade::Failed), "{exact:?}");
    // With 1° of its own the reference cannot tell the estimate's tenth of one.
    let (rough, _) = claim("sd = { angle = \"1 deg\" }\n");
    assert!(!rough.fails() && rough.within == 1.0 && rough.mean_square < 0.1, "{rough:?}");
    // A delay that may be off by a cycle explains the part of the error that is late.
    let (late, _) = claim("delay_sd = \"60 us\"\n");
    assert!(late.mean_square < exact.mean_square, "{late:?}");
    let refused =
        workflow::estimate(published(), &told("sd = { angel = \"1 deg\" }\n"), &Silent).unwrap_err();
    assert!(refused.to_string().contains("recording[0].reference.sd.angel"), "{refused}");
    let refused =
        workflow::estimate(published(), &told("sd = { angle = \"-1 deg\" }\n"), &Silent).unwrap_err();
    assert!(refused.to_string().contains("recording[0].reference.sd.angle"), "{refused}");
}
