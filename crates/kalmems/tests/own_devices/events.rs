//! Events of a device of one's own that correct its filters at their own times: against the rig that has them built in, against what
//! events can tell by theory, and sample by sample as they arrive.

use crate::parts::{goes_on_after_a_kill, same_bits_in_a_stream, same_bits_in_parts};
use kalmems::config::Experiment;
use kalmems::estimate::{PassedMark, Trajectory};
use kalmems::expand::expand;
use kalmems::progress::Silent;
use kalmems::recording::SampledRecording;
use kalmems::rigs::published;
use kalmems::simulate::Simulation;
use rand_pcg::Pcg64;
use rand_pcg::rand_core::Rng;
use std::f64::consts::TAU;
use std::fmt::Write as _;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use toml::{Table, Value};

fn example(file: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples").join(file)
}

pub(super) fn recorded(experiment: &Experiment) -> SampledRecording {
    let rig = published().rig(experiment).unwrap();
    let file = experiment.resolve(&experiment.recording(0).unwrap().file);
    SampledRecording::read(&file, &rig.layout(experiment, 0).unwrap()).unwrap()
}

fn trajectories(experiment: &Experiment) -> Vec<Trajectory> {
    let rig = published().rig(experiment).unwrap();
    rig.estimate(experiment, 0, &recorded(experiment), &Silent).unwrap().swap_remove(0).trajectories
}

/// The largest differences of means, in the largest of the first and in standard deviations, and of standard deviations.
fn apart(rig: &Trajectory, text: &Trajectory, state: &str) -> [f64; 3] {
    let (a, b) = (rig.state(state).unwrap(), text.state(state).unwrap());
    assert!(a.mean.len() == b.mean.len() && a.mean.iter().chain(&b.mean).all(|x| x.is_finite()));
    let largest = |of: &dyn Fn(usize) -> f64| (0..a.mean.len()).map(of).fold(0.0_f64, f64::max);
    let difference = |k: usize| (a.mean[k] - b.mean[k]).abs();
    let size = largest(&|k| a.mean[k].abs());
    [
        largest(&difference) / size,
        largest(&|k| difference(k) / a.sd[k]),
        largest(&|k| (a.sd[k] / b.sd[k] - 1.0).abs()),
    ]
}

/// The example of the threshold scanner with a filter for each of these: its name, its method and how it is told of crossings.
fn threshold_scanner(filters: &[(&str, &str, &str)]) -> Experiment {
    let file = example("threshold_scanner/as_published.toml");
    let mut text: Table = std::fs::read_to_string(&file).unwrap().parse().unwrap();
    let mut estimate =
        "skip = \"2 ms\"\ncrossings = { width = \"30 us\", separation = \"300 us\", threshold = 4 }\n\
                        process_noise = { angular_acceleration = \"4758 rad^2/s^3\" }\n"
            .to_owned();
    for (name, method, more) in filters {
        write!(
            estimate,
            "[[filter]]\nname = \"{name}\"\nmethod = \"{method}\"\nstart = {{ angle = \"-0.102 rad\", rate = \"413 rad/s\" }}\n\
             start_sd = {{ angle = \"5 mrad\", rate = \"20 rad/s\" }}\n{more}\n"
        )
        .unwrap();
    }
    text.insert("estimate".into(), Value::Table(estimate.parse().unwrap()));
    published().parse(&toml::to_string(&text).unwrap(), &file).unwrap()
}

/// The same device by its equations.
fn by_equations(experiment: &Experiment) -> Experiment {
    let expanded = expand(published(), experiment).unwrap();
    let own = published().parse(&expanded.text, experiment.path());
    let own = own.unwrap_or_else(|error| panic!("{error}\n{}", expanded.text));
    assert_eq!(own.device_name(), "equations");
    own
}

const TOLD: &str = "threshold = { angle = \"3.7 mrad\", angle_sd = \"0.95 mrad\" }";

