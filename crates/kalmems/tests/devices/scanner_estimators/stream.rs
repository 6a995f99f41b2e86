//! Samples that are estimated while they arrive.

use super::example;
use crate::parts::{
    Killing, Pieces, Streamed, acknowledged_in, goes_on_after_a_kill, killed, same_bits_in_a_stream, streamed,
};
use kalmems::config::Experiment;
use kalmems::expand::expand;
use kalmems::recording::SampledRecording;
use kalmems::rigs::published;
use kalmems::stream::StreamSummary;
use rand_pcg::Pcg64;
use rand_pcg::rand_core::Rng;
use std::collections::BTreeMap;
use std::io::Read;
use std::ops::ControlFlow;

/// The example with these changes.
fn experiment(changes: &[(&str, &str)]) -> Experiment {
    let path = example("stream.toml");
    let mut text = std::fs::read_to_string(&path).unwrap();
    for (from, to) in changes {
        assert!(text.contains(from), "{from}");
        text = text.replace(from, to);
    }
    published().parse(&text, &path).unwrap_or_else(|e| panic!("{e}"))
}

#[test]
fn a_stream_equals_the_estimate_sample_by_sample() {
    let path = example("recording.csv");
    let bytes = std::fs::read(&path).unwrap();
    for (longest, lag, waits_for) in [(60, 2, 2), (100_000, 2, 2), (60, 1, 1), (60, 0, 1)] {
        // An answer that lags is given to its end, which the next sample tells.
        let lag = format!("[estimate]\ninterpolation_lag = {lag}");
        let experiment = experiment(&[("every = 10", "every = 1"), ("[estimate]", &lag)]);
        let rig = published().rig(&experiment).unwrap();
        let recording = SampledRecording::read(&path, &rig.layout(&experiment, 0).unwrap()).unwrap();
        let (events, summary) = same_bits_in_a_stream(&experiment, &recording, (&bytes, longest));
        assert_eq!((summary.estimated, summary.waits_for), (24_001, waits_for));
        assert_eq!(summary.latency.count(), 24_001);
        // The motion passes zero twice in a cycle, 16 ms long, in each of the two answers.
        let count = |kind: &str| events.iter().filter(|event| event["event"] == kind).count();
        let [zeros, ahead] = ["zero_phase", "zero_phase_ahead"].map(count);
        assert!((1001..=1005).contains(&zeros) && (500..=503).contains(&ahead), "{zeros} {ahead}");
        assert_eq!(zeros + ahead, events.len(), "{events:?}");
    }
}

#[test]
fn a_stream_that_waits_for_no_sample_equals_the_estimate() {
    let path = example("recording.csv");
    let bytes = std::fs::read(&path).unwrap();
    let lag = "[estimate]\ninterpolation_lag = 0";
    let changes = [("every = 10", "every = 1"), ("[estimate]", lag), ("smooth_lag = \"100 us\"", "")];
    let experiment = experiment(&changes);
    let rig = published().rig(&experiment).unwrap();
    let recording = SampledRecording::read(&path, &rig.layout(&experiment, 0).unwrap()).unwrap();
    for longest in [60, 100_000] {
        let (_, summary) = same_bits_in_a_stream(&experiment, &recording, (&bytes, longest));
        assert_eq!((summary.estimated, summary.waits_for), (24_001, 0));
    }
}

