//! The threshold-sensing scanner's parameters from free decays, against the truth, the Cramér–Rao bound, and what an
//! independent program identified.

use kalmems::identify::{Identification, IdentifyError};
use kalmems::progress::Silent;
use kalmems::rigs::published;
use kalmems::rigs::threshold_scanner::device::ThresholdScanner;
use kalmems::rigs::threshold_scanner::identification::{
    CurvePoint, DecayError, DecayFit, DecayRecord, fit_curve, fit_decay, unknown,
};
use kalmems::simulate::WhiteNoise;
use kalmems_core::{LinearProcess, Lu, Mat, NoiseDensity, Process};
use kalmems_models::capacitance::CurveShape;
use std::f64::consts::TAU;
use std::path::PathBuf;

/// V, of the comb's signal and of the position detector.
const NOISE: [f64; 2] = [0.0435, 0.005];
/// The detector's distance over its gain: V at 45°.
const DETECTOR: f64 = 0.0327 / 0.5e-3;
/// R_s·V_bias in Ω·V.
const TRANSIMPEDANCE: f64 = 10e6 * 10.0;

/// What a record is made of, and what is to be found again.
#[derive(Clone, Copy)]
struct Device {
    /// [ω_n, ζ, θ(0), θ̇(0), θ_th, N_g, N_θ, y₀, τ, offset of the reference].
    numbers: [f64; 10],
}

/// Where the numbers that are compared stand in [`Device`] and among the fit's unknowns.
const COMPARED: [(&str, usize, usize); 6] = [
    ("f_n", 0, unknown::NATURAL_RATE),
    ("zeta", 1, unknown::DAMPING_RATIO),
    ("theta_th", 4, unknown::THRESHOLD),
    ("N_g", 5, unknown::GAIN),
    ("N_theta", 6, unknown::STEEPNESS),
    ("delay", 8, unknown::DELAY),
];

struct Record {
    interval_s: f64,
    signal: Vec<f64>,
    angle: Vec<f64>,
}

impl Device {
    /// The published one from this phase of its motion, in cycles.
    fn from(phase: f64) -> Self {
        let rate = TAU * 624.6;
        let (sine, cosine) = (TAU * phase).sin_cos();
        let start = [0.15 * sine, 0.15 * rate * cosine];
        let numbers = [rate, 0.0066, start[0], start[1], 0.0037, 2.82e-3, 76.0, 0.002, 0.114e-3, 0.0];
        Self { numbers }
    }

    /// The step of a free swing over an interval.
    fn step(&self, interval_s: f64) -> LinearProcess<f64, 2, 0> {
        let [rate, damping, ..] = self.numbers;
        let a = Mat([[0.0, 1.0], [-rate * rate, -2.0 * damping * rate]]);
        LinearProcess::exact(&a, &Mat::zero(), &NoiseDensity::none(), interval_s)
    }

    /// Both channels in V, without noise.
    fn channels(&self, interval_s: f64, count: usize) -> [Vec<f64>; 2] {
        let [_, _, angle, rate, threshold, gain, steepness, offset, delay, late] = self.numbers;
        let step = self.step(interval_s);
        let mut now = [angle, rate];
        let mut shown = self.step(-delay).step(&now, &[]);
        let (mut signal, mut position) = (Vec::new(), Vec::new());
        for _ in 0..count {
            let logistic = 1.0 / (1.0 + (-steepness * (now[0] - threshold)).exp()) - 0.5;
            signal.push(gain * logistic * now[1] + offset);
            position.push((shown[0] + late).tan() * DETECTOR);
            now = step.step(&now, &[]);
            shown = step.step(&shown, &[]);
        }
        [signal, position]
    }

    fn record(&self, interval_s: f64, count: usize, seed: u64) -> Record {
        let mut noise = [0, 1].map(|stream| WhiteNoise::new(seed, stream));
        let [mut signal, position] = self.channels(interval_s, count);
        for volts in &mut signal {
            *volts += NOISE[0] * noise[0].sample();
        }
        let angle =
            position.iter().map(|volts| ((volts + NOISE[1] * noise[1].sample()) / DETECTOR).atan()).collect();
        Record { interval_s, signal, angle }
    }

