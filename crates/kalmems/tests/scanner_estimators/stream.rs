//! Samples that are estimated while they arrive.

use super::example;
use super::parts::{Pieces, Streamed, goes_on_after_a_kill, same_bits_in_a_stream, streamed};
use kalmems::config::Experiment;
use kalmems::recording::Recording;
use kalmems::rigs;
use rand_pcg::Pcg64;
use rand_pcg::rand_core::Rng;
use std::collections::BTreeMap;

/// The example with these changes.
fn experiment(changes: &[(&str, &str)]) -> Experiment {
    let path = example("stream.toml");
    let mut text = std::fs::read_to_string(&path).unwrap();
    for (from, to) in changes {
        assert!(text.contains(from), "{from}");
        text = text.replace(from, to);
    }
    Experiment::parse(&text, &path).unwrap_or_else(|e| panic!("{e}"))
}

#[test]
fn a_stream_says_what_an_estimate_says_sample_by_sample() {
    let experiment = experiment(&[("every = 10", "every = 1")]);
    let rig = rigs::of(&experiment).unwrap();
    let path = example("recording.csv");
    let recording = Recording::read(&path, &rig.layout(&experiment, 0).unwrap()).unwrap();
    let bytes = std::fs::read(&path).unwrap();
    for longest in [60, 100_000] {
        let (events, summary) = same_bits_in_a_stream(&experiment, &recording, (&bytes, longest));
        assert_eq!(summary.estimated, 24_001);
        assert_eq!(summary.latency.count(), 24_001);
        // The motion passes zero twice in a cycle, 16 ms long, in each of the two answers.
        let zeros = events.iter().filter(|event| event["event"] == "zero_phase").count();
        assert!((1001..=1005).contains(&zeros), "{zeros}");
        assert!(events.iter().all(|event| event["event"] == "zero_phase"), "{events:?}");
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
    let Streamed { answers, ended, .. } =
        streamed(&experiment, Box::new(Pieces::of(frames.concat(), 300)), None);
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
        let input = Box::new(Pieces::of(Vec::new(), 10));
        let error = streamed(&experiment(changes), input, None).ended.unwrap_err().to_string();
        assert!(words.iter().all(|word| error.contains(word)), "{error}");
    };
    said(&[("smooth_lag = \"100 us\"", "smooth = true")], &["whole recordings", "kalmems estimate"]);
    said(&[("[\"time_s\", \"drive_V\", \"cap_V\"]", "[\"drive_V\", \"cap_V\"]")], &["clock", "time_s"]);
    said(&[("[\"time_s\", \"drive_V\", \"cap_V\"]", "[\"time_s\", \"drive_V\"]")], &["cap_V"]);
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
        streamed(experiment, Box::new(Pieces::of(bytes.clone(), 100_000)), Some(&state)).ended
    };
    run(&experiment(&[])).unwrap_or_else(|e| panic!("{e}"));
    let ended = run(&experiment(&[("every = 10", "every = 1")]));
    assert!(ended.unwrap_err().to_string().contains("another experiment"));
}