#[test]
fn what_a_bad_way_makes_of_the_samples_is_put_right_and_counted() {
    let fields = "[stream.input.frames]\nsync = \"a55a\"\n\
                  fields = [\"u16 sequence\", \"f64 time_s\", \"f32 drive_V\", \"f64 cap_V\"]";
    let experiment = experiment(&[
        ("every = 10", "every = 1"),
        ("[stream.input.text]\ncolumns = [\"time_s\", \"drive_V\", \"cap_V\"]", fields),
    ]);
    let text = std::fs::read_to_string(example("recording.csv")).unwrap();
    let mut chance = Pcg64::new(5, 5);
    let mut one_in = |count: u64| chance.next_u64().is_multiple_of(count);
    let mut frames: Vec<Vec<u8>> = Vec::new();
    let mut held: Vec<(usize, Vec<u8>)> = Vec::new();
    let (mut dropped, mut duplicated, mut late) = (0, 0, 0);
    for (k, line) in text.lines().skip(1).enumerate() {
        let cells: Vec<f64> = line.split(',').map(|cell| cell.parse().unwrap()).collect();
        let mut frame = vec![0xa5, 0x5a];
        frame.extend_from_slice(&u16::try_from(k & 0xffff).unwrap().to_le_bytes());
        frame.extend_from_slice(&cells[0].to_le_bytes());
        #[allow(clippy::cast_possible_truncation)] // as the instrument sends it
        frame.extend_from_slice(&(cells[1] as f32).to_le_bytes());
        frame.extend_from_slice(&cells[2].to_le_bytes());
        // The first and the last ones come, so that all that is lost is between them.
        if k > 10 && k < 23_900 && one_in(20) {
            dropped += 1;
        } else if k > 10 && k < 23_900 && one_in(100) {
            late += 1;
            held.push((k + 7, frame));
        } else {
            frames.push(frame.clone());
            if one_in(100) {
                duplicated += 1;
                frames.push(frame);
            }
        }
        let (ready, waiting) = held.into_iter().partition(|(until, _)| *until <= k);
        held = waiting;
        frames.extend(ready.into_iter().map(|(_, frame): (usize, Vec<u8>)| frame));
    }
    let Streamed { answers, ended, .. } = streamed(&experiment, Pieces::of(frames.concat(), 300), None);
    let summary = ended.unwrap_or_else(|e| panic!("{e}"));
    let order = summary.received.order;
    assert_eq!((order.dropped, order.duplicated, order.late, order.too_late), (dropped, duplicated, late, 0));
    assert!(dropped > 1100 && duplicated > 180 && late > 180);
    assert_eq!(summary.estimated, 24_001 - dropped);
    // Against the reference, after the settling time.
    let reference = std::fs::read_to_string(example("reference.csv")).unwrap();
    let truth: BTreeMap<i64, f64> = reference
        .lines()
        .skip(1)
        .map(|line| {
            let cells: Vec<f64> = line.split(',').map(|cell| cell.parse().unwrap()).collect();
            #[allow(clippy::cast_possible_truncation)] // microseconds
            ((cells[0] * 1e6).round() as i64, cells[1])
        })
        .collect();
    for (key, lines) in &answers {
        let judged: Vec<bool> = lines
            .iter()
            .filter(|line| line[0] >= 8e-3)
            .map(|line| {
                #[allow(clippy::cast_possible_truncation)] // microseconds
                let truth = truth[&((line[0] * 1e6).round() as i64)];
                (line[1] - truth).abs() <= 3.0 * line[2]
            })
            .collect();
        let share = judged.iter().filter(|within| **within).count() as f64 / judged.len() as f64;
        println!("{key}: {:.2} % within three standard deviations", 100.0 * share);
        assert!(share >= 0.99, "{key}: {share}");
    }
}

#[test]
fn what_cannot_be_streamed_is_refused_with_what_to_do() {
    let said = |changes: &[(&str, &str)], words: &[&str]| {
        let input = Pieces::of(Vec::new(), 10);
        let error = streamed(&experiment(changes), input, None).ended.unwrap_err().to_string();
        assert!(words.iter().all(|word| error.contains(word)), "{error}");
    };
    said(&[("smooth_lag = \"100 us\"", "smooth = true")], &["whole recordings", "kalmems estimate"]);
    said(&[("[\"time_s\", \"drive_V\", \"cap_V\"]", "[\"drive_V\", \"cap_V\"]")], &["clock", "time_s"]);
    said(&[("[\"time_s\", \"drive_V\", \"cap_V\"]", "[\"time_s\", \"drive_V\"]")], &["cap_V"]);
    said(&[("every = 10", "heartbeat = \"1 ms\"")], &["stream.heartbeat", "0.1 s"]);
    // Nothing came.
    said(&[], &["no row"]);
}

#[test]
fn what_was_acknowledged_is_not_lost_when_a_run_is_killed() {
    let bytes = std::fs::read(example("recording.csv")).unwrap();
    let stated = "start = { angle = \"0.05 rad\", rate = \"0 rad/s\" }";
    for start in [stated, "start = \"from_signal\""] {
        let experiment = experiment(&[("every = 10", "every = 1"), (stated, start)]);
        goes_on_after_a_kill(&experiment, &bytes, 0.7, 9e-3);
    }
}

#[test]
fn another_experiment_does_not_go_on() {
    let folder = tempfile::tempdir().unwrap();
    let state = folder.path().join("state.json");
    let bytes = std::fs::read(example("recording.csv")).unwrap();
    let run = |experiment: &Experiment| {
        streamed(experiment, Pieces::of(bytes.clone(), 100_000), Some(&state)).ended
    };
    run(&experiment(&[])).unwrap_or_else(|e| panic!("{e}"));
    let ended = run(&experiment(&[("every = 10", "every = 1")]));
    assert!(ended.unwrap_err().to_string().contains("another experiment"));
}

#[test]
fn a_state_with_one_other_digit_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let state = folder.path().join("state.json");
    let bytes = std::fs::read(example("recording.csv")).unwrap();
    let experiment = experiment(&[]);
    streamed(&experiment, Pieces::of(bytes, 100_000), Some(&state)).ended.unwrap_or_else(|e| panic!("{e}"));
    let whole = std::fs::read(&state).unwrap();
    let digits: Vec<usize> = (0..whole.len()).filter(|at| whole[*at].is_ascii_digit()).collect();
    let mut chance = Pcg64::new(21, 22);
    let mut any = |count: usize| usize::try_from(chance.next_u64() % count as u64).unwrap();
    for _ in 0..1000 {
        let (at, by) = (digits[any(digits.len())], 1 + u8::try_from(any(9)).unwrap());
        let mut damaged = whole.clone();
        damaged[at] = b'0' + (damaged[at] - b'0' + by) % 10;
        std::fs::write(&state, &damaged).unwrap();
        let ended = streamed(&experiment, Pieces::of(Vec::new(), 1), Some(&state)).ended;
        let why = ended.unwrap_err().to_string();
        assert!(
            why.contains("checksum") || why.contains("not what this version writes"),
            "{at} by {by}: {why}"
        );
    }
}

