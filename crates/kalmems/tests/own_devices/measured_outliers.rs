//! The measured devices with samples that are none of the signal, put into their recordings: what the program makes of them, from the text of
//! the device and the recording alone.
//!
//! The true motion is not known. The error is that of the predictions of the samples as they were measured, of which the filter saw the changed ones.

use crate::measured_devices::{SEISMOMETER, SILVERBOX, data};
use kalmems::diagnose::load_with_noise;
use kalmems::estimate::Trajectory;
use kalmems::progress::Silent;
use kalmems::results::{EstimatorMetrics, Metrics};
use kalmems::rigs::published;
use kalmems::simulate::WhiteNoise;
use kalmems::workflow::estimate;
use std::fmt::Write as _;

/// A recording with its experiment, which leaves the noises of readout and process to it.
struct MeasuredRecording {
    name: String,
    experiment: String,
    file: &'static str,
    header: &'static str,
    /// What stands before the signal in a row.
    before: Vec<String>,
    signal: Vec<f64>,
    /// The first sample behind the settling time.
    from: usize,
}

/// What came of a recording.
struct MeasuredOutcome {
    trajectory: Trajectory,
    metrics: EstimatorMetrics,
    /// The root mean square of measured less predicted, of the signal as it was measured.
    error: f64,
    /// The experiment with the noises that were found.
    experiment: String,
}

impl MeasuredRecording {
    fn outcome(&self, signal: &[f64]) -> MeasuredOutcome {
        let folder = tempfile::tempdir().unwrap();
        let mut text = format!("{}\n", self.header);
        for (before, value) in self.before.iter().zip(signal) {
            let value = if value.is_nan() { String::new() } else { format!("{value:e}") };
            writeln!(text, "{before},{value}").unwrap();
        }
        std::fs::write(folder.path().join(self.file), text).unwrap();
        let path = folder.path().join("experiment.toml");
        std::fs::write(&path, &self.experiment).unwrap();
        let (experiment, _) = load_with_noise(published(), &path, &Silent).unwrap();
        let outcome = estimate(published(), &experiment, &Silent).unwrap();
        let metrics = Metrics::of(&outcome).estimators().next().unwrap().clone();
        let trajectory = outcome.recordings[0].segments[0].estimate.trajectories[0].clone();
        let mut innovation = trajectory.innovation.clone();
        for one in &trajectory.rejected {
            innovation[one.sample] = one.innovation;
        }
        let errors = (self.from..signal.len()).map(|k| self.signal[k] - (signal[k] - innovation[k]));
        let errors: Vec<f64> = errors.filter(|error| error.is_finite()).collect();
        let error = (errors.iter().map(|error| error * error).sum::<f64>() / errors.len() as f64).sqrt();
        MeasuredOutcome { trajectory, metrics, error, experiment: experiment.to_toml().unwrap() }
    }

    /// The samples that are changed by 5 to 100 standard deviations of the noise, to either side, with by how many: a share of all, and a run in a row.
    fn outliers(&self, share: f64, run: usize, seed: u64) -> Vec<(usize, f64)> {
        let mut chance = WhiteNoise::new(seed, 80);
        let mut uniform = move || (chance.sample() * 1e6).rem_euclid(1.0);
        let place = self.from + (self.signal.len() - self.from) / 2;
        let mut outliers = Vec::new();
        for k in self.from..self.signal.len() {
            if uniform() < share || (place..place + run).contains(&k) {
                let size = 5.0 * 20_f64.powf(uniform());
                outliers.push((k, if uniform() < 0.5 { -size } else { size }));
            }
        }
        outliers
    }

