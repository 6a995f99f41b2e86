//! Recordings in parts, and samples that are estimated while they arrive.

use crate::parts::{Pieces, in_parts};
use crate::parts::{Streamed, goes_on_after_a_kill, same_bits_in_a_stream, same_bits_in_parts, streamed};
use crate::threshold::text;
use kalmems::config::Experiment;
use kalmems::estimate::RecordedPassing;
use kalmems::progress::Silent;
use kalmems::recording::SampledRecording;
use kalmems::rigs::published;
use kalmems::stream::{OpenedConnection, StreamOutputs, stream};
use kalmems::workflow::{PartsError, estimate_in_parts};
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

fn example(file: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../examples/threshold_scanner").join(file)
}

const START: &str = "start = { angle = \"-0.102 rad\", rate = \"413 rad/s\" }\n\
                     start_sd = { angle = \"5 mrad\", rate = \"20 rad/s\" }\n";

fn filter(name: &str, lines: &str) -> String {
    format!("[[estimate.filter]]\nname = \"{name}\"\nmethod = \"ekf\"\n{START}{lines}\n")
}

/// The example with an estimate of every sample, these changes, and these filters in place of its own, if there are any.
fn experiment(folder: &Path, changes: &[(&str, &str)], filters: &str) -> Experiment {
    let mut text = std::fs::read_to_string(example("stream.toml")).unwrap();
    if !filters.is_empty() {
        let end = text.find("[[estimate.filter]]").unwrap();
        text.truncate(end);
        text += filters;
    }
    for (from, to) in [("every = 10", "every = 1")].iter().chain(changes) {
        assert!(text.contains(from), "{from}");
        text = text.replace(from, to);
    }
    published().parse(&text, &folder.join("experiment.toml")).unwrap_or_else(|e| panic!("{e}"))
}

fn read(experiment: &Experiment, folder: &Path) -> SampledRecording {
    let layout = published().rig(experiment).unwrap().layout(experiment, 0).unwrap();
    SampledRecording::read(&folder.join("recording.csv"), &layout).unwrap()
}

fn whole_crossings(experiment: &Experiment, recording: &SampledRecording) -> Vec<RecordedPassing> {
    let rig = published().rig(experiment).unwrap();
    rig.estimate(experiment, 0, recording, &Silent).unwrap().swap_remove(0).crossings
}

/// Filters that are told of crossings as soon as they are known, later, sooner, in place and not at all.
fn told_otherwise() -> String {
    let resonance = "states = { natural_frequency = { start_sd = \"1 %\" } }\n";
    [
        filter("late", &format!("threshold = {{ gate = 4 }}\n{resonance}smooth = true\nsmooth_lag = \"150 us\"")),
        filter("later", "threshold = { gate = 4, lag = \"1.9 ms\" }"),
        filter("sooner", "threshold = { timing = \"parabola\", lag = \"100 us\" }"),
        filter(
            "in place",
            "variant = \"literal\"\nthreshold = { timing = \"sample\", applied = \"in_place\", angle_sd = \"2 mrad\" }",
        ),
        filter("timing", &format!("variant = \"timing_only\"\nthreshold = {{ applied = \"in_place\" }}\n{resonance}")),
        filter("alone", ""),
        "[[estimate.filter]]\nname = \"model\"\nmethod = \"model\"\nstart = { angle = \"-0.102 rad\", rate = \"413 rad/s\" }\n"
            .to_owned(),
    ]
    .concat()
}

/// A filter that was told of a decay and is given noise follows what is left of it: it says so, and tells no zero phases. Of the decay itself
/// it tells them all.
#[test]
fn zero_phases_of_noise_are_not_reported() {
    let folder = tempfile::tempdir().unwrap();
    let experiment = experiment(folder.path(), &[], "");
    let mut noise = kalmems::simulate::WhiteNoise::new(20_261_124, 1);
    let mut rows = "time_s,drive_V,cap_V,psd_V\n".to_owned();
    for k in 0..100_000 {
        rows += &format!("{:.6},0,{:.6},0\n", f64::from(k) * 2e-6, 0.0435 * noise.sample());
    }
    let count = |run: &Streamed, event: &str| run.events.iter().filter(|e| e["event"] == event).count();
    let run = streamed(&experiment, std::io::Cursor::new(rows), None);
    // 250 cycles: some 500 zeros of nothing. What is left of the start is gone within a few cycles.
    let (told, begins) = (count(&run, "zero_phase"), count(&run, "motion_in_noise"));
    assert!(told <= 10 && begins >= 1, "{told} told, {begins}");
    let withheld = run.ended.as_ref().unwrap().withheld;
    assert!(withheld > 300, "{withheld}");

    let decay = std::fs::read(example("recording.csv")).unwrap();
    let run = streamed(&experiment, std::io::Cursor::new(decay), None);
    assert_eq!((count(&run, "motion_in_noise"), run.ended.as_ref().unwrap().withheld), (0, 0));
    assert!(count(&run, "zero_phase") > 20);
}