#[test]
fn an_expanded_threshold_scanner_is_corrected_by_its_crossings_as_by_its_rig() {
    let states = format!("{TOLD}\nstates = {{ natural_frequency = {{ start_sd = \"1 %\" }} }}");
    let smooth = format!("{states}\nsmooth = true");
    let in_place = TOLD.replace(" }", ", applied = \"in_place\" }");
    let lag = TOLD.replace(" }", ", lag = \"500 us\", gate = 4 }");
    let parabola = TOLD.replace(" }", ", timing = \"parabola\", applied = \"in_place\" }");
    let own_sd = "threshold = { angle = \"3.7 mrad\" }";
    let own_sd_tracked = format!("{own_sd}\nstates = {{ natural_frequency = {{ start_sd = \"1 %\" }} }}");
    let experiment = threshold_scanner(&[
        ("untold", "ekf", ""),
        ("ekf", "ekf", TOLD),
        ("ukf", "ukf", TOLD),
        ("square_root_ekf", "square_root_ekf", TOLD),
        ("square_root_ukf", "square_root_ukf", TOLD),
        ("iterated_ekf", "iterated_ekf", TOLD),
        ("consider", "consider_ekf", &states),
        ("tracked", "ekf", &smooth),
        ("bank", "bank", &states),
        ("hybrid", "hybrid_ekf", TOLD),
        ("in_place", "ekf", &in_place),
        ("lag", "ekf", &lag),
        ("parabola", "ekf", &parabola),
        ("own_sd", "ekf", own_sd),
        ("own_sd_tracked", "ekf", &own_sd_tracked),
    ]);
    let (rig, text) = (trajectories(&experiment), trajectories(&by_equations(&experiment)));
    assert_eq!(rig.len(), text.len());
    let mut faults = Vec::new();
    for (rig, text) in rig.iter().zip(&text) {
        assert_eq!(rig.key, text.key);
        let told = rig.key != "untold";
        assert_eq!(rig.counts.crossings, text.counts.crossings, "{}", rig.key);
        assert_eq!(rig.counts.crossings_refused, text.counts.crossings_refused, "{}", rig.key);
        assert!(
            (rig.counts.crossings > 25) == told || rig.key.ends_with("smoothed"),
            "{}",
            rig.counts.crossings
        );
        for state in ["angle", "rate"] {
            let [mean, of_sd, sd] = apart(rig, text, state);
            println!("{:24} {state:6} {mean:.1e} of the largest, {of_sd:.1e} sd, sd {sd:.1e}", rig.key);
            let holds = match rig.key.as_str() {
                // One step back, which both take alike.
                "untold" | "in_place" | "parabola" => mean < 1e-12 && sd < 1e-12,
                // The rig takes the rate of the angle from the slope of the signal, equations from the filter.
                key if key.starts_with("own_sd") => of_sd < 0.5 && sd < 0.5,
                // The rig goes back in steps of 32 us, which are right to 1e-6 of the amplitude over a quarter of a cycle; equations in
                // those of the samples.
                _ => mean < 2e-6 && sd < 1e-5,
            };
            if !holds {
                faults.push(format!("{} {state}: {mean:e} {of_sd:e} {sd:e}", rig.key));
            }
        }
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

/// An oscillator without damping that tells when it passes a place, and whose signal tells next to nothing.
const OSCILLATOR: &str = r#"
name = "oscillator"
[device.equations.states]
x = "m"
v = "m/s"
[device.equations.parameters]
rate = "6283.185307179586 rad/s"
place = "0.3 mm"
[device.equations.derivative]
x = "v"
v = "-rate^2*x"
[device.equations.measure]
signal = "x/1[m/V] in V"
[device.equations.events]
pass = "x - place"
[device.equations.noise]
signal = "1[V^2]"
pass = "4e-14[s^2]"
[estimate]
skip = "1 ms"
"#;

const FILTERS: &str = r#"
[[estimate.filter]]
name = "ekf"
method = "ekf"
events = { pass = {} }
start = { x = "X0 m", v = "V0 m/s" }
start_sd = { x = "2 um", v = "0.012 m/s" }
[[estimate.filter]]
name = "ukf"
method = "ukf"
events = { pass = {} }
start = { x = "X0 m", v = "V0 m/s" }
start_sd = { x = "2 um", v = "0.012 m/s" }
[[estimate.filter]]
name = "iterated"
method = "iterated_ekf"
events = { pass = {} }
start = { x = "X0 m", v = "V0 m/s" }
start_sd = { x = "2 um", v = "0.012 m/s" }
[[estimate.filter]]
name = "root"
method = "square_root_ukf"
events = { pass = {} }
start = { x = "X0 m", v = "V0 m/s" }
start_sd = { x = "2 um", v = "0.012 m/s" }
[[estimate.filter]]
name = "untold"
method = "ekf"
start = { x = "X0 m", v = "V0 m/s" }
start_sd = { x = "2 um", v = "0.012 m/s" }
"#;

const RECORDING: &str = r#"
[[recording]]
role = "test"
file = "recording.csv"
clock = { column = "time_s" }
channels = { signal = "signal_V", pass = "pass_ago_s" }
"#;

const RATE: f64 = TAU * 1e3;
const AMPLITUDE: f64 = 1e-3;
const PLACE: f64 = 0.3e-3;
const INTERVAL_S: f64 = 20e-6;
const ROWS: usize = 500;
const TIME_SD_S: f64 = 2e-7;
const START_SD: [f64; 2] = [2e-6, 0.012];

/// Twelve uniform numbers less six: as good as normal within three standard deviations.
fn normal(chance: &mut Pcg64) -> f64 {
    (0..12).map(|_| (chance.next_u64() >> 11) as f64 / (1_u64 << 53) as f64).sum::<f64>() - 6.0
}

/// The true times at which x = A·sin(ωt + φ) is where it is looked for, in closed form, from behind the first row, so that none is told as
/// before it, until the last one.
fn passes(phase: f64, rows: usize) -> Vec<f64> {
    let up = (PLACE / AMPLITUDE).asin();
    let mut times: Vec<f64> = (-2..70)
        .flat_map(|turn| {
            [up, std::f64::consts::PI - up].map(|at| (at + TAU * f64::from(turn) - phase) / RATE)
        })
        .filter(|t| (10.0 * TIME_SD_S..(rows - 4) as f64 * INTERVAL_S).contains(t))
        .collect();
    times.sort_by(f64::total_cmp);
    times
}

/// A recording of such passes, each recorded at the row behind its time; the state at the end, and the experiment.
fn oscillator((seed, rows): (u64, usize), folder: &Path) -> (Experiment, [f64; 2], f64) {
    let mut chance = Pcg64::new(seed.into(), 31);
    let phase = TAU * (chance.next_u64() >> 11) as f64 / (1_u64 << 53) as f64;
    let mut told: Vec<f64> = passes(phase, rows)
        .iter()
        .map(|t| t + TIME_SD_S * normal(&mut chance))
        .filter(|t| *t >= 0.0)
        .collect();
    told.sort_by(f64::total_cmp);
    let mut told = told.into_iter().peekable();
    let state = |t: f64| {
        let (sine, cosine) = (RATE * t + phase).sin_cos();
        [AMPLITUDE * sine, AMPLITUDE * RATE * cosine]
    };
    let mut csv = "time_s,signal_V,pass_ago_s\n".to_owned();
    for row in 0..rows {
        let t = row as f64 * INTERVAL_S;
        let ago = told.next_if(|at| *at <= t).map_or(String::new(), |at| format!("{:.15e}", t - at));
        writeln!(csv, "{t:.9},{:.9},{ago}", state(t)[0] + normal(&mut chance)).unwrap();
    }
    assert!(told.peek().is_none());
    std::fs::write(folder.join("recording.csv"), csv).unwrap();
    let [x, v] = state(0.0);
    let start = [x + START_SD[0] * normal(&mut chance), v + START_SD[1] * normal(&mut chance)];
    let filters = FILTERS.replace("X0", &format!("{:e}", start[0])).replace("V0", &format!("{:e}", start[1]));
    let text = format!("{OSCILLATOR}{filters}{RECORDING}");
    let experiment = published().parse(&text, &folder.join("experiment.toml")).unwrap();
    (experiment, state((rows - 1) as f64 * INTERVAL_S), phase)
}

/// The variances that the start and the passes leave of the state at the end, by the inverse of the information, summed up over the
/// true motion: x(t) = G(t)·[x, v/ω] at the end, and a pass says x(t) to ẋ(t)²·σ².
fn theory(phase: f64) -> [f64; 2] {
    let end_s = (ROWS - 1) as f64 * INTERVAL_S;
    let of = |at_s: f64| {
        let (sine, cosine) = (RATE * (at_s - end_s)).sin_cos();
        [cosine, sine]
    };
    let mut information = [0.0_f64; 3];
    let mut add = |[a, b]: [f64; 2], variance: f64| {
        for (entry, product) in information.iter_mut().zip([a * a, a * b, b * b]) {
            *entry += product / variance;
        }
    };
    // The start: x and v/ω at time 0.
    let [cosine, sine] = of(0.0);
    add([cosine, sine], START_SD[0].powi(2));
    add([-sine, cosine], (START_SD[1] / RATE).powi(2));
    for at_s in passes(phase, ROWS) {
        let speed = AMPLITUDE * RATE * (RATE * at_s + phase).cos();
        add(of(at_s), (speed * TIME_SD_S).powi(2));
    }
    let [xx, xv, vv] = information;
    let determinant = xx * vv - xv * xv;
    [vv / determinant, xx / determinant * RATE * RATE]
}

/// The chance of at most so many of so many is that of the normal approximation; five standard deviations of it are allowed.
fn is_share(count: usize, of: usize, expected: f64) -> bool {
    let sd = (expected * (1.0 - expected) / of as f64).sqrt();
    (count as f64 / of as f64 - expected).abs() < 4.0 * sd
}

#[test]
fn events_reduce_the_error_as_theory_predicts_and_errors_agree_with_the_claim() {
    const SEEDS: std::ops::Range<u64> = 71_000..71_250;
    let folder = tempfile::tempdir().unwrap();
    // Of each filter: ends within 1.96 standard deviations, and the sum of squared errors over their variances.
    let mut found = [(0_usize, 0.0_f64); 4];
    let mut largest = 0.0_f64;
    for seed in SEEDS {
        let (experiment, truth, phase) = oscillator((seed, ROWS), folder.path());
        let all = trajectories(&experiment);
        let variances = theory(phase);
        for (trajectory, found) in all.iter().zip(&mut found) {
            assert!(trajectory.counts.crossings >= 18, "{}", trajectory.counts.crossings);
            for (i, (truth, variance)) in truth.iter().zip(variances).enumerate() {
                let (mean, sd) =
                    (*trajectory.states[i].mean.last().unwrap(), *trajectory.states[i].sd.last().unwrap());
                largest = largest.max((sd / variance.sqrt() - 1.0).abs());
                let error = (mean - truth) / sd;
                found.0 += usize::from(error.abs() < 1.96);
                found.1 += error * error;
            }
        }
        // What no event tells stays as it began.
        let untold = &all[4];
        assert_eq!(untold.counts.crossings, 0);
        assert!(untold.states[0].sd.last().unwrap() > &(0.9 * START_SD[0]));
    }
    let count = 2 * SEEDS.count();
    println!("{count} numbers: {found:?}; claims are off theory by {largest:.1e} at most");
    // The rate at an event is that of the filter and not the true one: it begins with an error of 0.2 %, 0.7 % at most of so many.
    assert!(largest < 0.007, "{largest}");
    for (within, squares) in found {
        assert!(is_share(within, count, 0.95), "{within} of {count}");
        // Half of them are correlated with the other half at worst.
        let bound = 4.0 * (4.0 / count as f64).sqrt();
        assert!((squares / count as f64 - 1.0).abs() < bound, "{squares} of {count}");
    }
}

/// A passage that is found in samples which correct the filter themselves tells nothing new: taken for independent it makes the mean square of the
/// errors of the phase 1.6 times the claimed.
#[test]
fn passes_that_are_found_in_the_filters_own_samples_are_no_second_measurement() {
    const ROWS: usize = 2001;
    let folder = tempfile::tempdir().unwrap();
    let device = OSCILLATOR
        .replace("signal = \"1[V^2]\"\npass = \"4e-14[s^2]\"", "signal = \"1e-4[V^2]\"")
        .replace("1[m/V]", "1[mm/V]")
        .replace("0.3 mm", "0 m");
    let of_signal = "[estimate.events]\npass = { signal = \"signal\", level = \"0 V\", \
                     detector = { width = \"60 us\", separation = \"500 us\", threshold = 4 } }\n";
    let recording = RECORDING.replace(", pass = \"pass_ago_s\"", "");
    let (mut squares, mut count) = (0.0, 0.0);
    for seed in 0..400 {
        let mut chance = Pcg64::new(seed, 57);
        // At the end it passes the middle, so that the error of its place is one of its phase.
        let state = |row: usize| {
            let (sine, cosine) = (RATE * INTERVAL_S * (row as f64 - (ROWS - 1) as f64)).sin_cos();
            [AMPLITUDE * sine, AMPLITUDE * RATE * cosine]
        };
        let mut csv = "time_s,signal_V\n".to_owned();
        for row in 0..ROWS {
            let volts = 1e3 * state(row)[0] + 0.01 * normal(&mut chance);
            writeln!(csv, "{:.9},{volts:.9}", row as f64 * INTERVAL_S).unwrap();
        }
        std::fs::write(folder.path().join("recording.csv"), csv).unwrap();
        let [x, v] = state(0);
        let (x, v) = (x + START_SD[0] * normal(&mut chance), v + START_SD[1] * normal(&mut chance));
        let filter = format!(
            "[[estimate.filter]]\nname = \"ekf\"\nmethod = \"ekf\"\nevents = {{ pass = {{}} }}\n\
             start = {{ x = \"{x:e} m\", v = \"{v:e} m/s\" }}\nstart_sd = {{ x = \"2 um\", v = \"0.012 m/s\" }}\n"
        );
        let text = format!("{device}{of_signal}{filter}{recording}");
        let experiment = published().parse(&text, &folder.path().join("experiment.toml")).unwrap();
        let all = trajectories(&experiment);
        assert!(all[0].counts.crossings > 35, "{}", all[0].counts.crossings);
        let place = &all[0].states[0];
        squares += (place.mean.last().unwrap() / place.sd.last().unwrap()).powi(2);
        count += 1.0;
    }
    println!("mean square {:.3} of the claimed", squares / count);
    assert!((0.8..1.3).contains(&(squares / count)), "{}", squares / count);
}

const SIMULATE: &str = r#"
[simulate]
duration = "50 ms"
sampling_rate = "50 kHz"
integration_rate = "200 kHz"
start = { x = "0 m", v = "6.283185307179586 m/s" }
seed = SEED
noise = NOISE
[simulate.drive.constant]
voltage = "0 V"
"#;

/// The times at which a simulated recording says that the oscillator passed.
fn simulated_passes(seed: u64, noise: bool) -> Vec<f64> {
    let simulate = SIMULATE.replace("SEED", &seed.to_string()).replace("NOISE", &noise.to_string());
    let device = OSCILLATOR.split("[estimate]").next().unwrap();
    let experiment = published().parse(&format!("{device}{simulate}"), Path::new("own.toml")).unwrap();
    let simulation = published().rig(&experiment).unwrap().simulate(&experiment).unwrap();
    let columns: Vec<&str> = simulation.recorded().iter().map(|channel| channel.column).collect();
    assert_eq!(columns, ["signal_V", "pass_ago_s"]);
    let mut times = Vec::new();
    let each = &mut |sample: &kalmems::simulate::SimulatedSample<'_>| {
        let ago = sample.recorded[1];
        if ago.is_finite() {
            assert!((0.0..2.0 * INTERVAL_S).contains(&ago), "{ago}");
            times.push(sample.time_s - ago);
        }
        ControlFlow::Continue(())
    };
    Simulation::run(&*simulation, each).unwrap();
    times
}

#[test]
fn a_simulation_records_events_at_their_own_times_with_the_noise_that_is_stated() {
    let up = (PLACE / AMPLITUDE).asin();
    let truth = |k: usize| {
        let at = if k.is_multiple_of(2) { up } else { std::f64::consts::PI - up };
        (at + TAU * (k / 2) as f64) / RATE
    };
    let quiet = simulated_passes(1, false);
    assert_eq!(quiet.len(), 100);
    for (k, time_s) in quiet.iter().enumerate() {
        // The motion is integrated in steps of 5 us.
        assert!((time_s - truth(k)).abs() < 1e-10, "{k} {time_s} {}", truth(k));
    }
    let mut squares = 0.0;
    let mut count = 0;
    for seed in 500..520 {
        for (k, time_s) in simulated_passes(seed, true).iter().enumerate() {
            squares += ((time_s - truth(k)) / TIME_SD_S).powi(2);
            count += 1;
        }
    }
    let mean = squares / f64::from(count);
    println!("{count} times: mean square {mean:.3}");
    assert!((mean - 1.0).abs() < 4.0 * (2.0 / f64::from(count)).sqrt(), "{mean} of {count}");
}

/// The driven scanner with these filters, by its rig and by its equations, each with a simulation of it.
fn simulated_scanners(noise: bool, filters: &[(&str, &str, &str)]) -> [Experiment; 2] {
    let experiment = threshold_scanner(filters);
    let mut text: Table = experiment.to_toml().unwrap().parse().unwrap();
    let mut simulate = "duration = \"90 ms\"\nsampling_rate = \"250 kHz\"\nintegration_rate = \"500 kHz\"\n\
                        start = { angle = \"-0.102 rad\", rate = \"413 rad/s\" }\nseed = 5\n\
                        drive = { sine = { offset = \"30 V\", amplitude = \"30 V\", frequency = \"1276 Hz\" } }\n"
        .to_owned();
    writeln!(simulate, "noise = {noise}").unwrap();
    text.insert("simulate".into(), Value::Table(simulate.parse().unwrap()));
    let device = text["device"]["threshold_scanner"].as_table_mut().unwrap();
    device.insert("drive".into(), Value::Table("gain = \"60 rad/s^2/V^2\"".parse().unwrap()));
    device.remove("position_detector");
    let recording = text["recording"][0].as_table_mut().unwrap();
    recording.remove("reference");
    recording.insert("role".into(), Value::from("test"));
    let rig = published().parse(&toml::to_string(&text).unwrap(), experiment.path()).unwrap();
    let equations = by_equations(&rig);
    [rig, equations]
}

/// The angle at which the comb of the example is passed.
const THRESHOLD: f64 = 7.7e-3;

/// A time, and what is recorded and true then.
type Row = (f64, Vec<f64>, f64);

/// The rows of a simulation.
fn simulated(experiment: &Experiment) -> Vec<Row> {
    let simulation = published().rig(experiment).unwrap().simulate(experiment).unwrap();
    let mut rows = Vec::new();
    let each = &mut |sample: &kalmems::simulate::SimulatedSample<'_>| {
        rows.push((sample.time_s, sample.recorded.to_vec(), sample.truth[0]));
        ControlFlow::Continue(())
    };
    Simulation::run(&*simulation, each).unwrap();
    rows
}