    /// Puts them in, judges what the program makes of them, and writes the row of the book.
    fn judge(&self, clean: &MeasuredOutcome, outliers: &[(usize, f64)], what: &str) {
        let claimed = &clean.trajectory.innovation_sd[self.from..];
        let claimed: Vec<f64> = claimed.iter().copied().filter(|sd| sd.is_finite()).collect();
        let sd = claimed.iter().sum::<f64>() / claimed.len() as f64;
        let mut signal = self.signal.clone();
        for (k, size) in outliers {
            signal[*k] += size * sd;
        }
        let found = self.outcome(&signal);
        let ratio = found.error / clean.error;
        let rejected: Vec<usize> = found.trajectory.rejected.iter().map(|one| one.sample).collect();
        let is_in = |k: &usize| outliers.iter().any(|(place, _)| place == k);
        let beside = rejected.iter().filter(|k| !is_in(k)).count();
        let is_large = |size: f64| size.abs() > 9.0;
        let large: Vec<usize> =
            outliers.iter().filter(|(_, size)| is_large(*size)).map(|(k, _)| *k).collect();
        let located = large.iter().filter(|k| rejected.contains(k)).count();
        println!(
            "| {} | {what} | {} | {} | {beside} | {ratio:.2} | {} | {:?} |",
            self.name,
            outliers.len(),
            rejected.len() - beside,
            found.trajectory.lock.events.len(),
            found.metrics.grade.unwrap(),
        );
        assert!(ratio <= 1.3, "{}, {what}: {ratio}", self.name);
        assert_eq!(located, large.len(), "{}, {what}: {large:?} {rejected:?}", self.name);
        // Behind several outliers in a row the gate waits for as many samples within its bound, up to sixteen.
        let own: Vec<usize> = clean.trajectory.rejected.iter().map(|one| one.sample).collect();
        let follows = |k: &usize| outliers.iter().any(|(place, _)| (place + 1..=place + 16).contains(k));
        let wrong: Vec<&usize> =
            rejected.iter().filter(|k| !is_in(k) && !own.contains(k) && !follows(k)).collect();
        assert!(wrong.len() <= 1, "{}, {what}: {wrong:?}", self.name);
        let lock = &found.trajectory.lock;
        let counted = found.trajectory.rejected.iter().filter(|one| !lock.is_lost_at(one.time_s)).count();
        assert_eq!(found.metrics.rejections.count, counted);
        assert!(lock.is_usable(), "{lock:?}");
    }
}

/// The multisine of the Silverbox, with the numbers of the independent fit.
fn silverbox() -> MeasuredRecording {
    const ROWS: usize = 12_000;
    let expected: serde_json::Value = serde_json::from_str(&data("silverbox/expected.json")).unwrap();
    let own = |key: &str| expected["duffing_greybox_fit"]["parameters"][key].as_f64().unwrap();
    let mut experiment = SILVERBOX.to_owned();
    for (stated, with) in [
        ("role = \"training\"", "role = \"test\"".to_owned()),
        ("w2 = \"1.7e5 ", format!("w2 = \"{} ", own("w2"))),
        ("damping = \"50 ", format!("damping = \"{} ", own("d"))),
        ("a3 = \"5e5 ", format!("a3 = \"{} ", own("a3"))),
        ("g = \"1.7e5 ", format!("g = \"{} ", own("g"))),
        ("u0 = \"8 mV\"", format!("u0 = \"{} V\"", own("u0_v"))),
        ("y0 = \"3 mV\"", format!("y0 = \"{} V\"", own("y0_v"))),
        ("out = \"1e-8[V^2]\"\nv = \"q\"", "out = \"from_recording\"".to_owned()),
        ("skip = \"0.2 s\"", "skip = \"0.2 s\"\nprocess_noise = { v = \"from_recording\" }".to_owned()),
    ] {
        assert_eq!(experiment.matches(stated).count(), 1, "{stated}");
        experiment = experiment.replace(stated, &with);
    }
    let rows = data("silverbox/snls80mv.csv");
    let kept = rows.lines().skip(1 + 40_500).take(ROWS).map(|row| row.split_once(',').unwrap());
    let (before, signal) = kept.map(|(u, y)| (u.to_owned(), y.parse::<f64>().unwrap())).unzip();
    MeasuredRecording {
        name: "Silverbox".to_owned(),
        experiment,
        file: "train.csv",
        header: "u_V,y_V",
        before,
        signal,
        from: 123,
    }
}