/// A stream cannot be refused for what its samples show: it says once in a stretch that they are clipped or stay, while it runs.
#[test]
fn a_stream_says_while_it_runs_that_its_signal_is_clipped_or_stays() {
    let folder = tempfile::tempdir().unwrap();
    let experiment = experiment(folder.path(), &[], "");
    let text = std::fs::read_to_string(example("recording.csv")).unwrap();
    let signals = text.lines().skip(1).map(|line| line.split(',').nth(2).unwrap().parse::<f64>().unwrap());
    let signals: Vec<f64> = signals.collect();
    let limit = 0.5 * signals.iter().copied().fold(0.0, f64::max);
    // Where it does not come near the rails for a while.
    let is_quiet = |rows: &[f64]| rows.iter().all(|value| value.abs() < limit) && rows[20] != 0.0;
    let hung = 3_000 + signals[3_000..].windows(60).position(is_quiet).unwrap() + 20;
    let (mut last, mut rows) = (String::new(), String::new());
    for (i, line) in text.lines().enumerate() {
        let cells: Vec<&str> = line.split(',').collect();
        let cell = match cells[2].parse::<f64>() {
            Ok(_) if (hung + 2..hung + 20).contains(&i) => last.clone(),
            Ok(value) => value.clamp(-limit, limit).to_string(),
            Err(_) => cells[2].to_owned(),
        };
        last.clone_from(&cell);
        rows += &format!("{},{},{cell},{}\n", cells[0], cells[1], cells[3]);
    }
    let checks = |run: &Streamed| -> Vec<serde_json::Value> {
        run.events.iter().filter(|event| event["event"] == "input_check").cloned().collect()
    };
    let run = streamed(&experiment, std::io::Cursor::new(rows), None);
    let found = checks(&run);
    let kinds: Vec<_> = found.iter().map(|event| event["kind"].as_str().unwrap()).collect();
    assert_eq!(kinds, ["saturation", "stuck"], "{found:#?}");
    for event in &found {
        assert_eq!(event["column"], "cap_V");
        let time_s = event["time_s"].as_f64().unwrap();
        assert!(time_s > 0.0 && time_s <= 0.03, "{event}");
        assert!(event["detail"].as_str().unwrap().starts_with("stays at "), "{event}");
    }
    let clean = streamed(&experiment, std::io::Cursor::new(text.clone()), None);
    assert!(checks(&clean).is_empty(), "{:?}", checks(&clean));
    assert!(clean.ended.is_ok() && run.ended.is_ok());
}

#[test]
fn a_decay_in_parts_gives_the_same_bits() {
    let folder = tempfile::tempdir().unwrap();
    // The example with rows that are not there and signals that are not.
    let text = std::fs::read_to_string(example("recording.csv")).unwrap();
    let mut rows: Vec<String> = Vec::new();
    for (i, line) in text.lines().enumerate() {
        let cells: Vec<&str> = line.split(',').collect();
        match i {
            7_000..7_030 | 9_999 => rows.push(format!("{},{},,", cells[0], cells[1])),
            _ => rows.push(line.to_owned()),
        }
    }
    std::fs::write(folder.path().join("recording.csv"), rows.join("\n")).unwrap();
    for acceptance in ["threshold = 4", "false_alarms = \"10 Hz\"\nkeep = 2"] {
        let experiment = experiment(folder.path(), &[("threshold = 4", acceptance)], &told_otherwise());
        let recording = read(&experiment, folder.path());
        same_bits_in_parts(&experiment, &recording, &[301, 1_000, 4_097]);
        let whole = whole_crossings(&experiment, &recording);
        // Twice in a cycle of 1.6 ms, 24 ms long.
        assert!((28..=31).contains(&whole.len()), "{}", whole.len());
        for length in [1, 4_097] {
            assert_eq!(in_parts(&experiment, &recording, length).crossings, whole);
        }
    }
}

