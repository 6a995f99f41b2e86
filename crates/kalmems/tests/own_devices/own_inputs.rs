//! A device of one's own with several inputs of any unit: simulated, against solutions in closed form, and estimated again.

use kalmems::config::Experiment;
use kalmems::progress::Silent;
use kalmems::rigs::published;
use kalmems::simulate::{ComputedRecording, described};
use kalmems::workflow::{Outcome, estimate_computed};
use std::f64::consts::TAU;
use std::fmt::Write as _;
use std::ops::ControlFlow;
use std::path::Path;

/// A proof mass on a spring that a force and an acceleration move, and a body that follows the temperature around it.
const SENSOR: &str = r#"
name = "sensor"
[device.equations]
states = { x = "m", v = "m/s", T = "K" }
inputs = { force = "uN", acceleration = "m/s^2", ambient = "K" }
[device.equations.parameters]
m = "1e-9 kg"
k = "0.0394784176 N/m" # 1 kHz
b = "6.2832e-8 N s/m" # a quality factor of 100
tau = "2 ms"
[device.equations.derivative]
x = "v"
v = "(force - b*v - k*x)/m - acceleration"
T = "(ambient - T)/tau"
[device.equations.measure]
position = "x in um"
thermometer = "T in K"
[device.equations.noise]
position = "1e-18[m^2]"
thermometer = "1e-4[K^2]"
[simulate]
duration = "10 ms"
sampling_rate = "100 kHz"
integration_rate = "400 kHz"
start = { x = "0 m", v = "0 m/s", T = "293 K" }
seed = 1
[simulate.drive.inputs.force.sine]
amplitude = "0.5 uN"
frequency = "700 Hz"
[simulate.drive.inputs.acceleration.steps]
first = "0 m/s^2"
step = [{ at = "2.3 ms", value = "1 gn" }, { at = "6 ms", value = "-2 m/s^2" }]
[simulate.drive.inputs.ambient.constant]
value = "303 K"
"#;

fn parse(text: &str, folder: &Path) -> Result<Experiment, String> {
    published().parse(text, &folder.join("experiment.toml")).map_err(|error| error.to_string())
}

/// Rows of time, of what is recorded and of what is true, with their columns.
pub(crate) struct Rows {
    recorded: Vec<&'static str>,
    truth: Vec<&'static str>,
    pub(crate) samples: Vec<(f64, Vec<f64>, Vec<f64>)>,
}

impl Rows {
    pub(crate) fn of(text: &str, folder: &Path) -> Self {
        let experiment = parse(text, folder).unwrap_or_else(|error| panic!("{error}"));
        let simulation = published().rig(&experiment).unwrap().simulate(&experiment).unwrap();
        let names =
            |channels: &[kalmems::simulate::SimulatedColumn]| channels.iter().map(|c| c.column).collect();
        let (recorded, truth) = (names(simulation.recorded()), names(simulation.truth()));
        let mut rows = Vec::new();
        simulation
            .run(&mut |sample| {
                rows.push((sample.time_s, sample.recorded.to_vec(), sample.truth.to_vec()));
                ControlFlow::Continue(())
            })
            .unwrap();
        Self { recorded, truth, samples: rows }
    }

    fn column(&self, name: &str) -> Vec<f64> {
        let place = |all: &[&str]| all.iter().position(|known| *known == name);
        match (place(&self.recorded), place(&self.truth)) {
            (Some(place), _) => self.samples.iter().map(|row| row.1[place]).collect(),
            (None, Some(place)) => self.samples.iter().map(|row| row.2[place]).collect(),
            (None, None) => panic!("no {name} among {:?} and {:?}", self.recorded, self.truth),
        }
    }

    fn largest_error(&self, name: &str, expected: impl Fn(f64) -> f64) -> f64 {
        let all = self.column(name);
        all.iter().zip(&self.samples).map(|(x, row)| (x - expected(row.0)).abs()).fold(0.0, f64::max)
    }
}