    /// The Cramér–Rao bound of each number, from differences of the channels.
    fn bound(&self, interval_s: f64, count: usize) -> [f64; 10] {
        let size = [1.0, 1e-3, 1e-3, 1.0, 1e-3, 1e-4, 1.0, 1e-3, 1e-6, 1e-3];
        let moved = |i: usize, sign: f64| {
            let mut device = *self;
            device.numbers[i] += sign * 1e-3 * size[i];
            device.channels(interval_s, count)
        };
        let columns: Vec<[Vec<f64>; 2]> = (0..10)
            .map(|i| {
                let (up, down) = (moved(i, 1.0), moved(i, -1.0));
                [0, 1].map(|c| up[c].iter().zip(&down[c]).map(|(u, d)| (u - d) / (2e-3 * NOISE[c])).collect())
            })
            .collect();
        let product = |i: usize, j: usize| -> f64 {
            (0..2).flat_map(|c| columns[i][c].iter().zip(&columns[j][c])).map(|(a, b)| a * b).sum()
        };
        let information = Mat::<f64, 10, 10>::from_fn(product);
        let covariance = Lu::of(&information).unwrap().inverse();
        std::array::from_fn(|i| size[i] * covariance.0[i][i].sqrt())
    }

    /// C(θ) − C(θ_th) in F: −N_g/(N_θ·R·V)·2·ln cosh(u/2)/2 …, as ∫(1/(1 + e^{−u}) − ½)du = ln cosh(u/2).
    fn capacitance(&self, angle: f64) -> f64 {
        let [.., threshold, gain, steepness, _, _, _] = self.numbers;
        -gain / (steepness * TRANSIMPEDANCE) * (0.5 * steepness * (angle - threshold)).cosh().ln()
    }
}

impl Record {
    fn fitted(&self) -> Result<DecayFit, DecayError> {
        let record = DecayRecord {
            interval_s: self.interval_s,
            signal: &self.signal,
            angle: &self.angle,
            multiple: 1.0,
            shape: CurveShape::Logistic,
        };
        fit_decay(&record, &Silent)
    }

    fn curve(&self, fitted: &DecayFit) -> Vec<CurvePoint> {
        let threshold = fitted.fit.parameters[unknown::THRESHOLD];
        fit_curve(&self.signal, &fitted.motion, threshold, TRANSIMPEDANCE).unwrap()
    }
}

/// The root mean square error of the free-form capacitance, in F.
fn capacitance_error(device: &Device, curve: &[CurvePoint]) -> f64 {
    let squares = curve.iter().map(|point| (point.capacitance[0] - device.capacitance(point.angle)).powi(2));
    (squares.sum::<f64>() / curve.len() as f64).sqrt()
}

#[test]
fn a_record_without_noise_gives_the_device_back() {
    // Delays of either sign, a falling comb, a reference that is off.
    for (delay, gain, off) in [(0.114e-3, 2.82e-3, 0.0), (-0.2e-3, -2.82e-3, 0.004)] {
        let mut device = Device::from(0.3);
        (device.numbers[8], device.numbers[5], device.numbers[9]) = (delay, gain, off);
        let [signal, position] = device.channels(10e-6, 4000);
        let angle = position.iter().map(|volts| (volts / DETECTOR).atan()).collect();
        let found = Record { interval_s: 10e-6, signal, angle }.fitted().unwrap();
        for (name, of_device, of_fit) in COMPARED {
            let (truth, ours) = (device.numbers[of_device], found.fit.parameters[of_fit]);
            assert!((ours / truth - 1.0).abs() < 1e-6, "{name}: {ours} {truth}");
        }
        assert!((found.fit.parameters[unknown::ANGLE_OFFSET] - off).abs() < 1e-9);
        assert!((found.fit.parameters[unknown::OFFSET] - 0.002).abs() < 1e-9);
    }
}

#[test]
fn a_few_noisy_records_agree_with_their_standard_errors() {
    for seed in 0..3 {
        let device = Device::from(0.3 * seed as f64);
        let record = device.record(8e-6, 5000, seed);
        let found = record.fitted().unwrap();
        for (name, of_device, of_fit) in COMPARED {
            let parameter = found.fit.parameter(of_fit);
            let off = (parameter.value - device.numbers[of_device]) / parameter.deviation;
            assert!(off.abs() < 4.0, "{name}: {off} standard errors");
        }
        for (deviation, truth) in found.deviations.iter().zip([NOISE[0], NOISE[1] / DETECTOR]) {
            assert!((deviation / truth - 1.0).abs() < 0.05, "{deviation} {truth}");
        }
        assert!(found.whiteness.iter().all(kalmems::identify::Whiteness::is_white));
        assert!(capacitance_error(&device, &record.curve(&found)) < 45e-15);
    }
}