/// A driven mirror's recording: rows of time, drive and signal, and times and angles that are true.
fn driven(duration: &str, seed: u32) -> (Vec<[f64; 3]>, Vec<[f64; 2]>) {
    driven_in_noise(duration, seed, NOISE)
}

/// The variance of the signal in the examples.
const NOISE: &str = "noise_variance = \"1.89225e-3 V^2\"";

/// The same with another variance of the signal.
fn driven_in_noise(duration: &str, seed: u32, noise: &str) -> (Vec<[f64; 3]>, Vec<[f64; 2]>) {
    let usual = text("0.2 pF");
    assert!(usual.contains(NOISE));
    let simulated = usual
        .replace(NOISE, noise)
        .replace("seed = 1", &format!("seed = {seed}"))
        .replace("\"-0.105 rad\", rate = \"420 rad/s\"", "\"1 mrad\", rate = \"0 rad/s\"")
        .replace("duration = \"80 ms\"", &format!("duration = \"{duration}\""))
        + "\n[simulate.drive.capture]\nvoltage = \"60 V\"\nfrom = \"1400 Hz\"\nto = \"1266 Hz\"\nsweep = \"1 s\"\n\
           hold = \"0.1 s\"\n";
    let experiment =
        published().parse(&simulated, Path::new("driven.toml")).unwrap_or_else(|e| panic!("{e}"));
    let simulation = published().rig(&experiment).unwrap().simulate(&experiment).unwrap();
    let (mut rows, mut truth) = (Vec::new(), Vec::new());
    simulation
        .run(&mut |sample| {
            rows.push([sample.time_s, sample.recorded[0], sample.recorded[1]]);
            truth.push([sample.time_s, sample.truth[0]]);
            ControlFlow::Continue(())
        })
        .unwrap();
    (rows, truth)
}

/// The device under its drive, whose feedthrough is told 5 % wrong.
const DRIVEN: [(&str, &str); 6] = [
    ("feedthrough_capacitance = \"0 F\"", "feedthrough_capacitance = \"0.21 pF\""),
    ("[[recording]]", "[device.threshold_scanner.drive]\ngain = \"60 rad/s^2/V^2\"\n[[recording]]"),
    ("natural_frequency = \"629.6 Hz\"", "natural_frequency = \"624.6 Hz\""),
    ("role = \"ring_down\"", "role = \"steady_state\""),
    (
        "columns = [\"time_s\", \"drive_V\", \"cap_V\", \"psd_V\"]",
        "columns = [\"time_s\", \"drive_V\", \"cap_V\"]",
    ),
    (
        START,
        "start = { angle = \"0.09 rad\", rate = \"490 rad/s\" }\nstart_sd = { angle = \"50 mrad\", rate = \"200 rad/s\" }\n",
    ),
];

const FEEDTHROUGH: &str = "states = { feedthrough = { start_sd = \"10 %\" } }\n";

fn csv(rows: impl Iterator<Item = String>) -> String {
    rows.fold("time_s,drive_V,cap_V\n".to_owned(), |text, row| text + &row + "\n")
}

#[test]
fn a_driven_motion_in_parts_gives_the_same_bits() {
    let folder = tempfile::tempdir().unwrap();
    let (rows, _) = driven("40 ms", 1);
    // Rows that are not there, and drives that are not: those beside where a part of 4096 or 5000 rows ends, too.
    let text = csv(rows.iter().enumerate().filter_map(|(i, [time_s, drive, signal])| match i {
        6_000..6_040 | 12_288..12_290 => None,
        4_090..4_110 | 5_200..5_203 | 8_000 | 9_090..9_120 | 16_500 => Some(format!("{time_s},,{signal}")),
        _ => Some(format!("{time_s},{drive},{signal}")),
    }));
    std::fs::write(folder.path().join("recording.csv"), text).unwrap();
    let filters =
        filter("late", &format!("threshold = {{ gate = 4 }}\n{FEEDTHROUGH}smooth_lag = \"150 us\""))
            + &filter(
                "in place",
                &format!("threshold = {{ applied = \"in_place\", gate = 4 }}\n{FEEDTHROUGH}"),
            );
    let experiment = experiment(folder.path(), &DRIVEN, &filters);
    let recording = read(&experiment, folder.path());
    same_bits_in_parts(&experiment, &recording, &[700, 4_096, 5_000]);
    let whole = published().rig(&experiment).unwrap().estimate(&experiment, 0, &recording, &Silent).unwrap();
    let counts = whole[0].trajectories[0].counts;
    assert!(counts.drive_from_sine > 50 && counts.bridged > 40 && counts.crossings > 40, "{counts:?}");
}