#[test]
fn a_state_that_another_stream_uses_is_refused() {
    struct Other<R>(R, Option<Box<dyn FnOnce() + Send>>);

    impl<R: Read> Read for Other<R> {
        fn read(&mut self, bytes: &mut [u8]) -> std::io::Result<usize> {
            if let Some(other) = self.1.take() {
                other();
            }
            self.0.read(bytes)
        }
    }

    let folder = tempfile::tempdir().unwrap();
    let state = folder.path().join("state.json");
    let bytes = std::fs::read(example("recording.csv")).unwrap();
    let (path, same) = (state.clone(), bytes.clone());
    let other = Box::new(move || {
        let ended = streamed(&experiment(&[]), Pieces::of(same, 1000), Some(&path)).ended;
        assert!(ended.unwrap_err().to_string().contains("another stream"));
    });
    let input = Other(Pieces::of(bytes, 100_000), Some(other));
    streamed(&experiment(&[]), input, Some(&state)).ended.unwrap_or_else(|e| panic!("{e}"));
    let left: Vec<_> =
        std::fs::read_dir(folder.path()).unwrap().map(|entry| entry.unwrap().file_name()).collect();
    assert_eq!(left, ["state.json"]);
}

#[test]
fn one_in_so_many_estimates_is_written_across_a_restart() {
    let folder = tempfile::tempdir().unwrap();
    let state = folder.path().join("state.json");
    let bytes = std::fs::read(example("recording.csv")).unwrap();
    // Not a multiple of ten samples.
    let part = bytes.split(|byte| *byte == b'\n').take(12_346).map(|line| line.len() + 1).sum::<usize>();
    let times = |bytes: &[u8], state| {
        let Streamed { answers, ended, .. } =
            streamed(&experiment(&[]), Pieces::of(bytes.to_vec(), 100_000), state);
        ended.unwrap_or_else(|e| panic!("{e}"));
        answers["ekf"].iter().map(|line| line[0]).collect::<Vec<f64>>()
    };
    let whole = times(&bytes, None);
    let both = [times(&bytes[..part], Some(&*state)), times(&bytes, Some(&*state))].concat();
    assert!(both == whole, "{} and {}", both.len(), whole.len());
}

/// The example with zero phases told that long before.
fn prediction(ahead: &str, more: &str, changes: &[(&str, &str)]) -> Experiment {
    let table = format!("ahead = \"{ahead}\"\n{more}");
    let mut all = vec![("ahead = \"10 us\"", table.as_str())];
    all.extend_from_slice(changes);
    experiment(&all)
}

/// A zero phase, as it was told.
#[derive(Clone, Copy, Debug, PartialEq)]
struct ZeroPhase {
    told_s: f64,
    time_s: f64,
    sd_s: f64,
    rising: bool,
}

fn ahead(events: &[serde_json::Value]) -> Vec<ZeroPhase> {
    let ahead = events.iter().filter(|event| event["event"] == "zero_phase_ahead");
    ahead
        .map(|event| {
            let number = |key: &str| event[key].as_f64().unwrap();
            assert!(event["estimator"] == "ekf" && event["of"] == "angle");
            let rising = event["rising"].as_bool().unwrap();
            ZeroPhase { told_s: number("told_s"), time_s: number("time_s"), sd_s: number("sd_s"), rising }
        })
        .collect()
}

/// The true zero phases of a table of times, angles and rates, each with whether it rises.
fn passages(rows: &[[f64; 3]]) -> Vec<(f64, bool)> {
    let mut found = Vec::new();
    for pair in rows.windows(2) {
        let [[t, x, v], [u, y, w]] = [pair[0], pair[1]];
        if (x < 0.0) == (y < 0.0) {
            continue;
        }
        // The zero of Hermite's cubic, by halving.
        let h = u - t;
        let at = |s: f64| {
            let (a, b) = (1.0 - s, s);
            a * a * (1.0 + 2.0 * b) * x + b * b * (1.0 + 2.0 * a) * y + h * a * b * (a * v - b * w)
        };
        let (mut low, mut high) = (0.0, 1.0);
        for _ in 0..50 {
            let middle = f64::midpoint(low, high);
            if (at(middle) < 0.0) == (x < 0.0) { low = middle } else { high = middle }
        }
        found.push((t + low * h, y >= 0.0));
    }
    found
}

fn truth() -> Vec<[f64; 3]> {
    let text = std::fs::read_to_string(example("reference.csv")).unwrap();
    let row = |line: &str| -> [f64; 3] {
        let mut cells = line.split(',').map(|cell| cell.parse().unwrap());
        std::array::from_fn(|_| cells.next().unwrap())
    };
    text.lines().skip(1).map(row).collect()
}

