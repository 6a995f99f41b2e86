//! Two axes on one electrode: band plan, simulation, the start from the signal, and what the filters make of it.

mod smoothing;
mod wrong_models;

use kalmems::config::Experiment;
use kalmems::estimate::{EstimateError, Trajectory, judge_lock};
use kalmems::progress::Silent;
use kalmems::recording::SampledRecording;
use kalmems::results::{
    Metrics, Output, RunInfo, Verdict, Work, estimate_figures, notices, summary_table, write_simulation,
};
use kalmems::rigs::Rig;
use kalmems::rigs::equations::PresetRig;
use kalmems::rigs::published;
use kalmems::rigs::shared_scanner::SECOND_AXIS;
use kalmems::rigs::shared_scanner::device::SharedScanner;
use kalmems::rigs::shared_scanner::two_axes::{
    BandPlan, LinePlace, PlannedDrive, ProtectedBand, TwoAxisHardware,
};
use kalmems::simulate::{Drive, Simulator, Tone, WhiteNoise, floquet_exponent};
use kalmems::workflow;
use kalmems_core::Measurement;
use kalmems_models::dynamics::{ParametricScanner, TwoAxisScanner};
use std::f64::consts::{PI, TAU};
use std::fmt::Write as _;
use std::ops::Range;
use std::path::PathBuf;
use std::time::{Duration, SystemTime};

const DRIVES_HZ: [f64; 2] = [31_350.0, 13_080.0];

fn path() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../examples/shared_scanner/two_axes.toml")
}

/// The example with some of its text replaced.
fn changed(changes: &[(&str, &str)]) -> Experiment {
    let mut text = std::fs::read_to_string(path()).unwrap();
    for (from, to) in changes {
        assert!(text.contains(from), "{from}");
        text = text.replace(from, to);
    }
    published().parse(&text, &path()).unwrap()
}

fn rig() -> PresetRig<SharedScanner> {
    PresetRig::of(&SECOND_AXIS)
}

fn hardware() -> TwoAxisHardware {
    TwoAxisHardware::of(&changed(&[])).unwrap()
}

/// What filters are told of the axes, in the example's place.
#[derive(Clone, Copy)]
struct Told {
    /// Factors on the stiffnesses of x and y.
    stiffness: [f64; 2],
    /// A factor on the readout's gain.
    gain: f64,
    /// The density of the accelerations' noise in rad²/s³.
    density: f64,
    skip_s: f64,
}

const TRUTH: Told = Told { stiffness: [1.0; 2], gain: 1.0, density: 1e4, skip_s: 10e-3 };

