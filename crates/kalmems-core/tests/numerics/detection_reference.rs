//! The detector on a recording of the threshold-sensing scanner that another program simulated, against what an
//! independent detector found in it.

// Sample numbers here are small.
#![allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]

use kalmems_core::detect::{CubicFit, Detector, SlopeKernel, Threshold, peaks};
use serde_json::Value;
use std::fs::read_to_string;
use std::path::PathBuf;

/// s between two samples.
const INTERVAL: f64 = 2e-6;
/// V, the standard deviation of a sample's noise.
const NOISE: f64 = 0.0435;
/// rad
const THRESHOLD_ANGLE: f64 = 0.0037;
/// Samples on each side within which the highest maximum is kept.
const REACH: usize = 150;
/// Samples at the ends in which nothing is scored.
const ENDS: f64 = 200.0;

struct Reference {
    signal: Vec<f64>,
    angle: Vec<f64>,
    /// In samples.
    crossings: Vec<f64>,
    expected: Value,
}

/// One crossing that was found: the time in samples, and the error of the time and of the angle.
struct Found {
    crossing: f64,
    time_error: f64,
    angle_error: f64,
}

impl Reference {
    fn read() -> Self {
        let folder =
            std::env::var_os("KALMEMS_REFERENCE_DATA").expect("KALMEMS_REFERENCE_DATA names a folder");
        let folder = PathBuf::from(folder).join("recordings/threshold-nominal");
        let column = |file: &str, place: usize| -> Vec<f64> {
            let text = read_to_string(folder.join(file)).unwrap();
            text.lines().skip(1).map(|line| line.split(',').nth(place).unwrap().parse().unwrap()).collect()
        };
        let expected = read_to_string(folder.join("expected.json")).unwrap();
        let times = column("crossings.csv", 0);
        Self {
            signal: column("recording.csv", 2),
            angle: column("truth.csv", 1),
            crossings: times.iter().map(|time| time / INTERVAL).collect(),
            expected: serde_json::from_str(&expected).unwrap(),
        }
    }

    /// Detections of the whole recording with a Gaussian of 15 samples: index, part of a sample.
    fn detections<const HALF: usize>(&self, deviations: f64) -> Vec<(usize, f64)> {
        let kernel = SlopeKernel::<f64, HALF>::new(15.0).unwrap();
        let mut slope = vec![0.0; self.signal.len()];
        kernel.responses(&self.signal, &mut slope);
        let threshold = Threshold::fixed(deviations * kernel.noise_deviation(NOISE));
        peaks(&slope, REACH, threshold).map(|peak| (peak.index as usize, peak.fraction)).collect()
    }

    fn scored(&self, time: f64) -> bool {
        (ENDS..=self.signal.len() as f64 - 1.0 - ENDS).contains(&time)
    }

    /// The angle at a time, between two samples by a line.
    fn angle_at(&self, time: f64) -> f64 {
        let k = time.floor();
        let (a, b) = (self.angle[k as usize], self.angle[k as usize + 1]);
        a + (time - k) * (b - a)
    }

    /// Which crossings the times belong to, within 0.2 ms, and how many belong to none.
    fn matched(&self, times: &[f64]) -> (Vec<Found>, usize) {
        let mut found: Vec<Found> = Vec::new();
        let mut false_ones = 0;
        for &time in times.iter().filter(|time| self.scored(**time)) {
            let near = self.crossings.iter().min_by(|a, b| (*a - time).abs().total_cmp(&(*b - time).abs()));
            match near {
                Some(&crossing) if (crossing - time).abs() < 100.0 => found.push(Found {
                    crossing,
                    time_error: (time - crossing) * INTERVAL,
                    angle_error: self.angle_at(time) - THRESHOLD_ANGLE,
                }),
                _ => false_ones += 1,
            }
        }
        (found, false_ones)
    }