/// The errors of what was told in its standard deviations. Each true passage between the times was told exactly once, in its
/// direction, and nothing else was told.
fn normalised(told: &[ZeroPhase], passages: &[(f64, bool)], (from_s, to_s): (f64, f64)) -> Vec<f64> {
    let within = |time_s: f64| (from_s..to_s).contains(&time_s);
    let mut told: Vec<&ZeroPhase> = told.iter().filter(|told| within(told.time_s)).collect();
    told.sort_by(|a, b| a.time_s.total_cmp(&b.time_s));
    let passages: Vec<&(f64, bool)> = passages.iter().filter(|(time_s, _)| within(*time_s)).collect();
    assert_eq!(told.len(), passages.len());
    let pairs = told.into_iter().zip(passages);
    pairs
        .map(|(told, (time_s, rising))| {
            assert!(told.rising == *rising && (told.time_s - time_s).abs() < 1e-6, "{told:?} {time_s}");
            (told.time_s - time_s) / told.sd_s
        })
        .collect()
}

/// What is told of a stream that ends well.
fn run(
    experiment: &Experiment,
    input: impl Read + Send + 'static,
) -> (Vec<serde_json::Value>, StreamSummary) {
    let run = streamed(experiment, input, None);
    (run.events, run.ended.unwrap_or_else(|e| panic!("{e}")))
}

#[test]
fn zero_phases_are_told_before_they_happen_each_once() {
    let bytes = std::fs::read(example("recording.csv")).unwrap();
    let passages = passages(&truth());
    // A sixth of a cycle, and more than four.
    for (text, ahead_s, waits_for) in [("10 us", 10e-6, 2.0), ("270 us", 270e-6, 2.0), ("10 us", 10e-6, 1.0)]
    {
        let lag = format!("[estimate]\ninterpolation_lag = {waits_for}");
        let experiment = prediction(text, "", &[("[estimate]", &lag)]);
        let mut whole = None;
        for longest in [60, 1000, 100_000] {
            let (events, summary) = run(&experiment, Pieces::of(bytes.clone(), longest));
            let told = ahead(&events);
            let counts = summary.ahead.unwrap().counts;
            let h = 1e-6;
            // Begun at the end of the settling time, the first come with less than was asked for.
            let short =
                told.iter().filter(|told| told.time_s - told.told_s < ahead_s + waits_for * h).count();
            assert!(told.iter().take(short).all(|told| told.told_s < 8e-3 + 64e-6), "{short}");
            assert_eq!((counts.told, counts.late), (told.len() as u64, short as u64));
            assert_eq!((counts.missed, counts.without_drive), (0, 0));
            let longest_s = told.iter().map(|told| told.time_s - told.told_s).fold(0.0, f64::max);
            assert!(longest_s < ahead_s + (waits_for + 1.6) * h, "{longest_s}");
            let errors = normalised(&told, &passages, (8e-3, 24e-3));
            assert!((500..504).contains(&errors.len()), "{}", errors.len());
            let within = errors.iter().filter(|e| e.abs() <= 3.0).count() as f64 / errors.len() as f64;
            let nees = errors.iter().map(|e| e * e).sum::<f64>() / errors.len() as f64;
            let sd_s = told.last().unwrap().sd_s;
            println!(
                "{text}: {} told, {within:.4} within 3 sd, NEES {nees:.3}, the last sd {sd_s:.2e} s",
                told.len()
            );
            assert!(within >= 0.99, "{within}");
            assert_eq!(*whole.get_or_insert(told.clone()), told);
        }
    }
}

#[test]
fn a_stream_of_equations_tells_what_that_of_a_published_device_tells() {
    let bytes = std::fs::read(example("recording.csv")).unwrap();
    let published_device = experiment(&[("every = 10", "every = 1")]);
    let text = expand(published(), &published_device).unwrap().text;
    let equations = published().parse(&text, &example("stream.toml")).unwrap_or_else(|e| panic!("{e}"));
    assert!(equations.stream.as_ref().is_some_and(|stream| stream.phase && stream.trigger.is_some()));
    let run = |experiment: &Experiment| {
        let Streamed { answers, events, ended, .. } =
            streamed(experiment, Pieces::of(bytes.clone(), 5000), None);
        (answers, ahead(&events), ended.unwrap_or_else(|e| panic!("{e}")).ahead.unwrap().counts)
    };
    let (own, told, counts) = run(&published_device);
    let (answers, told_too, counts_too) = run(&equations);
    assert_eq!(counts, counts_too);
    assert!(told.len() > 499 && told.len() == told_too.len());
    for (told, too) in told.iter().zip(&told_too) {
        assert!((told.time_s - too.time_s).abs() < 1e-3 * told.sd_s && told.rising == too.rising);
        assert!((told.sd_s / too.sd_s - 1.0).abs() < 1e-3 && told.told_s == too.told_s);
    }
    for ((key, own), (other, equations)) in own.iter().zip(&answers) {
        assert!(key == other && own.len() == equations.len() && own.len() > 23_000);
        // Each mean in its standard deviations, behind the settling time.
        for (own, equations) in own.iter().zip(equations).filter(|(own, _)| own[0] > 8e-3) {
            assert_eq!(own.len(), 11);
            let off = |place: usize| (own[place] - equations[place]) / own[place + 1];
            assert!((1..11).step_by(2).all(|place| off(place).abs() < 1e-3), "{own:?} {equations:?}");
        }
    }
    // Without the angle's table nothing says what amplitude and phase are of.
    let without = text
        .replace("[device.equations.angles]\nangle = \"rate\"\n", "")
        .replace("first_peak = \"positive\"\n", "");
    let without = published().parse(&without, &example("stream.toml")).unwrap_or_else(|e| panic!("{e}"));
    let refused = streamed(&without, Pieces::of(Vec::new(), 10), None).ended.unwrap_err().to_string();
    assert!(refused.contains("stream.trigger") && refused.contains("[device.equations.angles]"), "{refused}");
}