#[test]
fn a_force_an_acceleration_and_a_temperature_move_a_device_as_in_closed_form() {
    let rows = Rows::of(&SENSOR.replace("seed = 1", "seed = 1\nnoise = false"), Path::new("nowhere"));
    assert_eq!(
        rows.recorded,
        ["force_N", "acceleration_m_per_s2", "ambient_K", "position_m", "thermometer_K"]
    );
    let (m, k, b, tau) = (1e-9_f64, 0.039_478_417_6_f64, 6.2832e-8_f64, 2e-3_f64);
    let decay = b / (2.0 * m);
    let rate = (k / m - decay * decay).sqrt();
    // From rest, under a force that begins at 0 s and stays.
    let step = |t: f64| {
        let (sine, cosine) = (rate * t).sin_cos();
        if t > 0.0 { (1.0 - (-decay * t).exp() * (cosine + decay / rate * sine)) / k } else { 0.0 }
    };
    // From rest, under a sine: the steady oscillation, and the free one that cancels it at 0 s.
    let (amplitude, omega) = (0.5e-6, TAU * 700.0);
    let (re, im) = (k - m * omega * omega, b * omega);
    let size = amplitude / (re * re + im * im);
    let steady = |t: f64| size * (re * (omega * t).sin() - im * (omega * t).cos());
    let (x0, v0) = (size * im, -size * re * omega);
    let free = |t: f64| {
        let (sine, cosine) = (rate * t).sin_cos();
        (-decay * t).exp() * (x0 * cosine + (v0 + decay * x0) / rate * sine)
    };
    let gn = 9.806_65;
    let x = |t: f64| steady(t) + free(t) - m * (gn * step(t - 2.3e-3) + (-2.0 - gn) * step(t - 6e-3));
    let largest = rows.column("x_m").iter().fold(0.0_f64, |most, x| most.max(x.abs()));
    assert!(largest > 1e-5, "{largest:e}");
    // Runge and Kutta's method leaves out (2π/400)⁴/120 of a radian of each, of 63.
    let error = rows.largest_error("x_m", x);
    assert!(error < 63.0 * (TAU / 400.0).powi(4) / 120.0 * largest * 2.0, "{error:e} of {largest:e}");
    let error = rows.largest_error("T_K", |t| 303.0 - 10.0 * (-t / tau).exp());
    assert!(error < 1e-9, "{error:e}");
    // Without noise a measurement is what it is of.
    assert_eq!(rows.column("position_m"), rows.column("x_m"));
    // At a jump the level is the one from then on.
    assert_eq!(rows.column("acceleration_m_per_s2")[600], -2.0);
    assert_eq!(rows.column("acceleration_m_per_s2")[599], gn);
}