#[test]
fn an_expanded_threshold_scanner_is_simulated_as_by_its_rig_with_its_crossings() {
    let [rig, text] =
        simulated_scanners(false, &[("told", "ekf", TOLD)]).map(|experiment| simulated(&experiment));
    assert_eq!(rig.len(), text.len());
    let size = |of: &dyn Fn(&Row) -> f64| rig.iter().map(of).fold(0.0_f64, |a, b| a.max(b.abs()));
    let (signal, angle) = (size(&|row| row.1[1]), size(&|row| row.2));
    let (mut told, mut passes, mut worst) = (0, Vec::new(), [0.0_f64; 2]);
    for (k, (rig_row, text_row)) in rig.iter().zip(&text).enumerate() {
        worst[0] = worst[0].max((rig_row.1[1] - text_row.1[1]).abs() / signal);
        worst[1] = worst[1].max((rig_row.2 - text_row.2).abs() / angle);
        if let Some((before_s, _, before)) = k.checked_sub(1).map(|k| &rig[k])
            && (before - THRESHOLD) * (rig_row.2 - THRESHOLD) < 0.0
        {
            passes.push(before_s + (rig_row.0 - before_s) * (THRESHOLD - before) / (rig_row.2 - before));
        }
        if text_row.1[2].is_finite() {
            // A straight line between two samples is off by 0.15 rad*(3924/s*4 us)^2/8 at most, 5e-6 rad at 400 rad/s.
            assert!((text_row.0 - text_row.1[2] - passes[told]).abs() < 2e-8, "{k}");
            told += 1;
        }
    }
    println!("{told} crossings; signals differ by {:.1e}, angles by {:.1e}", worst[0], worst[1]);
    assert!(told > 100 && told == passes.len(), "{told} {}", passes.len());
    assert!(worst.iter().all(|worst| *worst < 1e-12), "{worst:?}");
}