/// A free decay of the seismometer, with the numbers of the independent fit.
fn decay(name: &str) -> MeasuredRecording {
    let expected: serde_json::Value =
        serde_json::from_str(&data("seismometer_free_decay/expected.json")).unwrap();
    let case = |key: &str| expected["cases"][name][key].as_f64().unwrap();
    let mut experiment = SEISMOMETER.to_owned();
    for (stated, with) in [
        ("role = \"ring_down\"", "role = \"test\"".to_owned()),
        ("0.7 rad/s", format!("{} rad/s", case("f0_hz") * std::f64::consts::TAU)),
        ("damping = 0.1", format!("damping = {}", case("zeta"))),
        ("\"1 mV\"", format!("\"{} V\"", case("offset"))),
        ("noise = \"1e-4 V^2\"\n", String::new()),
        ("out = \"noise\"", "out = \"from_recording\"".to_owned()),
        (", \"noise\"]", "]".to_owned()),
        ("skip = \"0 s\"", "skip = \"5 s\"\nprocess_noise = { v = \"from_recording\" }".to_owned()),
        ("# Least squares take all samples.\ngate = false\n", String::new()),
    ] {
        assert_eq!(experiment.matches(stated).count(), 1, "{stated}");
        experiment = experiment.replace(stated, &with);
    }
    let rows = data(&format!("seismometer_free_decay/{name}"));
    let kept = rows.lines().skip(1).map(|row| row.split_once(',').unwrap());
    let parsed = kept.map(|(t, v)| (t.to_owned(), v.parse::<f64>().unwrap()));
    let in_window = parsed.filter(|(t, _)| {
        let time: f64 = t.parse().unwrap();
        (case("t_start_s") - 1e-9..=case("t_end_s") + 1e-9).contains(&time)
    });
    let (before, signal) = in_window.unzip();
    MeasuredRecording {
        name: format!("seismometer, {}", name.trim_end_matches(".csv")),
        experiment,
        file: "decay.csv",
        header: "time_s,voltage_V",
        before,
        signal,
        from: 51,
    }
}

const DECAYS: [&str; 6] = [
    "no_magnet_1.csv",
    "magnet_20mm.csv",
    "magnet_10mm.csv",
    "magnet_11mm.csv",
    "magnet_75mm.csv",
    "blow_1.csv",
];

#[test]
#[ignore = "needs KALMEMS_REFERENCE_DATA"]
fn outliers_of_measured_devices_are_located_and_cost_little() {
    println!(
        "| recording | signal | outliers | of them rejected | others rejected | error | losses and returns | grade |"
    );
    println!("|---|---|--:|--:|--:|--:|--:|---|");
    let recordings = std::iter::once(silverbox()).chain(DECAYS.map(decay));
    for (place, recording) in recordings.enumerate() {
        let seed = 820 + place as u64;
        let clean = recording.outcome(&recording.signal);
        recording.judge(&clean, &[], "as measured");
        recording.judge(&clean, &recording.outliers(1e-3, 0, seed), "0.1 % outliers");
        recording.judge(&clean, &recording.outliers(1e-2, 0, seed), "1 % outliers");
        recording.judge(&clean, &recording.outliers(0.0, 8, seed), "8 in a row");
    }
}

/// Two seconds without a sample, a fifth of a cycle, are bridged.
#[test]
#[ignore = "needs KALMEMS_REFERENCE_DATA"]
fn missing_samples_of_a_measured_decay_cost_little() {
    for name in DECAYS {
        let recording = decay(name);
        let clean = recording.outcome(&recording.signal);
        let told = MeasuredRecording { experiment: clean.experiment, ..recording };
        let mut signal = told.signal.clone();
        signal[told.from + 50..told.from + 70].fill(f64::NAN);
        let found = told.outcome(&signal);
        println!("{name}: {:.3} times the error with 20 samples missing", found.error / clean.error);
        assert!(found.error <= 1.3 * clean.error && found.trajectory.lock.held(), "{name}");
    }
}