#[test]
fn one_direction_of_a_mirrored_filter_is_told_as_the_stated_sign_has_it() {
    let bytes = std::fs::read(example("recording.csv")).unwrap();
    let one = [("start = { angle = \"0.05 rad\"", "start = { angle = \"-0.05 rad\"")];
    let passages: Vec<(f64, bool)> = passages(&truth()).into_iter().filter(|(_, rising)| !rising).collect();
    let both = |changes: &[(&str, &str)], more| {
        let experiment = prediction("10 us", more, changes);
        ahead(&run(&experiment, Pieces::of(bytes.clone(), 5000)).0)
    };
    let told = both(&one, "direction = \"falling\"");
    assert!(told.len() > 249 && told.iter().all(|told| !told.rising));
    let errors = normalised(&told, &passages, (8e-3, 24e-3));
    assert!(errors.iter().filter(|e| e.abs() <= 3.0).count() as f64 >= 0.99 * errors.len() as f64);
    // Of the filter that started with the other sign it is the same to the last bit.
    assert_eq!(told, both(&[], "direction = \"falling\""));
}

#[test]
fn the_phase_stands_behind_the_states_with_its_deviation() {
    let bytes = std::fs::read(example("recording.csv")).unwrap();
    let experiment = experiment(&[("every = 10", "every = 1")]);
    let answers = streamed(&experiment, Pieces::of(bytes, 5000), None).answers;
    let truth = truth();
    let rate = std::f64::consts::PI * 31_350.0;
    for (key, lines) in &answers {
        let mut squares = Vec::new();
        for line in lines.iter().filter(|line| line[0] >= 8e-3) {
            #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // microseconds
            let [time_s, angle, speed] = truth[(line[0] * 1e6).round() as usize];
            assert!((time_s - line[0]).abs() < 1e-9);
            // time, (angle, rate, stiffness, amplitude, phase) with their deviations.
            let [amplitude, amplitude_sd, phase, phase_sd] = line[7..11] else { panic!("{line:?}") };
            let off = phase - (-speed / rate).atan2(angle);
            let off = off - std::f64::consts::TAU * (off / std::f64::consts::TAU).round();
            let off_amplitude = amplitude - angle.hypot(speed / rate);
            squares.push([(off / phase_sd).powi(2), (off_amplitude / amplitude_sd).powi(2)]);
        }
        let count = squares.len() as f64;
        for (which, name) in ["phase", "amplitude"].iter().enumerate() {
            let within = squares.iter().filter(|square| square[which] <= 9.0).count() as f64 / count;
            let nees = squares.iter().map(|square| square[which]).sum::<f64>() / count;
            println!("{key}, {name}: {within:.4} within 3 sd, NEES {nees:.3}");
            assert!(within >= 0.99 && nees > 0.2, "{key} {name} {within} {nees}");
        }
    }
}

#[test]
fn what_was_told_is_not_told_again_by_a_run_that_goes_on() {
    // Four cycles ahead, so that several wait when the run is killed.
    let experiment = prediction("270 us", "", &[]);
    let bytes = std::fs::read(example("recording.csv")).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let state = folder.path().join("state.json");
    let whole = ahead(&streamed(&experiment, Pieces::of(bytes.clone(), 1000), None).events);
    let killing = Killing::at(Pieces::of(bytes.clone(), 4000), bytes.len() * 7 / 10);
    let first = killed(&experiment, killing, &state);
    let (first, acknowledged) = (ahead(&first.events), acknowledged_in(&state));
    assert!(acknowledged > 9e-3, "{acknowledged}");
    let second = ahead(&streamed(&experiment, Pieces::of(bytes, 1000), Some(&state)).events);
    // As with estimates: what was told from samples that were acknowledged is told for good, the rest is told again.
    assert!(second.iter().all(|told| told.told_s > acknowledged));
    let mut both: Vec<ZeroPhase> = first.into_iter().filter(|told| told.told_s <= acknowledged).collect();
    let waiting = both.iter().filter(|told| told.time_s > acknowledged).count();
    assert!(waiting >= 8, "{waiting}");
    both.extend(second);
    assert_eq!(both.len(), whole.len());
    for (told, whole) in both.iter().zip(&whole) {
        assert!(
            told.rising == whole.rising && told.told_s.to_bits() == whole.told_s.to_bits(),
            "{told:?} {whole:?}"
        );
        let off = (told.time_s - whole.time_s) / whole.sd_s;
        assert!(off.abs() < 1e-3 && (told.sd_s / whole.sd_s - 1.0).abs() < 1e-3, "{off} {told:?} {whole:?}");
    }
}