#[test]
fn what_is_no_free_decay_is_named() {
    let device = Device::from(0.1);
    let record = device.record(8e-6, 2400, 1);
    let with = |signal: Vec<f64>, angle: Vec<f64>| Record { interval_s: 8e-6, signal, angle }.fitted();
    let flat = with(vec![0.3; 2400], record.angle.clone());
    assert!(matches!(flat, Err(DecayError::NoMotion { channel: "signal" })), "{flat:?}");
    let none = with(record.signal.clone(), vec![f64::NAN; 2400]);
    assert!(matches!(none, Err(DecayError::NoMotion { channel: "reference" })), "{none:?}");
    let short = with(record.signal[..1000].to_vec(), record.angle[..1000].to_vec());
    assert!(matches!(short, Err(DecayError::TooShort { .. })), "{short:?}");
    let mut noise = WhiteNoise::new(4, 0);
    let unrelated = with((0..2400).map(|_| noise.sample()).collect(), record.angle);
    assert!(matches!(unrelated, Err(DecayError::Unrelated { .. })), "{unrelated:?}");
}

/// The smallest and largest count of `n` trials of chance `p` that leave less than half a per cent on each side.
fn binomial_interval(n: u64, p: f64) -> [u64; 2] {
    use statrs::distribution::{Binomial, DiscreteCDF};
    let law = Binomial::new(p, n).unwrap();
    [law.inverse_cdf(0.005), law.inverse_cdf(0.995)]
}

#[test]
#[ignore = "slow"]
fn slow_errors_are_those_of_the_bound_and_intervals_hold_the_truth() {
    const RECORDS: u64 = 120;
    let (interval_s, count) = (2e-6, 40_000);
    let mut squares = [0.0; COMPARED.len()];
    let mut bounds = [0.0; COMPARED.len()];
    let mut covered = [0_u64; COMPARED.len()];
    let mut largest = 0.0_f64;
    let mut capacitance = 0.0;
    for seed in 0..RECORDS {
        let device = Device::from(seed as f64 / RECORDS as f64);
        let record = device.record(interval_s, count, seed);
        let found = record.fitted().unwrap();
        let bound = device.bound(interval_s, count);
        for (i, (_, of_device, of_fit)) in COMPARED.into_iter().enumerate() {
            let parameter = found.fit.parameter(of_fit);
            let error = parameter.value - device.numbers[of_device];
            squares[i] += error * error;
            bounds[i] += bound[of_device].powi(2);
            covered[i] += u64::from(error.abs() < 1.96 * parameter.deviation);
        }
        let error = capacitance_error(&device, &record.curve(&found));
        largest = largest.max(error);
        capacitance += error * error / RECORDS as f64;
    }
    let [low, high] = binomial_interval(RECORDS, 0.95);
    for (i, (name, ..)) in COMPARED.into_iter().enumerate() {
        let scale = if i == 0 { 1.0 / TAU } else { 1.0 };
        let (error, bound) =
            ((squares[i] / RECORDS as f64).sqrt() * scale, (bounds[i] / RECORDS as f64).sqrt() * scale);
        println!(
            "{name}: rms error {error:.3e}, bound {bound:.3e}, ratio {:.3}; {} of {RECORDS} covered",
            error / bound,
            covered[i]
        );
        assert!(error <= 1.3 * bound, "{name}: {error:e} {bound:e}");
        assert!((low..=high).contains(&covered[i]), "{name}: {} outside {low} to {high}", covered[i]);
    }
    println!("C(theta): rms {:.2} fF, at most {:.2} fF", 1e15 * f64::sqrt(capacitance), 1e15 * largest);
    assert!(largest < 45e-15);
}