#[test]
fn events_of_a_signal_correct_a_stream_to_the_last_bit_as_an_estimate() {
    let states = format!("{TOLD}\nstates = {{ natural_frequency = {{ start_sd = \"1 %\" }} }}");
    let in_place = TOLD.replace(" }", ", applied = \"in_place\" }");
    let lag = TOLD.replace(" }", ", lag = \"500 us\", gate = 4 }");
    let filters = [
        ("untold", "ekf", ""),
        ("told", "ekf", &*states),
        ("in_place", "ukf", &in_place),
        ("lag", "square_root_ekf", &lag),
    ];
    let folder = tempfile::tempdir().unwrap();
    let [_, experiment] = simulated_scanners(true, &filters);
    // Longer than the forty cycles that an estimate begins with.
    let mut csv = "time_s,drive_V,cap_V\n".to_owned();
    for (time_s, recorded, _) in simulated(&experiment) {
        writeln!(csv, "{time_s:.9},{:.6},{:.6}", recorded[0], recorded[1]).unwrap();
    }
    std::fs::write(folder.path().join("recording.csv"), &csv).unwrap();
    let mut text: Table = experiment.to_toml().unwrap().parse().unwrap();
    text.remove("simulate");
    let stream = "rate = \"250 kHz\"\n[input.text]\ncolumns = [\"time_s\", \"drive_V\", \"cap_V\"]\n";
    text.insert("stream".into(), Value::Table(stream.parse().unwrap()));
    let path = folder.path().join("experiment.toml");
    let own = published().parse(&toml::to_string(&text).unwrap(), &path).unwrap();
    let recording = recorded(&own);
    same_bits_in_parts(&own, &recording, &[150, 4096]);
    let (events, _) = same_bits_in_a_stream(&own, &recording, (csv.as_bytes(), 4000));
    let passes: Vec<_> = events.iter().filter(|event| event["event"] == "device_event").collect();
    assert!(passes.len() > 100 && passes.iter().all(|event| event["of"] == "crossing"), "{}", passes.len());
    goes_on_after_a_kill(&own, csv.as_bytes(), 0.85, 0.06);
}