#[test]
fn what_cannot_be_predicted_is_refused_or_counted() {
    let said = |more: &str, changes: &[(&str, &str)], words: &[&str]| {
        let input = Pieces::of(Vec::new(), 10);
        let error = streamed(&prediction("10 us", more, changes), input, None).ended;
        let error = error.unwrap_err().to_string();
        assert!(words.iter().all(|word| error.contains(word)), "{error}");
    };
    said("filter = \"UKF\"", &[], &["stream.trigger.filter", "`UKF`", "`EKF`"]);
    said("on = \"frames\"", &[], &["stream.trigger.on", "--frames FILE"]);
    said("", &[("ahead = \"10 us\"", "ahead = \"5 ms\"")], &["stream.trigger.ahead", "5 ms", "4096"]);

    // A device without an angle says so.
    let path = example("../accelerometer/experiment.toml");
    let text = std::fs::read_to_string(&path).unwrap();
    let table = "\n[stream]\nrate = \"1 MHz\"\nphase = true\n[stream.input.text]\ncolumns = [\"time_s\"]\n";
    let other = published().parse(&(text + table), &path).unwrap_or_else(|e| panic!("{e}"));
    let input = Pieces::of(Vec::new(), 10);
    let error = streamed(&other, input, None).ended.unwrap_err().to_string();
    assert!(error.contains("stream.phase") && error.contains("are those of an angle"), "{error}");

    // From 14 to 16 ms the drive is another one: nobody can say what it does next, and what passes is counted.
    let text = std::fs::read_to_string(example("recording.csv")).unwrap();
    let changed: Vec<String> = (text.lines().enumerate())
        .map(|(k, line)| {
            let cells: Vec<&str> = line.split(',').collect();
            if !(14_001..16_001).contains(&k) {
                return line.to_owned();
            }
            let volts = 90.0 + 0.9 * (cells[1].parse::<f64>().unwrap() - 90.0);
            format!("{},{volts:.4},{}", cells[0], cells[2])
        })
        .collect();
    let experiment = prediction("10 us", "", &[]);
    let input = Pieces::of((changed.join("\n") + "\n").into_bytes(), 5000);
    let (events, summary) = run(&experiment, input);
    let counts = summary.ahead.unwrap().counts;
    let told = ahead(&events);
    // Nothing for these 2 ms and until the mean has forgotten them, then all again, none twice.
    let passages = passages(&truth()).iter().filter(|(time_s, _)| (8e-3..24e-3).contains(time_s)).count();
    assert_eq!(
        counts.told + counts.missed,
        passages as u64 + told.iter().filter(|t| t.time_s >= 24e-3).count() as u64
    );
    assert!((62..70).contains(&counts.missed) && (2000..2200).contains(&counts.without_drive), "{counts:?}");
    assert!(!told.iter().any(|told| (14.1e-3..16e-3).contains(&told.told_s)));
}

/// The example's device, simulated from the motion of its recording on with this seed of the noise: the samples as text, and
/// the truth.
fn simulated(seed: u64) -> (Vec<u8>, Vec<[f64; 3]>) {
    let path = example("stream.toml");
    let text = std::fs::read_to_string(&path).unwrap().replacen("1.1033e-4 N m", "1.10e-4 N m", 1);
    let simulate = format!(
        "\n[simulate]\nduration = \"24 ms\"\nsampling_rate = \"1 MHz\"\nintegration_rate = \"10 MHz\"\n\
         start = {{ angle = \"0.1441234 rad\", rate = \"5801.15 rad/s\" }}\nseed = {seed}\n\
         [simulate.drive.sine]\noffset = \"90 V\"\namplitude = \"90 V\"\nfrequency = \"31.35 kHz\"\n"
    );
    let experiment = published().parse(&(text + &simulate), &path).unwrap_or_else(|e| panic!("{e}"));
    let simulation = published().rig(&experiment).unwrap().simulate(&experiment).unwrap();
    let (mut samples, mut truth) = (String::new(), Vec::new());
    simulation
        .run(&mut |sample| {
            let [drive, signal] = sample.recorded else { panic!("{:?}", sample.recorded) };
            samples += &format!("{},{drive},{signal}\n", sample.time_s);
            truth.push([sample.time_s, sample.truth[0], sample.truth[1]]);
            ControlFlow::Continue(())
        })
        .unwrap();
    (samples.into_bytes(), truth)
}