#[test]
fn a_stream_equals_the_estimate_and_reports_the_crossings() {
    let bytes = std::fs::read(example("recording.csv")).unwrap();
    let folder = example("");
    for (filters, longest) in [(String::new(), 60), (told_otherwise().replace("smooth = true\n", ""), 30_000)]
    {
        let experiment = experiment(&folder, &[], &filters);
        let recording = read(&experiment, &folder);
        let (events, summary) = same_bits_in_a_stream(&experiment, &recording, (&bytes, longest));
        assert_eq!(summary.estimated, 12_001);
        let told: Vec<(f64, f64)> = (events.iter())
            .filter(|event| event["event"] == "crossing")
            .map(|event| {
                assert!(event["threshold_rad"] == 3.7e-3 && event.get("estimator").is_none());
                (event["time_s"].as_f64().unwrap(), event["sd_s"].as_f64().unwrap())
            })
            .collect();
        let whole: Vec<(f64, f64)> =
            whole_crossings(&experiment, &recording).iter().map(|c| (c.time_s, c.sd_s)).collect();
        // JSON is read to the last digit but one.
        let same = |a: f64, b: f64| (a - b).abs() <= 1e-15 * b;
        let pairs = || told.iter().zip(&whole);
        assert!(told.len() == whole.len() && told.len() >= 28, "{told:?}");
        assert!(pairs().all(|(a, b)| same(a.0, b.0) && same(a.1, b.1)), "{told:?} {whole:?}");
        let zeros = |key: &str| {
            let of = |e: &&serde_json::Value| e["event"] == "zero_phase" && e["estimator"] == key;
            events.iter().filter(of).count()
        };
        // 19 ms after the settling time are 23.7 half cycles.
        let key = if filters.is_empty() { "hybrid" } else { "late" };
        assert!((23..=24).contains(&zeros(key)), "{}", zeros(key));
    }
}

/// When the threshold was passed, in s.
fn passes(truth: &[[f64; 2]]) -> Vec<f64> {
    (truth.windows(2))
        .filter(|pair| (pair[0][1] < 3.7e-3) != (pair[1][1] < 3.7e-3))
        .map(|pair| {
            let share = (3.7e-3 - pair[0][1]) / (pair[1][1] - pair[0][1]);
            pair[0][0] + share * (pair[1][0] - pair[0][0])
        })
        .collect()
}

/// By how many of its standard deviations each crossing that is told is off the nearest one.
fn errors(events: &[serde_json::Value], passes: &[f64]) -> Vec<f64> {
    (events.iter())
        .filter(|event| event["event"] == "crossing")
        .map(|event| {
            let [time_s, sd_s] = ["time_s", "sd_s"].map(|name| event[name].as_f64().unwrap());
            let nearest = passes.iter().map(|pass| time_s - pass).min_by(|a, b| a.abs().total_cmp(&b.abs()));
            nearest.unwrap() / sd_s
        })
        .collect()
}

/// In a noise whose slopes are a third of the signal's, crossings are told without their zeros, and it is said of each and of all
/// together.
#[test]
fn the_crossings_of_a_stream_in_strong_noise_claim_what_they_are_off() {
    let noise = "noise_variance = \"3.0 V^2\"";
    let (mut off, mut by_fallback, mut refused) = (Vec::new(), 0, 0);
    for seed in [11, 12, 13, 14] {
        let (rows, truth) = driven_in_noise("80 ms", seed, noise);
        let text = csv(rows.iter().map(|[time_s, drive, signal]| format!("{time_s},{drive},{signal}")));
        let strong = [("0.21 pF", "0.2 pF"), (NOISE, noise), ("threshold = 4\n", "threshold = 2\n")];
        let changes: Vec<(&str, &str)> = DRIVEN.into_iter().chain(strong).collect();
        let experiment = experiment(Path::new("."), &changes, &filter("late", "threshold = { gate = 4 }"));
        let Streamed { events, ended, .. } = streamed(&experiment, Pieces::of(text.into_bytes(), 900), None);
        let summary = ended.unwrap();
        let said = events.iter().filter(|event| event["event"] == "crossing" && event["fallback"] == true);
        assert_eq!(said.count() as u64, summary.crossings_by_fallback);
        by_fallback += summary.crossings_by_fallback;
        refused += summary.crossings_refused;
        off.extend(errors(&events, &passes(&truth)));
    }
    let rms = (off.iter().map(|z| z * z).sum::<f64>() / off.len() as f64).sqrt();
    let within = off.iter().filter(|z| z.abs() <= 3.0).count() as f64 / off.len() as f64;
    println!(
        "{} crossings, {by_fallback} by fallback, {refused} refused: {rms:.2} sd, {within:.3} within 3",
        off.len()
    );
    assert!(off.len() >= 200 && by_fallback >= 100, "{} {by_fallback}", off.len());
    assert!((0.7..=1.2).contains(&rms) && within >= 0.97, "{rms} {within}");
}