#[test]
#[ignore = "needs KALMEMS_REFERENCE_DATA"]
fn a_recording_of_another_program_is_identified() {
    let folder = std::env::var_os("KALMEMS_REFERENCE_DATA").expect("KALMEMS_REFERENCE_DATA names a folder");
    let folder = PathBuf::from(folder).join("recordings/threshold-nominal");
    let text = std::fs::read_to_string(folder.join("recording.csv")).unwrap();
    let column = |place: usize| -> Vec<f64> {
        text.lines().skip(1).map(|line| line.split(',').nth(place).unwrap().parse().unwrap()).collect()
    };
    let json = |file: &str| -> serde_json::Value {
        serde_json::from_str(&std::fs::read_to_string(folder.join(file)).unwrap()).unwrap()
    };
    let (expected, device) = (json("expected.json"), json("device.json"));
    let expected = &expected["identified"];
    let truth = |name: &str| device[name]["value"].as_f64().unwrap();
    let angle = column(3).iter().map(|volts| (volts / DETECTOR).atan()).collect();
    let record = Record { interval_s: 2e-6, signal: column(2), angle };
    let found = record.fitted().unwrap();
    let compare = |name: &str, value: f64, deviation: f64, reference: f64, tolerance: f64| {
        println!("{name}: {value:.6e} +- {deviation:.1e}, expected {reference:.6e} +- {tolerance:.1e}");
        assert!((value - reference).abs() <= tolerance, "{name}: {value} {reference}");
    };
    let p = |place: usize| found.fit.parameter(place);
    let number = |name: &str, key: &str| expected[name][key].as_f64().unwrap();
    let fixed = |name: &str, value: f64, deviation: f64, key: &str| {
        compare(name, value, deviation, number(name, key), number(name, "tol"));
    };
    let relative = |name: &str, value: f64, deviation: f64| {
        let reference = number(name, "ref");
        compare(name, value, deviation, reference, reference * number(name, "tol_rel"));
    };
    let rate = p(unknown::NATURAL_RATE);
    fixed("natural_frequency_Hz", rate.value / TAU, rate.deviation / TAU, "ref");
    let damping = p(unknown::DAMPING_RATIO);
    fixed("damping_ratio", damping.value, damping.deviation, "ref");
    let threshold = p(unknown::THRESHOLD);
    fixed("threshold_angle_rad", threshold.value, threshold.deviation, "ref_fit");
    fixed("threshold_angle_rad", threshold.value, threshold.deviation, "truth");
    let offset = p(unknown::OFFSET);
    fixed("cap_offset_V", offset.value, offset.deviation, "ref");
    relative("Ng_V_s_per_rad", p(unknown::GAIN).value, p(unknown::GAIN).deviation);
    relative("Ntheta_per_rad", p(unknown::STEEPNESS).value, p(unknown::STEEPNESS).deviation);
    let slope = found.fit.derived(|p| p[unknown::GAIN] * p[unknown::STEEPNESS] * 0.25);
    relative("small_angle_gain_slope_Ng_Ntheta_over_4", slope.value, slope.deviation);
    let delay = p(unknown::DELAY);
    compare("delay", delay.value, delay.deviation, truth("psd_delay"), 4.0 * delay.deviation);
    let [signal, reference] = found.deviations;
    compare("noise", signal, 0.0, truth("noise_cap_sigma"), 0.02 * signal);
    compare("noise of the reference", reference * DETECTOR, 0.0, truth("noise_psd_sigma"), 1e-4);
}

/// An experiment on the reference recording, told a device that is off and no delay.
const EXPERIMENT: &str = r#"
name = "free-decay"
[device.threshold_scanner.resonator]
natural_frequency = "630 Hz"
damping_ratio = 0.005
[device.threshold_scanner.comb]
threshold_angle = "0 rad"
gain = "2.5e-3 V s/rad"
steepness = "60 1/rad"
[device.threshold_scanner.readout]
feedback_resistance = "10 Mohm"
bias = "10 V"
offset = "0 V"
feedthrough_capacitance = "0 F"
noise_variance = "1e-3 V^2"
[device.threshold_scanner.position_detector]
gain = "0.5 mm/V"
distance = "32.7 mm"
noise_variance = "1e-4 V^2"
[[recording]]
role = "ring_down"
file = "recording.csv"
clock = { column = "time_s" }
channels = { drive = "drive_V", signal = "cap_V" }
[recording.reference]
channels = { position = "psd_V" }
delay = "0.1 ms"
"#;