/// Over `seeds` simulated recordings: the share of the told times within three standard deviations, and the mean of (error/σ)²
/// with its standard error by the spread over the recordings.
fn judged(experiment: &Experiment, seeds: u64) -> [f64; 3] {
    let (mut nees, mut within, mut count) = (Vec::new(), 0, 0);
    for seed in 1..=seeds {
        let (samples, truth) = simulated(seed);
        let (events, _) = run(experiment, Pieces::of(samples, 10_000));
        let errors = normalised(&ahead(&events), &passages(&truth), (8e-3, 24e-3 - 2e-6));
        nees.push(errors.iter().map(|e| e * e).sum::<f64>() / errors.len() as f64);
        within += errors.iter().filter(|e| e.abs() <= 3.0).count();
        count += errors.len();
    }
    let n = nees.len() as f64;
    let mean = nees.iter().sum::<f64>() / n;
    let spread = nees.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / (n - 1.0);
    [within as f64 / count as f64, mean, (spread / n).sqrt()]
}

#[test]
#[ignore = "slow"]
fn slow_the_times_ahead_are_as_uncertain_as_they_say() {
    // The simulated device has no noise of its acceleration; a filter that knows that is right, and one that allows for some
    // says more than it must.
    let exact = [
        ("angular_acceleration = \"1e4 rad^2/s^3\"", "angular_acceleration = \"0 rad^2/s^3\""),
        ("drift = \"1e-7 1/s\"", "drift = \"0 1/s\""),
        // From a start so vague that the filter's linearisation shows, an exact filter would never recover its confidence.
        (
            "start = { angle = \"0.05 rad\", rate = \"0 rad/s\" }",
            "start = { angle = \"0.144 rad\", rate = \"5800 rad/s\" }",
        ),
        (
            "start_sd = { angle = \"0.15 rad\", rate = \"15e3 rad/s\" }",
            "start_sd = { angle = \"1e-3 rad\", rate = \"100 rad/s\" }",
        ),
    ];
    for (name, changes) in [("exact", &exact[..]), ("example", &[])] {
        for text in ["10 us", "270 us", "2 ms"] {
            let [within, nees, of_nees] = judged(&prediction(text, "", changes), 40);
            println!("{name}, {text}: {within:.4} within 3 sd, NEES {nees:.3} ± {of_nees:.3}");
            assert!(within >= 0.99, "{name} {text} {within}");
            if name == "exact" {
                assert!((nees - 1.0).abs() < 3.0 * of_nees && of_nees < 0.25, "{text} {nees} {of_nees}");
            } else {
                assert!(nees < 1.0 + 3.0 * of_nees, "{text} {nees} {of_nees}");
            }
        }
    }
}

/// The second way: the times that two filters predict of the same passage, one of them with a damping that is one standard deviation larger.
#[test]
fn uncertain_numbers_of_the_device_enter_the_times_that_are_predicted() {
    let bytes = std::fs::read(example("recording.csv")).unwrap();
    let told = |damping: &str| {
        let changes = [("damping = \"5.95e-12 N m s\"", damping)];
        let (events, _) = run(&prediction("270 us", "", &changes), Pieces::of(bytes.clone(), 1000));
        ahead(&events).into_iter().filter(|told| told.time_s > 12e-3).collect::<Vec<ZeroPhase>>()
    };
    let exact = told("damping = \"5.95e-12 N m s\"");
    let larger = told("damping = \"6.05e-12 N m s\"");
    let uncertain = told("damping = \"5.95e-12 N m s ± 1e-13 N m s\"");
    assert!(exact.len() > 100 && exact.len() == uncertain.len(), "{} {}", exact.len(), uncertain.len());
    let mut largest = 0.0_f64;
    for (exact, uncertain) in exact.iter().zip(&uncertain) {
        assert_eq!(
            (exact.told_s, exact.time_s, exact.rising),
            (uncertain.told_s, uncertain.time_s, uncertain.rising)
        );
        let near = |other: &&ZeroPhase| (other.time_s - exact.time_s).abs() < 1e-6;
        let moved = larger.iter().find(near).unwrap().time_s - exact.time_s;
        let added = (uncertain.sd_s * uncertain.sd_s - exact.sd_s * exact.sd_s).sqrt();
        assert!(
            (added - moved.abs()).abs() < 0.1 * moved.abs() + 1e-10,
            "{added:e} {moved:e} {:e}",
            exact.sd_s
        );
        largest = largest.max(moved.abs() / exact.sd_s);
    }
    // The noise does not hide it.
    assert!(largest > 0.3, "{largest}");
}

/// The example's drive with this signal, made of nothing but noise.
fn noise(rows: usize) -> Vec<u8> {
    let text = std::fs::read_to_string(example("recording.csv")).unwrap();
    let mut chance = Pcg64::new(21, 22);
    let mut uniform = || (chance.next_u64() >> 11) as f64 / (1_u64 << 53) as f64;
    let mut lines = String::new();
    for line in text.lines().skip(1).take(rows) {
        let normal = (0..12).map(|_| uniform()).sum::<f64>() - 6.0;
        let (time_and_drive, _) = line.rsplit_once(',').unwrap();
        lines += &format!("{time_and_drive},{:.5}\n", 1.3 + 0.0139 * normal);
    }
    lines.into_bytes()
}