/// The crossings that a stream tells are when the simulated mirror passed the threshold, as well as they say.
#[test]
fn the_crossings_of_a_stream_are_those_of_the_mirror() {
    let (rows, truth) = driven("80 ms", 3);
    let text = csv(rows.iter().map(|[time_s, drive, signal]| format!("{time_s},{drive},{signal}")));
    let right = [("0.21 pF", "0.2 pF")];
    let changes: Vec<(&str, &str)> = DRIVEN.into_iter().chain(right).collect();
    let experiment = experiment(Path::new("."), &changes, &filter("late", "threshold = { gate = 4 }"));
    let Streamed { events, ended, .. } = streamed(&experiment, Pieces::of(text.into_bytes(), 900), None);
    // At the ends samples are missing that a zero is fitted to.
    assert!(ended.unwrap().crossings_by_fallback <= 2);
    let passes = passes(&truth);
    let off = errors(&events, &passes);
    // All but those at the ends.
    assert!((passes.len() - 3..=passes.len()).contains(&off.len()), "{} {}", off.len(), passes.len());
    let rms = (off.iter().map(|z| z * z).sum::<f64>() / off.len() as f64).sqrt();
    println!("{} crossings, off by {rms:.2} of their standard deviation", off.len());
    assert!((0.8..1.25).contains(&rms) && off.iter().all(|z| z.abs() < 4.5), "{rms} {off:?}");
}

#[test]
fn a_stream_that_was_killed_goes_on_with_its_crossings() {
    let bytes = std::fs::read(example("recording.csv")).unwrap();
    for filters in [String::new(), told_otherwise().replace("smooth = true\n", "")] {
        let experiment = experiment(&example(""), &[], &filters);
        let [whole, first, second] = goes_on_after_a_kill(&experiment, &bytes, 0.7, 9e-3);
        let times = |events: &[serde_json::Value]| -> Vec<f64> {
            let crossings = events.iter().filter(|event| event["event"] == "crossing");
            crossings.map(|event| event["time_s"].as_f64().unwrap()).collect()
        };
        let [whole, first, second] = [&whole, &first, &second].map(|events| times(events));
        assert!(whole.len() >= 28 && first.len() < whole.len() && second.len() < whole.len());
        // None is lost, and none is made up.
        let same = |a: &f64, b: &f64| (a - b).abs() < 1e-12;
        for crossing in &whole {
            assert!(first.iter().chain(&second).any(|other| same(crossing, other)), "{crossing}");
        }
        for crossing in first.iter().chain(&second) {
            assert!(whole.iter().any(|other| same(crossing, other)), "{crossing}");
        }
    }
}

#[test]
fn a_killed_stream_goes_on_where_columns_have_a_factor_and_an_offset() {
    let text = std::fs::read_to_string(example("recording.csv")).unwrap();
    let mut rows = text.lines();
    let mut scaled = format!("{}\n", rows.next().unwrap());
    for row in rows {
        let mut cells: Vec<String> = row.split(',').map(str::to_owned).collect();
        cells[2] = ((cells[2].parse::<f64>().unwrap() - 0.1) / 2.5).to_string();
        scaled += &(cells.join(",") + "\n");
    }
    let said = "signal = { column = \"cap_V\", scale = 2.5, offset = \"0.1 V\" }";
    let experiment = experiment(&example(""), &[("signal = \"cap_V\"", said)], "");
    let [whole, ..] = goes_on_after_a_kill(&experiment, scaled.as_bytes(), 0.7, 9e-3);
    assert!(whole.iter().any(|event| event["event"] == "crossing"));
}