#[test]
fn recorded_events_correct_a_stream_to_the_last_bit_as_an_estimate() {
    let folder = tempfile::tempdir().unwrap();
    // Longer than the forty cycles that an estimate begins with.
    let rows = 3000;
    let (experiment, ..) = oscillator((12, rows), folder.path());
    let text = experiment.to_toml().unwrap()
        + "\n[stream]\nrate = \"50 kHz\"\n[stream.input.text]\ncolumns = [\"time_s\", \"signal_V\", \"pass_ago_s\"]\n";
    let experiment = published().parse(&text, experiment.path()).unwrap();
    let recording = recorded(&experiment);
    same_bits_in_parts(&experiment, &recording, &[1, 7, 300]);
    let bytes = std::fs::read(folder.path().join("recording.csv")).unwrap();
    let (events, summary) = same_bits_in_a_stream(&experiment, &recording, (&bytes, 100));
    assert_eq!(summary.estimated, rows as u64);
    let told = events.iter().filter(|event| event["event"] == "device_event" && event["of"] == "pass");
    assert_eq!(told.count(), trajectories(&experiment)[0].counts.crossings);
    let rig = published().rig(&experiment).unwrap();
    let estimate = rig.estimate(&experiment, 0, &recording, &Silent).unwrap().swap_remove(0);
    assert!(estimate.crossings.iter().all(|crossing| crossing.of == PassedMark::Event("pass")));
    assert!(estimate.crossings.iter().all(|crossing| (crossing.sd_s / TIME_SD_S - 1.0).abs() < 1e-9));
}