#[test]
fn each_waveform_is_recorded_as_it_is_stated_in_the_unit_of_its_input() {
    let folder = tempfile::tempdir().unwrap();
    let mut csv = "time_s,push_mN\n".to_owned();
    (0..=100).for_each(|k| writeln!(csv, "{},{}", f64::from(k) * 1e-4, f64::from(k) * 0.5).unwrap());
    std::fs::write(folder.path().join("push.csv"), csv).unwrap();
    let names = [
        "off", "constant", "sine", "square", "sweep", "earlier", "tones", "steps", "ring", "cut", "recorded",
    ];
    let mut text = "name = \"waveforms\"\n[device.equations.inputs]\n".to_owned();
    for name in names {
        writeln!(text, "{name} = \"N\"").unwrap();
    }
    text += r#"
[device.equations.states]
p = "kg m/s"
q = "kg m/s"
[device.equations.derivative]
p = "ring"
q = "off + constant + sine + square + sweep + earlier + tones + steps + cut + recorded"
[device.equations.measure]
seen = "p in kg m/s"
[device.equations.noise]
seen = "1e-6[kg^2 m^2/s^2]"
[simulate]
duration = "10 ms"
sampling_rate = "100 kHz"
integration_rate = "100 kHz"
start = { p = "0 kg m/s", q = "0 kg m/s" }
noise = false
[simulate.drive.inputs]
off = "none"
constant = { constant = { value = "3 mN" } }
sine = { sine = { offset = "1 N", amplitude = "20 mN", frequency = "1 kHz", phase = "30 deg" } }
square = { square = { low = "-1 mN", high = "4 mN", frequency = "130 Hz", duty_cycle = "30 %" } }
sweep = { sweep = { amplitude = "1 mN", from = "200 Hz", to = "400 Hz" } }
earlier = { sweep = { amplitude = "1 mN", from = "200 Hz", to = "400 Hz", begins = "-5 ms", lasting = "10 ms" } }
tones = { tones = { offset = "2 mN", tone = [{ amplitude = "1 mN", frequency = "300 Hz" }, { amplitude = "2 mN", frequency = "500 Hz", phase = "1 rad" }] } }
steps = { steps = { step = [{ at = "1.005 ms", value = "7 mN" }] } }
ring = { ring_down = { offset = "1 mN", amplitude = "3 mN", frequency = "250 Hz", lasting = "5 ms", then = "2 mN" } }
cut = { sine = { amplitude = "1 mN", frequency = "1 kHz", cut_off = { at = "5 ms", transient = "10 us" } } }
recorded = { recorded = { file = "push.csv", clock = { column = "time_s" }, column = "push_mN" } }
"#;
    let rows = Rows::of(&text, folder.path());
    let sine = |cycles: f64| (TAU * cycles).sin();
    // From 200 Hz to 400 Hz over 10 ms.
    let swept = |t: f64| 200.0 * t + 0.5 * 200.0 / 10e-3 * t * t;
    let laws: [&dyn Fn(f64) -> f64; 11] = [
        &|_| 0.0,
        &|_| 3e-3,
        &|t| 1.0 + 20e-3 * sine(1e3 * t + 1.0 / 12.0),
        &|t| if (130.0 * t).fract() < 0.3 { 4e-3 } else { -1e-3 },
        &|t| 1e-3 * sine(swept(t)),
        // Behind its end it stays at 400 Hz.
        &|t| 1e-3 * sine(swept((t + 5e-3).min(10e-3)) + 400.0 * (t - 5e-3).max(0.0)),
        &|t| 2e-3 + 1e-3 * sine(300.0 * t) + 2e-3 * (TAU * 500.0 * t + 1.0).sin(),
        &|t| if t < 1.005e-3 { 0.0 } else { 7e-3 },
        &|_| 2e-3,
        &|t| 1e-3 * sine(1e3 * t) * if t < 5e-3 { 1.0 } else { (-(t - 5e-3) / 10e-6).exp() },
        &|t| 5.0 * t,
    ];
    for (name, law) in names.iter().zip(laws) {
        // No row falls on a jump of this law, whose time is rounded otherwise.
        let error = rows.largest_error(&format!("{name}_N"), law);
        assert!(error < 1e-12, "{name}: {error:e}");
    }
    // Before the recording the sine of the ring-down has pushed for 5 ms: ∫ 1 mN + 3 mN·sin(2π·250 Hz·t) over −5 … 0 ms.
    let before = 1e-3 * 5e-3 - 3e-3 / (TAU * 250.0) * (1.0 - (TAU * 250.0 * 5e-3).cos());
    let error = rows.largest_error("p_N_s", |t| before + 2e-3 * t);
    assert!(error < 1e-9 * before.abs(), "{error:e} of {before:e}");
}