#[test]
fn what_cannot_be_streamed_is_refused_by_name() {
    let folder = example("");
    let said = |changes: &[(&str, &str)], bytes: &[u8], words: &[&str]| {
        let (experiment, input) = (
            experiment(&folder, changes, ""),
            Box::new(OpenedConnection::new(Pieces::of(bytes.to_vec(), 1000))),
        );
        let error = stream(published(), &experiment, input, StreamOutputs::default(), None, &|| false)
            .unwrap_err()
            .to_string();
        assert!(words.iter().all(|word| error.contains(word)), "{error}");
    };
    said(
        &[("smooth_lag = \"100 us\"", "smooth = true")],
        &[],
        &["`smooth = true`", "smooth_lag", "kalmems estimate"],
    );
    let bytes = std::fs::read(example("recording.csv")).unwrap();
    said(&[("\"2.82 mV s/rad\"", "\"-2.82 mV s/rad\"")], &bytes, &["opposite sign", "swap the leads"]);
    // More rows are there than the crossings need, as a filter may be started again by them: a rate that is stated too low does no harm.
    let slow = experiment(&folder, &[("rate = \"500 kHz\"", "rate = \"200 kHz\"")], "");
    let input = Box::new(OpenedConnection::new(Pieces::of(bytes, 1000)));
    let ended = stream(published(), &slow, input, StreamOutputs::default(), None, &|| false).unwrap();
    assert_eq!((ended.estimated, ended.not_estimated), (12_001, 0));
}

/// A recording of several parts in bounded memory is that in memory; one that is no good is named at its end.
#[test]
fn a_long_recording_is_estimated_in_parts_and_refused_by_all_of_it() {
    let folder = tempfile::tempdir().unwrap();
    let (rows, _) = driven("280 ms", 2);
    let line = |[time_s, drive, signal]: &[f64; 3]| format!("{time_s},{drive},{signal}");
    let filters = filter("late", &format!("threshold = {{ gate = 4, lag = \"1 ms\" }}\n{FEEDTHROUGH}"))
        + &filter("in place", &format!("threshold = {{ applied = \"in_place\", gate = 4 }}\n{FEEDTHROUGH}"));
    let experiment = experiment(folder.path(), &DRIVEN, &filters);
    let path = folder.path().join("recording.csv");
    let outcome = |rows: &mut dyn Iterator<Item = String>| {
        std::fs::write(&path, csv(rows)).unwrap();
        let mut parts = Vec::new();
        let whole = estimate_in_parts(published(), &experiment, &Silent, &mut |part| {
            parts.push(part.outcome.segments[0].estimate.clone());
            Ok::<(), ()>(())
        });
        match whole {
            Ok(_) => Ok(parts),
            Err(PartsError::Work(why)) => Err(why.to_string()),
            Err(PartsError::Taken(())) => unreachable!("every part is taken"),
        }
    };
    let parts = outcome(&mut rows.iter().map(line)).unwrap();
    assert_eq!(parts.len(), 3);
    let whole = published().rig(&experiment).unwrap().estimate(
        &experiment,
        0,
        &read(&experiment, folder.path()),
        &Silent,
    );
    let whole = &whole.unwrap()[0];
    let bits = |values: &mut dyn Iterator<Item = &f64>| values.map(|v| v.to_bits()).collect::<Vec<u64>>();
    for (i, trajectory) in whole.trajectories.iter().enumerate() {
        for (j, state) in trajectory.states.iter().enumerate() {
            let states = || parts.iter().map(|part| &part.trajectories[i].states[j]);
            assert!(
                bits(&mut states().flat_map(|s| &s.mean)) == bits(&mut state.mean.iter()),
                "{}",
                state.name
            );
            assert!(bits(&mut states().flat_map(|s| &s.sd)) == bits(&mut state.sd.iter()), "{}", state.name);
        }
    }
    let crossings: Vec<RecordedPassing> = parts.iter().flat_map(|part| part.crossings.clone()).collect();
    assert_eq!(crossings, whole.crossings);
    assert!(crossings.len() > 300);

    // Clipped somewhere.
    let clipped = outcome(&mut rows.iter().map(|[t, drive, y]| line(&[*t, *drive, y.clamp(-0.7, 0.7)])));
    assert!(clipped.err().unwrap().contains("is clipped in"));
    // Without motion: the part of the drive alone, and noise.
    let noise = rows.iter().zip(rows[1..].iter().zip(&rows[500..])).map(|(a, (b, c))| {
        let still = 10e6 * 0.21e-12 * (b[1] - a[1]) / 2e-6;
        let white = ((c[2] * 1e5).rem_euclid(1.0) - 0.5) * 12_f64.sqrt() * 0.0435;
        line(&[a[0], a[1], white - still])
    });
    let still = outcome(&mut noise.take(100_000));
    assert!(still.err().unwrap().contains("holds no crossing of the threshold"));
}