#[test]
fn a_key_that_an_event_lacks_is_reported_with_what_to_write() {
    let folder = tempfile::tempdir().unwrap();
    let (experiment, ..) = oscillator((3, ROWS), folder.path());
    let text = experiment.to_toml().unwrap();
    let with = |from: &str, to: &str| {
        assert!(text.contains(from), "{from}\n{text}");
        text.replacen(from, to, 1)
    };
    let detector = "detector = { width = \"30 us\", separation = \"300 us\", threshold = 4 }";
    let source = |of: &str| with("[estimate]\n", &format!("[estimate]\nevents = {{ {of} }}\n"));
    let cases = [
        (
            "an event that is not there",
            with("[estimate.filter.events.pass]", "[estimate.filter.events.past]"),
        ),
        ("no channel", with("pass = \"pass_ago_s\"\n", "")),
        ("no noise", with("pass = \"4e-14[s^2]\"\n", "")),
        ("noise of another unit", with("4e-14[s^2]", "4e-12[V^2]")),
        ("a constant gain", with("method = \"ekf\"", "method = \"steady_state\"")),
        (
            "a recorded event with a lag",
            with("[estimate.filter.events.pass]", "[estimate.filter.events.pass]\nlag = \"1 us\""),
        ),
        ("a level without a signal", source("pass = { level = \"1 V\" }")),
        ("a signal without a detector", source("pass = { signal = \"signal\" }")),
        (
            "a level of another unit",
            source(&format!("pass = {{ signal = \"signal\", level = \"1 m\", {detector} }}")),
        ),
        ("an unknown signal", source(&format!("pass = {{ signal = \"sginal\", {detector} }}"))),
        ("a source of no event", source("past = { known_within = \"1 ms\" }")),
        ("an event that is told too late", source("pass = { known_within = \"1 us\" }")),
        ("an event with the name of a state", text.replace("pass = \"x - place\"", "x = \"x - place\"")),
    ];
    let mut told = String::new();
    for (what, text) in cases {
        let said = published().parse(&text, experiment.path()).map_err(|error| error.to_string());
        let said = said.and_then(|experiment| {
            kalmems::workflow::estimate(published(), &experiment, &Silent)
                .map(|_| ())
                .map_err(|e| e.to_string())
        });
        let said = said.expect_err(what).replace(&folder.path().display().to_string(), "");
        writeln!(told, "{what}:\n{said}\n").unwrap();
    }
    insta::assert_snapshot!(told);
    // A device that states no events knows nothing of them.
    let scanner = std::fs::read_to_string(example("shared_scanner/experiment.toml")).unwrap();
    let scanner = scanner.replacen("[estimate]", "[estimate]\nevents = { pass = {} }", 1);
    let error = published()
        .parse(&scanner, Path::new("experiment.toml"))
        .and_then(|experiment| published().rig(&experiment)?.wanted(&experiment).map(|_| ()))
        .unwrap_err();
    assert!(error.to_string().contains("a device that states events"), "{error}");
}