    /// Compares with what `expected.json` has under this name: counts to one, means to 0.3 of the standard deviation,
    /// standard deviations to 15 %.
    fn compare(&self, name: &str, times: &[f64]) {
        let (found, false_ones) = self.matched(times);
        let expected = &self.expected["detection"][name];
        let number = |value: &Value| value.as_f64().unwrap();
        println!("{name}: {false_ones} false");
        assert!(
            (false_ones as f64 - number(&expected["false_detections"])).abs() <= 1.0,
            "{false_ones} false"
        );
        for (i, segment) in expected["segments"].as_array().unwrap().iter().enumerate() {
            let within = |time: f64| self.scored(time) && (time / 10_000.0) as usize == i;
            let crossings = self.crossings.iter().filter(|time| within(**time)).count();
            let here: Vec<&Found> = found.iter().filter(|found| within(found.crossing)).collect();
            let missed = crossings - here.len();
            assert_eq!(crossings as f64, number(&segment["crossings"]));
            let times: Vec<f64> = here.iter().map(|found| found.time_error).collect();
            let angles: Vec<f64> = here.iter().map(|found| found.angle_error).collect();
            println!(
                "  {i}: {missed} missed, {:.2?} us, {:.3?} mrad",
                spread(&times, 1e6),
                spread(&angles, 1e3)
            );
            assert!((missed as f64 - number(&segment["missed"])).abs() <= 1.0, "{name} {i}: {missed} missed");
            for (values, key, unit) in [(&times, "e_t", "s"), (&angles, "e_theta", "rad")] {
                let (mean, deviation) = spread(values, 1.0);
                let theirs = |what: &str| number(&segment[format!("{key}_{what}_{unit}")]);
                let bar = theirs("std");
                assert!((deviation / bar - 1.0).abs() < 0.15, "{name} {i} {key}: {deviation:e} {bar:e}");
                assert!((mean - theirs("mean")).abs() < 0.3 * bar, "{name} {i} {key}: {mean:e}");
            }
        }
    }
}

/// Mean and standard deviation, in other units.
fn spread(values: &[f64], unit: f64) -> (f64, f64) {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let square = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / n;
    (unit * mean, unit * square.sqrt())
}

#[test]
#[ignore = "needs KALMEMS_REFERENCE_DATA"]
fn detections_are_those_of_an_independent_detector() {
    let reference = Reference::read();
    let four = reference.detections::<200>(4.0);
    let two = reference.detections::<200>(2.0);
    let whole = |found: &[(usize, f64)]| -> Vec<f64> { found.iter().map(|found| found.0 as f64).collect() };
    let parts: Vec<f64> = four.iter().map(|found| found.0 as f64 + found.1).collect();
    reference.compare("integer_sample", &whole(&four));
    reference.compare("integer_sample_threshold_2sigma", &whole(&two));
    reference.compare("subsample_parabola", &parts);
}

#[test]
#[ignore = "needs KALMEMS_REFERENCE_DATA"]
fn zero_crossings_are_those_of_an_independent_detector() {
    let reference = Reference::read();
    let found = reference.detections::<200>(4.0);
    let (first, last) = (found[0].0, found[found.len() - 1].0);
    let between = &reference.signal[first..=last];
    let offset = between.iter().sum::<f64>() / between.len() as f64;
    let theirs = reference.expected["detection"]["offset_estimate_V"].as_f64().unwrap();
    println!("offset {offset:e}, {theirs:e}");
    let fit = CubicFit::<f64, 90>::new(30.0).unwrap();
    let times: Vec<f64> = found
        .iter()
        .filter_map(|(index, _)| {
            let crossing = fit.crossing(&reference.signal, *index, offset, NOISE * NOISE)?;
            Some(*index as f64 + crossing.displacement)
        })
        .collect();
    assert_eq!(times.len(), found.len());
    reference.compare("cubic_zero_crossing_sigma30", &times);
}

#[test]
#[ignore = "needs KALMEMS_REFERENCE_DATA"]
fn a_short_kernel_in_a_stream_finds_the_same() {
    let reference = Reference::read();
    for deviations in [2.0, 4.0] {
        let batch: Vec<u64> =
            reference.detections::<200>(deviations).iter().map(|found| found.0 as u64).collect();
        let kernel = SlopeKernel::<f64, 60>::new(15.0).unwrap();
        let threshold = Threshold::fixed(deviations * kernel.noise_deviation(NOISE));
        let mut detector = Detector::<f64, 60, REACH, 400>::new(kernel, threshold, NOISE * NOISE);
        let rest = std::iter::repeat_n(f64::NAN, Detector::<f64, 60, REACH, 400>::LOOK_AHEAD);
        let stream: Vec<u64> = reference
            .signal
            .iter()
            .copied()
            .chain(rest)
            .filter_map(|sample| detector.push(sample))
            .map(|found| found.index)
            .collect();
        let same = batch.iter().filter(|index| stream.contains(index)).count();
        println!("{deviations} sigma: {same} of {} the same, {} in the stream", batch.len(), stream.len());
        assert!(same as f64 >= 0.97 * batch.len() as f64);
    }
}