#[test]
fn a_channel_is_sampled_at_its_own_rate_and_rounded_in_its_own_unit() {
    let channels = "[simulate.channels.thermometer]\nsampling_rate = \"10 kHz\"\nfirst_row = 3\n\
                    adc = { bits = 8, low = \"290 K\", high = \"310 K\" }\n";
    let rows = Rows::of(&format!("{SENSOR}{channels}"), Path::new("nowhere"));
    let step = 20.0 / 255.0;
    for (row, value) in rows.column("thermometer_K").iter().enumerate() {
        assert_eq!(value.is_finite(), row % 10 == 3, "{row} {value}");
        let steps = (value - 290.0) / step;
        assert!(value.is_nan() || (steps - steps.round()).abs() < 1e-9, "{row} {value}");
    }
    // The other channel has the same noise as without.
    let without = Rows::of(SENSOR, Path::new("nowhere"));
    assert_eq!(rows.column("position_m"), without.column("position_m"));
    let errors =
        rows.column("position_m").iter().zip(rows.column("x_m")).map(|(a, b)| a - b).collect::<Vec<_>>();
    let variance = errors.iter().map(|e| e * e).sum::<f64>() / errors.len() as f64;
    // χ² of 1001 degrees over its mean: 99.9 % lie within 0.858 … 1.152.
    assert!((0.858..1.152).contains(&(variance / 1e-18)), "{variance:e}");
}

const FILTER: &str = "[estimate]\nskip = \"2 ms\"\n[[estimate.filter]]\nname = \"EKF\"\nmethod = \"ekf\"\n\
    start = { x = \"0 m\", v = \"0 m/s\", T = \"293 K\" }\nstart_sd = { x = \"1 um\", v = \"10 mm/s\", T = \"1 K\" }\n";

/// Filtered with what the experiment says, or with another of the same simulation.
fn estimated(text: &str, told: &str, folder: &Path) -> Outcome {
    let experiment = parse(text, folder).unwrap();
    let simulation = published().rig(&experiment).unwrap().simulate(&experiment).unwrap();
    let simulated = ComputedRecording::of(simulation.as_ref(), &Silent).unwrap();
    let told = described(&parse(told, folder).unwrap(), simulation.as_ref());
    estimate_computed(published(), &told, &simulated, &Silent).unwrap()
}

#[test]
fn what_was_simulated_under_several_inputs_is_estimated_again() {
    // Without jumps between two samples, which no interpolation follows.
    let smooth = SENSOR.replace("2.3 ms", "2 ms").replace(
        "[simulate.drive.inputs.acceleration.steps]\nfirst = \"0 m/s^2\"\nstep = [{ at = \"2 ms\", value = \"1 gn\" }, { at = \"6 ms\", value = \"-2 m/s^2\" }]",
        "[simulate.drive.inputs.acceleration.sine]\namplitude = \"1 gn\"\nfrequency = \"90 Hz\"",
    );
    let channels = "[simulate.channels.thermometer]\nsampling_rate = \"10 kHz\"\n";
    let text = format!("{smooth}{channels}{FILTER}");
    assert!(text.contains("90 Hz"));
    let (mut innovations, mut errors, mut samples) = (0.0, 0, 0);
    for seed in 300..310 {
        let text = text.replace("seed = 1", &format!("seed = {seed}"));
        let outcome = estimated(&text, &text, Path::new("nowhere"));
        let segment = &outcome.recordings[0].segments[0];
        let trajectory = &segment.estimate.trajectories[0];
        let rows = trajectory.scored(2e-3);
        innovations += trajectory.consistency(rows).unwrap().mean_nis;
        for of in segment.values[0].values() {
            errors += usize::from(of.within_three_sigma.unwrap() > 0.99);
            samples += 1;
        }
    }
    // Ten times 801 innovations of one channel: 99.9 % of their means lie within 0.948 … 1.053.
    let mean = innovations / 10.0;
    assert!((0.948..1.053).contains(&mean), "{mean}");
    assert_eq!(errors, samples);
    // An input that is told as another one is seen.
    let swapped = text.replace("force - b*v - k*x)/m - acceleration", "force - b*v - k*x)/m + acceleration");
    let outcome = estimated(&text, &swapped, Path::new("nowhere"));
    let trajectory = &outcome.recordings[0].segments[0].estimate.trajectories[0];
    let wrong = trajectory.consistency(trajectory.scored(2e-3)).unwrap().mean_nis;
    assert!(wrong > 10.0, "{wrong}");
}