/// An experiment on `recording.csv` with these filters, as TOML tables.
fn told(told: &Told, filters: &str) -> String {
    let Told { stiffness: [x, y], gain, density, skip_s } = *told;
    let text = std::fs::read_to_string(path()).unwrap();
    let device = &text[..text.find("[simulate]").unwrap()];
    let device = device
        .replace("stiffness = \"1.10e-4 N m\"", &format!("stiffness = \"{:e} N m\"", 1.10e-4 * x))
        .replace("stiffness = \"1.00e-4 N m\"", &format!("stiffness = \"{:e} N m\"", 1.00e-4 * y))
        .replace("gain = \"-0.3574 V/pF\"", &format!("gain = \"{} V/pF\"", -0.3574 * gain));
    let noise = format!("\"{density:e} rad^2/s^3\"");
    format!(
        "{device}[[recording]]
role = \"test\"
file = \"recording.csv\"
clock = {{ column = \"time_s\" }}
channels = {{ drive = \"drive_V\", signal = \"cap_V\" }}
[estimate]
skip = \"{skip_s:e} s\"
first_peak = \"positive\"
first_peak_y = \"positive\"
process_noise = {{ angular_acceleration_x = {noise}, angular_acceleration_y = {noise} }}
{filters}"
    )
}

/// A filter that starts from the signal, with more lines.
fn from_signal(name: &str, method: &str, lines: &str) -> String {
    format!(
        "[[estimate.filter]]\nname = \"{name}\"\nmethod = \"{method}\"\nstart = \"from_signal\"\n{lines}\n"
    )
}

fn drive(volts: [f64; 2]) -> Drive {
    let tone = |axis: usize| Tone { amplitude: volts[axis], frequency_hz: DRIVES_HZ[axis], phase_rad: 0.0 };
    Drive::Tones { offset: 90.0, tones: vec![tone(0), tone(1)] }
}

/// What would be recorded of a motion, and the motion: one sample per µs.
#[derive(Clone)]
struct Recorded {
    time_s: Vec<f64>,
    drive: Vec<f64>,
    signal: Vec<f64>,
    states: Vec<[f64; 4]>,
}

/// Steps of the simulation per sample; a filter has one.
const STEPS: usize = 4;

fn record(scanner: TwoAxisScanner<f64>, start: [f64; 4], skip: usize, samples: usize, seed: u64) -> Recorded {
    let mut simulator = Simulator::new(scanner, drive([90.0, 70.0]), 1e6 * STEPS as f64, start);
    (0..skip * STEPS).for_each(|_| simulator.step());
    recorded(&mut simulator, samples, seed)
}

/// What comes of a simulation from here on.
fn recorded(simulator: &mut Simulator<TwoAxisScanner<f64>, 4>, samples: usize, seed: u64) -> Recorded {
    let hardware = hardware();
    let mut noise = WhiteNoise::new(seed, 0);
    let mut recorded = Recorded { time_s: vec![], drive: vec![], signal: vec![], states: vec![] };
    for _ in 0..samples {
        let [y] = hardware.readout.predict(simulator.state());
        recorded.time_s.push(simulator.time_s());
        recorded.drive.push(simulator.drive());
        recorded.signal.push(y + hardware.noise_variance.sqrt() * noise.sample());
        recorded.states.push(*simulator.state());
        (0..STEPS).for_each(|_| simulator.step());
    }
    recorded
}

/// Numbers in [0, 1) that depend on the seed alone.
fn uniforms(seed: u64, count: usize) -> Vec<f64> {
    use statrs::distribution::{ContinuousCDF, Normal};
    let normal = Normal::new(0.0, 1.0).unwrap();
    let mut noise = WhiteNoise::new(seed, 7);
    (0..count).map(|_| normal.cdf(noise.sample())).collect()
}

/// A start of any phase with amplitudes of 4 to 12 degrees, each axis its own.
fn anywhere(seed: u64) -> [f64; 4] {
    let u = uniforms(seed, 4);
    let axis = |u: &[f64], drive_hz: f64| {
        let amplitude = (4.0 + 8.0 * u[0]).to_radians();
        let (sine, cosine) = (TAU * u[1]).sin_cos();
        [amplitude * sine, amplitude * PI * drive_hz * cosine]
    };
    let [x, y] = [axis(&u[..2], DRIVES_HZ[0]), axis(&u[2..], DRIVES_HZ[1])];
    [x[0], x[1], y[0], y[1]]
}

fn run(text: &str, recorded: &Recorded) -> Vec<Trajectory> {
    attempt(text, recorded).unwrap_or_else(|error| panic!("{error}"))
}

/// What the filters of an experiment make of a recording.
fn attempt(text: &str, recorded: &Recorded) -> Result<Vec<Trajectory>, EstimateError> {
    let folder = tempfile::tempdir().unwrap();
    let mut rows = String::from("time_s,drive_V,cap_V\n");
    for ((time_s, drive), signal) in recorded.time_s.iter().zip(&recorded.drive).zip(&recorded.signal) {
        writeln!(rows, "{time_s:.9},{drive:e},{signal:e}").unwrap();
    }
    let file = folder.path().join("recording.csv");
    std::fs::write(&file, rows).unwrap();
    let experiment = published().parse(text, &folder.path().join("experiment.toml")).unwrap();
    let recording = SampledRecording::read(&file, &rig().layout(&experiment, 0).unwrap()).unwrap();
    let found = rig().estimate(&experiment, 0, &recording, &Silent)?;
    Ok(found.into_iter().next().unwrap().trajectories)
}

/// RMS angle errors in degrees of both axes over some samples, each axis mirrored as fits best.
fn errors(trajectory: &Trajectory, recorded: &Recorded, over: Range<usize>) -> [f64; 2] {
    [0, 2].map(|state| {
        let rms = |sign: f64| {
            let squares = (over.clone())
                .map(|k| (sign * trajectory.states[state].mean[k] - recorded.states[k][state]).powi(2));
            (squares.sum::<f64>() / over.len() as f64).sqrt().to_degrees()
        };
        // Not a number where the filter stopped: then it is no small error either.
        let (same, mirrored) = (rms(1.0), rms(-1.0));
        if mirrored < same { mirrored } else { same }
    })
}

// ---- Simulation ----

/// Each axis under both drives moves as a scanner of one axis does under that voltage; the other's motion is nothing
/// to it. It is not the motion under its own drive alone: the other drive stiffens it.
#[test]
fn each_axis_is_a_scanner_under_the_voltage_of_both() {
    let scanner = hardware().scanner;
    let start = [0.1, 3000.0, 0.07, -900.0];
    let mut both = Simulator::new(scanner, drive([90.0, 70.0]), 1e6, start);
    let mut x = Simulator::new(scanner.x, drive([90.0, 70.0]), 1e6, [start[0], start[1]]);
    let mut y = Simulator::new(scanner.y, drive([90.0, 70.0]), 1e6, [start[2], start[3]]);
    let own = Drive::Sine { offset: 90.0, amplitude: 90.0, frequency_hz: DRIVES_HZ[0], phase_rad: 0.0 };
    let mut alone = Simulator::new(scanner.x, own, 1e6, [start[0], start[1]]);
    let mut apart = 0.0_f64;
    for _ in 0..5000 {
        both.step();
        x.step();
        y.step();
        alone.step();
        assert_eq!(*both.state(), [x.state()[0], x.state()[1], y.state()[0], y.state()[1]]);
        apart = apart.max((both.state()[0] - alone.state()[0]).abs());
    }
    println!("with and without the drive of y, x differs by up to {:.2} deg over 5 ms", apart.to_degrees());
    assert!(apart.to_degrees() > 1.0);
}

/// The gimbal's own inertia couples the motions too.
#[test]
fn the_gimbal_couples_the_motions() {
    let scanner = hardware().scanner;
    let coupled = TwoAxisScanner { gimbal_inertia: scanner.x.resonator.inertia, ..scanner };
    let at_rest = [0.1, 3000.0, 0.0, 0.0];
    let swinging = [0.1, 3000.0, 0.07, -900.0];
    let after = |scanner, start| {
        let mut simulator = Simulator::new(scanner, drive([90.0, 70.0]), 1e6, start);
        (0..3000).for_each(|_| simulator.step());
        simulator.state()[0]
    };
    assert_eq!(after(scanner, at_rest), after(scanner, swinging));
    let moved = (after(coupled, at_rest) - after(coupled, swinging)).abs().to_degrees();
    println!("x differs by {moved:.3} deg after 3 ms for the motion of y");
    assert!(moved > 0.01);
}

// ---- Band plan ----

fn planned(drives_hz: [f64; 2]) -> PlannedDrive {
    PlannedDrive { offset: 90.0, amplitude: [90.0, 70.0], frequency_hz: drives_hz }
}

#[test]
fn the_example_is_clear_of_conflicts() {
    let plan = BandPlan::of(&hardware().scanner, &planned(DRIVES_HZ), BandPlan::GUARD_HZ);
    println!("{plan}");
    assert!(plan.is_clear());
    assert!(plan.oscillates.iter().all(|text| text.starts_with("starts by itself")));
    // Sines in the other order are the same drive.
    let swapped = PlannedDrive { amplitude: [70.0, 90.0], ..planned([DRIVES_HZ[1], DRIVES_HZ[0]]) };
    assert_eq!(BandPlan::of(&hardware().scanner, &swapped, BandPlan::GUARD_HZ), plan);
}

/// The lines of V² against its spectrum.
#[test]
fn the_lines_of_the_square_are_those_of_its_spectrum() {
    let plan = BandPlan::of(&hardware().scanner, &planned(DRIVES_HZ), BandPlan::GUARD_HZ);
    let drive = drive([90.0, 70.0]);
    // 30 Hz divides both drives: a whole period of the sum.
    let samples = 1 << 18;
    let square: Vec<f64> =
        (0..samples).map(|i| drive.at(f64::from(i) / (30.0 * f64::from(samples))).powi(2)).collect();
    let amplitude = |frequency_hz: f64| {
        let (mut c, mut s) = (0.0, 0.0);
        for (i, v) in (0_i32..).zip(&square) {
            let (sine, cosine) = (TAU * frequency_hz * f64::from(i) / (30.0 * f64::from(samples))).sin_cos();
            c += v * cosine;
            s += v * sine;
        }
        2.0 * c.hypot(s) / f64::from(samples)
    };
    let mut explained = 0.0;
    let in_square: Vec<_> = plan.lines.iter().filter(|line| line.place == LinePlace::SquareVoltage).collect();
    assert_eq!(in_square.len(), 6);
    for line in in_square {
        let expected = line.square_volts.unwrap();
        assert!((amplitude(line.frequency_hz) / expected - 1.0).abs() < 1e-6, "{line}");
        explained += 0.5 * expected * expected;
    }
    // Nothing else is there.
    let mean = square.iter().sum::<f64>() / f64::from(samples);
    let variance = square.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / f64::from(samples);
    assert!((variance / explained - 1.0).abs() < 1e-9);
}

/// A gimbal of half the mirror's resonance: the second harmonic of its drive is that of the mirror. The plan says so
/// and by how much it is above threshold; integration says that it does start the mirror, which has no drive.
#[test]
fn a_conflict_is_found_and_is_one() {
    let scanner = hardware().scanner;
    let resonator = kalmems_models::dynamics::TorsionalResonator {
        stiffness: 3.45e-4 * 0.25 * 6.0 / 3.45 * 0.96,
        ..scanner.y.resonator
    };
    let mut scanner = TwoAxisScanner { y: ParametricScanner { resonator, ..scanner.y }, ..scanner };
    // With little damping, so that half of V_y² is enough.
    scanner.x.resonator.damping = 1e-12;
    let at =
        |y_hz: f64| PlannedDrive { offset: 90.0, amplitude: [1.0, 90.0], frequency_hz: [31_300.0, y_hz] };
    let rest = BandPlan::of(&scanner, &at(15_690.0), 500.0).resonance_hz[0];
    let near = BandPlan::of(&scanner, &at(rest), 500.0);
    println!("{near}");
    assert!(!near.is_clear());
    let conflict = near
        .conflicts
        .iter()
        .find(|c| c.line.multiples == [0, 2] && c.line.place == LinePlace::SquareVoltage);
    let conflict = conflict.expect("the second harmonic of the drive of y");
    assert!(matches!(conflict.band, ProtectedBand::Parametric { axis: 0, order: 1, .. }));
    assert!(conflict.distance_hz.abs() < 1.0);
    let ratio = conflict.over_threshold.unwrap();
    assert!(ratio > 1.5, "{ratio}");
    // The mirror alone under the drive of y alone: Floquet's exponent about rest.
    let drive = |hz: f64| Drive::Sine { offset: 90.0, amplitude: 90.0, frequency_hz: hz, phase_rad: 0.0 };
    assert!(floquet_exponent(scanner.x, &drive(rest), 256).unwrap() > 0.0);
    assert!(floquet_exponent(scanner.x, &drive(rest - 400.0), 256).unwrap() < 0.0);
    // A smaller guard does not make a conflict of what is farther away.
    let far = BandPlan::of(&scanner, &at(rest - 400.0), 300.0);
    assert!(far.conflicts.iter().all(|c| c.line.multiples != [0, 2]), "{far}");
}

#[test]
fn suggested_drives_keep_their_stated_bands() {
    let scanner = hardware().scanner;
    let plan = BandPlan::of(&scanner, &planned(DRIVES_HZ), 6000.0);
    assert!(!plan.is_clear() && plan.to_string().contains("move a resonance"), "{plan}");
    let (frequency_hz, distance) = plan.suggestion.unwrap();
    let again = BandPlan::of(&scanner, &planned(frequency_hz), distance * 0.999);
    assert!(again.is_clear(), "{again}");
    assert!(distance >= plan.nearest.unwrap().distance_hz.abs());
}

// ---- Start from the signal ----

#[test]
fn a_signal_that_determines_no_start_is_refused() {
    let text = told(&Told { skip_s: 1e-3, ..TRUTH }, &from_signal("EKF", "ekf", ""));
    let scanner = hardware().scanner;
    let still = record(scanner, [0.15, 0.0, 0.0, 0.0], 0, 3000, 1);
    let moving = || record(scanner, [0.15, 0.0, 0.1, 0.0], 0, 3000, 1);
    assert!(attempt(&text, &moving()).is_ok());
    let refused = attempt(&text, &still).unwrap_err().to_string();
    assert!(
        refused.contains("`angle_y`: its line in the signal is") && refused.contains("it stands still"),
        "{refused}"
    );
    let mut loud = moving();
    loud.signal.iter_mut().for_each(|y| *y *= 10.0);
    let loud = attempt(&text, &loud).unwrap_err().to_string();
    assert!(loud.contains("`angle_x`: its line in the signal") && loud.contains("check gain"), "{loud}");
}

// ---- Estimate ----

fn median(values: &mut [f64]) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

/// What came of many starts.
#[derive(Clone, Copy, Debug, Default)]
struct Locks {
    /// Both axes within 0.5 deg over the last 2 ms.
    locked: usize,
    /// Both within 0.5 deg already from 2 to 4 ms.
    soon: usize,
    /// Not locked, and the monitor does not say so.
    undeclared: usize,
}

/// How wrong the filter's stiffnesses are, and the density of its accelerations' noise in rad²/s³.
type Model = (f64, f64);

/// Starts from the signal, and starts that know nothing: the centre of what is possible, as wide as that is.
fn locks(trials: u64, (stiffness_error, density): Model) -> [Locks; 2] {
    let model = Told { stiffness: [1.0 + stiffness_error; 2], density, ..TRUTH };
    let truth = hardware().scanner;
    let blind = "[[estimate.filter]]\nname = \"EKF\"\nmethod = \"ekf\"\n\
                 start = { angle_x = \"0.05 rad\", rate_x = \"0 rad/s\", angle_y = \"0.05 rad\", rate_y = \"0 rad/s\" }\n\
                 start_sd = { angle_x = \"0.15 rad\", rate_x = \"15e3 rad/s\", angle_y = \"0.15 rad\", rate_y = \"6e3 rad/s\" }\n";
    let texts = [told(&model, &from_signal("EKF", "ekf", "")), told(&model, blind)];
    let mut counts = [Locks::default(); 2];
    for seed in 0..trials {
        let recorded = record(truth, anywhere(seed), 0, 14_000, seed);
        for (text, count) in texts.iter().zip(&mut counts) {
            let trajectory = &run(text, &recorded)[0];
            let good = |range| errors(trajectory, &recorded, range).iter().all(|e| *e < 0.5);
            let locked = good(12_000..14_000);
            count.locked += usize::from(locked);
            count.soon += usize::from(good(2000..4000));
            count.undeclared +=
                usize::from(!locked && trajectory.lock.held() && trajectory.failure.is_none());
        }
    }
    println!(
        "stiffness {:+.1} %, q = {density:.0e}, of {trials}: from the signal {:?}, blind {:?}",
        100.0 * stiffness_error,
        counts[0],
        counts[1]
    );
    counts
}

#[test]
fn a_start_from_the_signal_locks() {
    let [found, _] = locks(5, (0.003, 1e8));
    assert_eq!((found.locked, found.soon, found.undeclared), (5, 5, 0));
}

/// Blind starts lock late or not at all; how often depends on the model that they trust.
#[test]
#[ignore = "slow"]
fn slow_starts_from_the_signal_lock_where_blind_ones_do_not() {
    for model in [(0.0, 1e4), (0.003, 1e8)] {
        let [found, blind] = locks(200, model);
        assert!(found.locked >= 196 && found.soon >= 196, "{found:?}");
        assert_eq!(found.undeclared, 0);
        assert!(blind.soon < found.soon && blind.locked <= found.locked, "{blind:?}");
    }
}

/// The steady motion over several noises: angle and phase of both axes.
fn accuracy(seeds: u64) -> [[f64; 2]; 2] {
    let text = told(&TRUTH, &(from_signal("EKF", "ekf", "") + &from_signal("UKF", "ukf", "")));
    let scanner = hardware().scanner;
    let mut found = [[vec![], vec![]], [vec![], vec![]]];
    for seed in 0..seeds {
        let mut start = [-0.117, -12.8e3, -0.082, -4.1e3];
        // Either axis in either sign.
        if seed % 2 == 1 {
            start[0] = -start[0];
            start[1] = -start[1];
        }
        if seed % 4 > 1 {
            start[2] = -start[2];
            start[3] = -start[3];
        }
        let recorded = record(scanner, start, 20_000, 24_000, seed);
        for (filter, trajectory) in run(&text, &recorded).iter().enumerate() {
            assert!(trajectory.lock.held() && trajectory.failure.is_none(), "seed {seed}");
            let consistency = trajectory.consistency(trajectory.scored(8e-3)).unwrap();
            assert!((consistency.mean_nis - 1.0).abs() < 0.05, "{consistency:?}");
            for (axis, error) in errors(trajectory, &recorded, 8_000..24_000).into_iter().enumerate() {
                found[filter][axis].push(error);
            }
        }
    }
    for (filter, name) in [(0, "EKF"), (1, "UKF")] {
        for (axis, values) in found[filter].iter_mut().enumerate() {
            let middle = median(values);
            let (low, high) = (values[0], values[values.len() - 1]);
            println!("{name} {}: angle {middle:.4} deg ({low:.4} to {high:.4})", ['x', 'y'][axis]);
        }
    }
    found.map(|axes| axes.map(|mut values| median(&mut values)))
}

#[test]
fn the_steady_motion_is_followed() {
    let found = accuracy(2);
    assert!(found.iter().flatten().all(|e| *e < 0.02), "{found:?}");
}

#[test]
#[ignore = "slow"]
fn slow_accuracy_over_noises() {
    let found = accuracy(16);
    assert!(found.iter().flatten().all(|e| *e < 0.006), "{found:?}");
}

/// From the file to the figures of both axes: simulated, written, read, estimated and compared.
#[test]
fn the_example_from_end_to_end() {
    let experiment = changed(&[("integration_rate = \"10 MHz\"", "integration_rate = \"1 MHz\"")]);
    let folder = tempfile::tempdir().unwrap();
    let target = folder.path().join("simulated");
    let info = || RunInfo { started: SystemTime::UNIX_EPOCH, took: Duration::ZERO };
    let simulation = rig().simulate(&experiment).unwrap();
    let output = Output::begin(&target, &Work::named("simulate", "two axes")).unwrap();
    let summary = write_simulation(&experiment, &rig(), simulation.as_ref(), &output, info, &Silent).unwrap();
    output.commit().unwrap();
    assert!(summary.outlook.unwrap().contains("band plan: clear"));
    let simulated = published().load(&target.join("experiment.toml")).unwrap();
    let outcome = workflow::estimate(published(), &simulated, &Silent).unwrap();
    let metrics = Metrics::of(&outcome);
    let angles = |wrong: bool| {
        let mut angles = Vec::new();
        for estimator in metrics.estimators() {
            let errors = estimator.errors.as_ref().unwrap();
            assert_eq!(errors.each().map(|e| e.of).collect::<Vec<_>>(), ["angle_x", "angle_y"]);
            for errors in errors.each() {
                println!(
                    "{} {}: angle {:.4} deg, peak phase {:.4} deg, amplitude {:.2} deg",
                    estimator.name,
                    errors.of,
                    errors.angle.rmse_deg,
                    errors.peak_phase_rmse_deg.unwrap(),
                    errors.amplitude_reference_deg.unwrap()
                );
                assert_eq!(errors.peaks_without_partner, 0);
                angles.push((errors.angle.rmse_deg, errors.peak_phase_rmse_deg.unwrap()));
                assert_eq!(errors.sign_disagrees, wrong);
            }
        }
        angles
    };
    for (angle, phase) in angles(false) {
        assert!(angle < 0.02 && phase < 0.1, "{angle} {phase}");
    }
    assert!(metrics.estimators().all(|e| e.verdict == Verdict::Consistent && e.lock.held()));

    // The other sign of one axis is the answer mirrored, axis by axis; the reference then says that it is wrong.
    let text = std::fs::read_to_string(target.join("experiment.toml")).unwrap();
    let turned = text.replace("first_peak_y = \"positive\"", "first_peak_y = \"negative\"");
    assert_ne!(text, turned);
    let turned = published().parse(&turned, &target.join("experiment.toml")).unwrap();
    let other = workflow::estimate(published(), &turned, &Silent).unwrap();
    let states = |outcome: &workflow::Outcome| {
        outcome.recordings[0].segments[0].estimate.trajectories[0]
            .states
            .iter()
            .map(|s| s.mean.clone())
            .collect::<Vec<_>>()
    };
    let (ours, theirs) = (states(&outcome), states(&other));
    assert_eq!(ours[0], theirs[0]);
    assert_eq!(ours[2].iter().map(|v| -v).collect::<Vec<_>>(), theirs[2]);
    assert!(Metrics::of(&other).estimators().all(|e| e.verdict == Verdict::WrongSign));
}

#[test]
fn files_that_are_wrong_say_where() {
    for (from, to, expected) in [
        (
            "\"from_signal\"\n\n",
            "{ angle_x = \"0.1 rad\", rate_x = \"0 rad/s\", angle_y = \"0 rad\", rate_y = \"0 rad/s\" }\nstart_sd = { angle_x = \"1 rad\" }\n\n",
            "estimate.filter[0].start: `angle_y` and `rate_y` are exactly 0",
        ),
        ("angular_acceleration_y = \"1e4 rad^2/s^3\"", "", "estimate.process_noise.angular_acceleration_y"),
        (
            "\"from_signal\"\n\n",
            "\"from_signal\"\nstates = { stiffness = { start_sd = \"1 %\" } }\n\n",
            "estimate.filter[0].states.stiffness",
        ),
        ("method = \"ekf\"\n", "method = \"ekf\"\ndemodulator = true\n", "estimate.filter[0].demodulator"),
    ] {
        let message = rig().wanted(&changed(&[(from, to)])).unwrap_err().to_string();
        assert!(message.contains(expected), "{message}");
    }
}

/// What is computed for one axis alone is not simulated as something else.
#[test]
fn a_simulation_for_one_axis_is_refused() {
    let ring_down = "[simulate.drive.ring_down]\noffset = \"90 V\"\namplitude = \"90 V\"\nfrequency = \"31.35 kHz\"\n\
                     lasting = \"20 ms\"\nsignal_noise = \"1 mV\"\nangle_noise = \"0.5 mrad\"\n";
    let text = std::fs::read_to_string(path()).unwrap();
    let (before, tones) = text.split_once("[simulate.drive.tones]").unwrap();
    let after = &tones[tones.find("# For `kalmems estimate`").unwrap()..];
    let message = |text: &str| {
        let experiment = published().parse(text, &path()).unwrap();
        rig().simulate(&experiment).err().map(|error| error.to_string())
    };
    let refused = message(&format!("{before}{ring_down}{after}")).unwrap();
    assert!(refused.contains("simulate.drive.ring_down: a ring-down of two axes"), "{refused}");
    let circuit = std::fs::read_to_string(path().with_file_name("circuit.toml")).unwrap();
    let from = circuit.find("[device.shared_scanner.circuit").unwrap();
    let circuit = &circuit[from..circuit.find("[simulate]").unwrap()];
    let refused = message(&format!("{text}\n{circuit}")).unwrap();
    assert!(
        refused.contains("device.shared_scanner.circuit: the circuit is computed for one axis"),
        "{refused}"
    );
    assert_eq!(message(&text), None);
}

/// What happened to one axis is told of that axis: in the message, in the figures, in the table and in the pictures.
#[test]
fn a_lost_axis_is_named() {
    let changes = [("integration_rate = \"10 MHz\"", "integration_rate = \"1 MHz\""), ("24 ms", "13 ms")];
    let experiment = changed(&changes);
    let folder = tempfile::tempdir().unwrap();
    let target = folder.path().join("simulated");
    let info = || RunInfo { started: SystemTime::UNIX_EPOCH, took: Duration::ZERO };
    let simulation = rig().simulate(&experiment).unwrap();
    let output = Output::begin(&target, &Work::named("simulate", "two axes")).unwrap();
    write_simulation(&experiment, &rig(), simulation.as_ref(), &output, info, &Silent).unwrap();
    output.commit().unwrap();
    let simulated = published().load(&target.join("experiment.toml")).unwrap();
    let mut outcome = workflow::estimate(published(), &simulated, &Silent).unwrap();
    let estimate = &mut outcome.recordings[0].segments[0].estimate;
    let y = estimate.other_axes[0];
    let axes = [("angle_x", estimate.motion), (y.angle, y.motion)];
    let from_s = estimate.from_s();
    let trajectory = &mut estimate.trajectories[0];
    // From 12 ms on the other branch of y.
    let from = trajectory.time_s.partition_point(|t| *t < 12e-3);
    trajectory.states[2].mean[from..].iter_mut().for_each(|angle| *angle = -*angle);
    trajectory.signal.fill(0.0);
    trajectory.lock = judge_lock(trajectory, &axes, from_s);
    assert!(
        trajectory.lock.held_of("angle_x") && !trajectory.lock.held_of("angle_y"),
        "{:?}",
        trajectory.lock
    );

    let metrics = Metrics::of(&outcome);
    let first = metrics.estimators().next().unwrap();
    let event = serde_json::to_value(&first.lock).unwrap()["events"][0].clone();
    assert_eq!((&event["kind"], &event["of"]), (&"flipped".into(), &"angle_y".into()));
    let table = summary_table(&metrics, false).to_text();
    assert!(table.contains("LOST LOCK of angle_y") && !table.contains("angle_x and"), "{table}");
    let said = notices(&metrics);
    assert!(
        said.iter()
            .any(|n| n.text.contains("the phase of the motion of angle_y to the drive has changed by")),
        "{said:?}"
    );
    let drawn = estimate_figures(&outcome.recordings[0], &outcome.recordings[0].segments[0], "", None);
    let labels = |name: &str, series: usize| {
        let figure = drawn.iter().find(|figure| figure.id == name).unwrap();
        figure.panels.iter().map(|panel| panel.series[series].label().to_owned()).collect::<Vec<_>>()
    };
    assert_eq!(labels("nis", 1), ["EKF (LOST LOCK of angle_y)", "UKF"]);
    // Two panels of each filter, x and y.
    assert_eq!(labels("angle_error", 0), ["EKF", "EKF (LOST LOCK)", "UKF", "UKF"]);
    assert_eq!(labels("phase_error", 0), ["EKF", "EKF (LOST LOCK)", "UKF", "UKF"]);
}