#[test]
fn a_stream_of_noise_is_reported_as_such_without_zero_phases() {
    let run = streamed(&experiment(&[]), Pieces::of(noise(24_001), 5000), None);
    let summary = run.ended.unwrap_or_else(|e| panic!("{e}"));
    let count = |kind: &str| run.events.iter().filter(|event| event["event"] == kind).count();
    assert_eq!(["noise_only", "noise_only_over", "zero_phase", "zero_phase_ahead"].map(count), [1, 0, 0, 0]);
    assert!(summary.noise_only == 1 && summary.withheld > 0, "{}", summary.withheld);
    let alarm = run.events.iter().find(|event| event["event"] == "noise_only").unwrap();
    let cycles = alarm["time_s"].as_f64().unwrap() * 15_675.0;
    assert!(cycles < 100.0, "{cycles}");
    // Of the device itself nothing of the kind is said.
    let bytes = std::fs::read(example("recording.csv")).unwrap();
    let run = streamed(&experiment(&[]), Pieces::of(bytes, 5000), None);
    assert!(run.events.iter().all(|event| event["event"] != "noise_only"));
    assert_eq!(run.ended.unwrap().withheld, 0);
}

#[test]
fn a_last_line_that_is_cut_off_is_no_sample() {
    let bytes = std::fs::read(example("recording.csv")).unwrap();
    // `1` of such as `1.02887`, and a line that is whole but for its end.
    for cut in [5, 1] {
        let bytes = bytes[..bytes.len() - cut].to_vec();
        let Streamed { answers, ended, .. } =
            streamed(&experiment(&[("every = 10", "every = 1")]), Pieces::of(bytes, 5000), None);
        let summary = ended.unwrap_or_else(|e| panic!("{e}"));
        assert_eq!((summary.estimated, summary.received.cut_off), (24_000, 1));
        assert_eq!(answers["ekf"].last().unwrap()[0], 23_999e-6);
    }
}

#[test]
fn a_clock_that_goes_back_begins_the_estimate_anew_and_one_absurd_time_does_not() {
    let text = std::fs::read_to_string(example("recording.csv")).unwrap();
    let rows: Vec<&str> = text.lines().skip(1).collect();
    // The last 12 ms again, after all.
    let lines: Vec<&str> = rows.iter().chain(&rows[12_000..]).copied().collect();
    let changed: Vec<String> = (lines.iter().enumerate())
        .map(|(k, line)| match line.split_once(',') {
            Some((_, rest)) if k == 5000 => format!("1e300,{rest}"),
            // Other noise than before: they are not sent again.
            Some((time, rest)) if k >= rows.len() => format!("{time},{rest}1"),
            _ => (*line).to_owned(),
        })
        .collect();
    let run = streamed(&experiment(&[]), Pieces::of((changed.join("\n") + "\n").into_bytes(), 5000), None);
    let summary = run.ended.unwrap_or_else(|e| panic!("{e}"));
    let received = summary.received;
    assert_eq!((received.order.misplaced, received.order.dropped, received.steps_back), (1, 1, 1));
    assert_eq!((summary.estimated, summary.stretches.restarts), (24_000 + 12_001, 1));
    let back: Vec<_> = run.events.iter().filter(|event| event["event"] == "clock_back").collect();
    assert_eq!(back.len(), 1);
    assert_eq!((&back[0]["from_s"], &back[0]["to_s"]), (&0.024.into(), &0.012.into()));
}

#[test]
fn health_is_told_by_the_time_of_day_when_nothing_arrives() {
    /// Says nothing for a second from the first read on, then ends.
    struct Silent(Option<std::time::Instant>);
    impl Read for Silent {
        fn read(&mut self, _: &mut [u8]) -> std::io::Result<usize> {
            std::thread::sleep(std::time::Duration::from_millis(20));
            if self.0.get_or_insert_with(std::time::Instant::now).elapsed().as_secs_f64() < 1.0 {
                return Err(std::io::ErrorKind::WouldBlock.into());
            }
            Ok(0)
        }
    }
    let bytes = std::fs::read(example("recording.csv")).unwrap();
    let experiment = experiment(&[("every = 10", "every = 10\nheartbeat = \"0.2 s\"")]);
    let input = Pieces::of(bytes, 5000).chain(Silent(None));
    let run = streamed(&experiment, input, None);
    run.ended.unwrap_or_else(|e| panic!("{e}"));
    let health: Vec<_> = run.events.iter().filter(|event| event["event"] == "health").collect();
    assert!(health.len() >= 2, "{health:?}");
    let last = health.last().unwrap();
    assert_eq!(last["passed"], 24_001);
    assert_eq!((&last["noise_only"], &last["filters"][0]["lock"]), (&false.into(), &"held".into()));
    assert!(last["filters"][0]["mean_nis"].as_f64().is_some_and(|nis| (0.5..2.0).contains(&nis)), "{last}");
}