#[test]
fn a_mistake_in_an_input_or_in_a_channel_is_reported_with_what_to_write() {
    let with = |from: &str, to: &str| {
        assert!(SENSOR.contains(from), "{from}");
        SENSOR.replace(from, to)
    };
    let channel = |text: &str| format!("{SENSOR}[simulate.channels.{text}\n");
    let scanner = std::fs::read_to_string(
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/shared_scanner/simulation.toml"),
    )
    .unwrap();
    let of_scanner = |table: &str| {
        let mut file: toml::Table = scanner.parse().unwrap();
        let simulate = file["simulate"].as_table_mut().unwrap();
        simulate.extend(table.parse::<toml::Table>().unwrap());
        toml::to_string(&file).unwrap()
    };
    let cases = [
        ("an unknown input", with("inputs.force.sine", "inputs.forces.sine")),
        (
            "an input that is left out",
            with("[simulate.drive.inputs.ambient.constant]\nvalue = \"303 K\"\n", ""),
        ),
        ("another unit", with("value = \"303 K\"", "value = \"303 V\"")),
        ("no unit", with("amplitude = \"0.5 uN\"", "amplitude = 0.5")),
        ("a negative amplitude", with("amplitude = \"0.5 uN\"", "amplitude = \"-0.5 uN\"")),
        ("an unknown waveform", with("inputs.force.sine", "inputs.force.sinus")),
        ("a key that a waveform lacks", with("frequency = \"700 Hz\"", "frequenzy = \"700 Hz\"")),
        ("jumps out of order", with("at = \"6 ms\"", "at = \"2 ms\"")),
        (
            "a drive of volts",
            format!(
                "{}[simulate.drive.constant]\nvoltage = \"1 V\"\n",
                SENSOR.split("[simulate.drive").next().unwrap()
            ),
        ),
        (
            "a sweep that begins behind the end",
            with(
                "[simulate.drive.inputs.force.sine]\namplitude = \"0.5 uN\"\nfrequency = \"700 Hz\"",
                "[simulate.drive.inputs.force.sweep]\namplitude = \"0.5 uN\"\nfrom = \"700 Hz\"\nto = \"800 Hz\"\nbegins = \"11 ms\"",
            ),
        ),
        ("an unknown channel", channel("thermo]\nfirst_row = 1")),
        ("a rate that is no part", channel("thermometer]\nsampling_rate = \"30 kHz\"")),
        (
            "levels in another unit",
            channel("thermometer]\nadc = { bits = 8, low = \"0 V\", high = \"1 V\" }"),
        ),
        (
            "levels upside down",
            channel("thermometer]\nadc = { bits = 8, low = \"300 K\", high = \"200 K\" }"),
        ),
        (
            "one converter in V",
            with("seed = 1", "seed = 1\nadc = { bits = 8, low = \"0 V\", high = \"1 V\" }"),
        ),
        ("inputs of a published device", of_scanner("drive = { inputs = { drive = \"none\" } }")),
        ("channels of a published device", of_scanner("channels = { signal = { first_row = 1 } }")),
    ];
    let mut told = String::new();
    for (what, text) in cases {
        let said = parse(&text, Path::new("")).and_then(|experiment| {
            let rig = published().rig(&experiment).map_err(|error| error.to_string())?;
            rig.simulate(&experiment).map(|_| ()).map_err(|error| error.to_string())
        });
        writeln!(told, "{what}:\n{}\n", said.expect_err(what)).unwrap();
    }
    insta::assert_snapshot!(told);
}