#[test]
#[ignore = "needs KALMEMS_REFERENCE_DATA"]
fn the_rig_identifies_an_experiment_and_puts_the_values_in_their_places() {
    let folder = std::env::var_os("KALMEMS_REFERENCE_DATA").expect("KALMEMS_REFERENCE_DATA names a folder");
    let path = PathBuf::from(folder).join("recordings/threshold-nominal/experiment.toml");
    let experiment = published().parse(EXPERIMENT, &path).unwrap();
    let found = published().rig(&experiment).unwrap().identify(&experiment, &Silent).unwrap();
    let value = |name: &str| {
        let parameter = found.parameters.iter().find(|p| p.name.starts_with(name)).unwrap();
        println!("{name}: {:.6e} +- {:.1e} {}", parameter.value, parameter.standard_error, parameter.unit);
        parameter.value
    };
    assert!((value("natural frequency") - 624.6).abs() < 0.02);
    assert!((value("damping ratio") - 0.0066).abs() < 3e-5);
    assert!((value("threshold angle") - 0.0037).abs() < 3e-4);
    assert!((value("comb gain") / 2.82e-3 - 1.0).abs() < 0.02);
    assert!((value("comb steepness") / 76.0 - 1.0).abs() < 0.04);
    // A delay that is stated adds up with what is found beyond it.
    assert!((value("delay") - 0.114e-3).abs() < 4e-7);
    assert!((value("noise of the reference") - 0.005).abs() < 1e-4);
    assert!(found.warnings.is_empty(), "{:?}", found.warnings);
    assert_eq!(found.figures.len(), 3);
    // The values are those of the device that comes back, and of its reference.
    let device = found.experiment.device::<ThresholdScanner>().unwrap();
    assert!((device.resonator.natural_frequency.si() - 624.6).abs() < 0.02);
    assert!((device.resonator.damping_ratio.si() - 0.0066).abs() < 3e-5);
    assert!((device.comb.steepness.si() / 76.0 - 1.0).abs() < 0.04);
    assert!((device.readout.noise_variance.si() / NOISE[0].powi(2) - 1.0).abs() < 0.05);
    let reference = found.experiment.recordings[0].reference.as_ref().unwrap();
    assert!((reference.delay_s() - 0.114e-3).abs() < 4e-7);
    // Without a reference there is no scale.
    let (alone, _) = EXPERIMENT.split_once("[recording.reference]").unwrap();
    let alone = published().parse(alone, &path).unwrap();
    let why = published().rig(&alone).unwrap().identify(&alone, &Silent).unwrap_err().to_string();
    assert!(why.contains("no reference"), "{why}");
}

/// The decay of seed 1 with these values of the drive and the signal, as the rig identifies it.
fn identified(
    volts: &dyn Fn(usize) -> f64,
    signal: &dyn Fn(usize, f64) -> f64,
) -> Result<Identification, IdentifyError> {
    let folder = tempfile::tempdir().unwrap();
    let record = Device::from(0.1).record(8e-6, 2400, 1);
    let mut text = "time_s,drive_V,cap_V,psd_V\n".to_owned();
    for (k, (y, angle)) in record.signal.iter().zip(&record.angle).enumerate() {
        let (time_s, y) = (8e-6 * k as f64, signal(k, *y));
        text += &format!("{time_s:.6},{},{y},{}\n", volts(k), angle.tan() * DETECTOR);
    }
    std::fs::write(folder.path().join("recording.csv"), text).unwrap();
    let experiment = published().parse(EXPERIMENT, &folder.path().join("experiment.toml")).unwrap();
    published().rig(&experiment).unwrap().identify(&experiment, &Silent)
}

/// A decay that begins while the drive is still on is no free decay.
#[test]
fn a_drive_that_is_not_off_is_named() {
    let of = |volts: &dyn Fn(usize) -> f64| identified(volts, &|_, y| y);
    let why = of(&|k| if k < 40 { 60.0 } else { 0.0 }).unwrap_err().to_string();
    assert!(why.contains("not off") && why.contains("60 V at 0 s") && why.contains("40 of 2400"), "{why}");
    // The rest of a transient, and what a converter rounds to, are.
    assert!(of(&|k| 0.9 * (-(k as f64) / 10.0).exp()).is_ok());
}

/// A signal at the rail of its converter is refused as by the estimate, and single samples of ±2 V are left out and counted.
#[test]
fn clipping_is_refused_and_spikes_are_left_out() {
    let of = |signal: &dyn Fn(usize, f64) -> f64| identified(&|_| 0.0, signal);
    let why = of(&|_, y| y.clamp(-0.4, 0.4)).unwrap_err().to_string();
    println!("{why}");
    assert!(why.contains("is clipped in"), "{why}");
    let gain = |found: &Identification| {
        let gain = found.parameters.iter().find(|p| p.name.starts_with("comb gain")).unwrap();
        println!("{:e} ± {:.1e}, {:?}", gain.value, gain.standard_error, found.warnings);
        assert!((gain.value - 2.82e-3).abs() < 4.0 * gain.standard_error, "{gain:?}");
        gain.value
    };
    let clean = gain(&of(&|_, y| y).unwrap());
    let spikes =
        |k: usize, y: f64| if k % 240 == 100 { y + if k % 480 == 100 { 2.0 } else { -2.0 } } else { y };
    let found = of(&spikes).unwrap();
    assert!((gain(&found) / clean - 1.0).abs() < 1e-3);
    assert!(
        found.warnings.iter().any(|said| said.contains("10 samples are outliers")),
        "{:?}",
        found.warnings
    );
}
