//! A coil on a spring, by its equations, whose current has what the drive makes of it beside the motion: taken off by a record with the bias off, or by
//! what its table states. The motion is computed here in closed form, not by the program.

use kalmems::config::Experiment;
use kalmems::progress::Silent;
use kalmems::rigs::published;
use kalmems::simulate::{ComputedRecording, WhiteNoise, described};
use kalmems::workflow::{Outcome, estimate, estimate_computed};
use std::f64::consts::TAU;
use std::fmt::Write as _;
use std::path::Path;

const NATURAL_HZ: f64 = 1000.0;
const ZETA: f64 = 0.02;
const FORCE: f64 = 200.0;
const GAIN: f64 = 2.0;
const HZ: f64 = 990.0;
const INTERVAL: f64 = 1e-5;
/// In A/V and A s/V: a tenth of the current.
const THROUGH: [f64; 2] = [0.05, 2e-5];
const NOISE: f64 = 1e-3;

/// Displacement and velocity under a sine of so many volts.
fn motion(volts: f64, hz: f64, time_s: f64) -> [f64; 2] {
    let (w0, w) = (TAU * NATURAL_HZ, TAU * hz);
    let (re, im) = (w0 * w0 - w * w, 2.0 * ZETA * w0 * w);
    let (size, late) = (FORCE * volts / re.hypot(im), im.atan2(re));
    let (s, c) = (w * time_s - late).sin_cos();
    [size * s, size * w * c]
}

/// Rows with the bias on or off, of a drive that begins with this phase and is zero from a row on.
fn rows(label: &str, (volts, hz, phase): (f64, f64, f64), is_on: bool, (count, ends): (u32, u32)) -> String {
    let mut noise = WhiteNoise::new(7 + u64::from(is_on), 3);
    let mut text = String::new();
    for k in 0..count {
        let t = f64::from(k) * INTERVAL + phase / (TAU * hz);
        let (s, c) = (TAU * hz * t).sin_cos();
        let drive = if k < ends { [volts * s, volts * TAU * hz * c] } else { [0.0; 2] };
        let [_, v] = motion(volts, hz, t);
        let moved = if is_on { GAIN * v } else { 0.0 };
        let current = moved + THROUGH[0] * drive[0] + THROUGH[1] * drive[1] + NOISE * noise.sample();
        writeln!(text, "{label},{:.6},{:.7},{current:.7}", f64::from(k) * INTERVAL, drive[0]).unwrap();
    }
    text
}

const HEADER: &str = "record,time_s,u_V,current_A\n";

fn recording(name: &str, role: &str) -> String {
    format!(
        "[[recording]]\nname = \"{name}\"\nrole = \"{role}\"\nfile = \"{name}.csv\"\nsegments = {{ column = \"record\" }}\n\
         clock = {{ column = \"time_s\" }}\nchannels = {{ u = \"u_V\", current = \"current_A\" }}\n"
    )
}

const DEVICE: &str = r#"
name = "coil"
[device.equations]
answer = "v"
[device.equations.states]
x = "m"
v = "m/s"
[device.equations.inputs]
u = "V"
[device.equations.parameters]
f0 = "1000 Hz"
zeta = "0.02"
force = "200 m/s^2/V"
gain = "2 A s/m"
[device.equations.let]
w = "2*pi*f0"
[device.equations.derivative]
x = "v"
v = "force*u - 2*zeta*w*v - w^2*x"
[device.equations.measure]
current = "gain*v in A"
[device.equations.noise]
current = "1e-6[A^2]"
[device.equations.oscillation]
of = "x"
"#;
const ALONG: &str = "[device.equations.feedthrough]\nof = \"u\"\n";
const STATED: &str =
    "[device.equations.feedthrough.signals]\ncurrent = { gain = \"0.05 A/V\", slope = \"2e-5 A s/V\" }\n";
const ESTIMATE: &str = "[estimate]\nskip = \"2 ms\"\nprocess_noise = { v = \"1e-3 m^2/s^3\" }\n\
     [[estimate.filter]]\nname = \"EKF\"\nmethod = \"ekf\"\n[[estimate.filter]]\nname = \"Lock-in\"\nmethod = \"lock_in\"\n";

fn parsed(folder: &Path, tables: &str) -> Experiment {
    let text = DEVICE.to_owned() + tables;
    published().parse(&text, &folder.join("experiment.toml")).unwrap_or_else(|error| panic!("{error}"))
}

fn said(folder: &Path, tables: &str) -> String {
    let text = DEVICE.to_owned() + tables;
    let outcome = published()
        .parse(&text, &folder.join("experiment.toml"))
        .map_err(|error| error.to_string())
        .and_then(|experiment| {
            estimate(published(), &experiment, &Silent).map_err(|error| error.to_string())
        });
    outcome.map_or_else(|why| why, |_| "accepted".to_owned())
}

/// The root mean square of each answer's error of the velocity in a record of this drive, behind 2 ms.
fn errors(outcome: &Outcome, segment: usize, volts: f64) -> Vec<f64> {
    let estimate = &outcome.recordings[0].segments[segment].estimate;
    let of = |trajectory: &kalmems::estimate::Trajectory| {
        let mean = &trajectory.state("v").unwrap().mean;
        let errors = trajectory.time_s.iter().zip(mean).filter(|(t, v)| **t > 2e-3 && v.is_finite());
        let squares: Vec<f64> = errors.map(|(t, v)| (v - motion(volts, HZ, *t)[1]).powi(2)).collect();
        assert!(squares.len() > 1000);
        (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()
    };
    estimate.trajectories.iter().map(of).collect()
}

#[test]
fn what_the_drive_makes_of_a_signal_is_taken_off_by_the_record_with_the_bias_off() {
    let folder = tempfile::tempdir().unwrap();
    let all = (3000, 3000);
    let on = rows("a", (1.0, HZ, 0.0), true, all) + &rows("b", (1.3, HZ, 0.0), true, all);
    // Neither amplitude nor trigger is that of the record with the bias on.
    let off = rows("b", (0.8, HZ, 1.1), false, all) + &rows("a", (1.7, HZ, -0.4), false, all);
    std::fs::write(folder.path().join("on.csv"), HEADER.to_owned() + &on).unwrap();
    std::fs::write(folder.path().join("off.csv"), HEADER.to_owned() + &off).unwrap();
    let both = recording("on", "bias_on") + &recording("off", "bias_off");
    let run = |tables: &str| estimate(published(), &parsed(folder.path(), tables), &Silent).unwrap();
    let by_record = run(&format!("{ALONG}{both}{ESTIMATE}"));
    let as_stated = run(&format!("{ALONG}{STATED}{}{ESTIMATE}", recording("on", "test")));
    let left_in = run(&format!("{}{ESTIMATE}", recording("on", "test")));
    for (segment, volts) in [(0, 1.0), (1, 1.3)] {
        let [by_record, as_stated, left_in] =
            [&by_record, &as_stated, &left_in].map(|outcome| errors(outcome, segment, volts));
        println!("{by_record:?} {as_stated:?} {left_in:?}");
        // A sample by itself tells the velocity to 0.5 mm/s; the drive makes 47 mm/s rms of the current.
        for (filter, wrong) in by_record.iter().zip(&left_in) {
            assert!(*filter < NOISE / GAIN && *wrong > 0.02, "{filter} {wrong}");
        }
        assert!(as_stated.iter().all(|error| *error < NOISE / GAIN), "{as_stated:?}");
    }
    // The sine that was taken off is known to σ·√(2/N) of each component, which is in the claims.
    let claim = |outcome: &Outcome| {
        let trajectory = &outcome.recordings[0].segments[0].estimate.trajectories[0];
        let named: Vec<String> = trajectory.considered.iter().map(|one| one.name.to_string()).collect();
        (trajectory.state("v").unwrap().sd[2500], named)
    };
    let ((sd, named), (without, nothing)) = (claim(&by_record), claim(&as_stated));
    assert!(named.iter().all(|name| name == "record.feedthrough") && named.len() == 2, "{named:?}");
    assert!(nothing.is_empty(), "{nothing:?}");
    // The two components of the record with 1.7 V, as large as 1 V makes them, by the 2 A s/m of the current.
    let expected = NOISE * (2.0 / 3000.0_f64).sqrt() / 1.7 / GAIN;
    let added = (sd * sd - without * without).sqrt();
    assert!((added / expected - 1.0).abs() < 0.05, "{added:e} {expected:e}");
}

#[test]
fn a_simulation_has_what_the_table_states_of_the_drive_beside_the_motion() {
    let simulate = "[simulate]\nduration = \"30 ms\"\nsampling_rate = \"100 kHz\"\nintegration_rate = \"100 kHz\"\nseed = 2\n\
                    start = { x = \"0 m\", v = \"0 m/s\" }\n\
                    drive = { sine = { offset = \"0 V\", amplitude = \"1 V\", frequency = \"990 Hz\" } }\n";
    let of = |tables: &str| parsed(Path::new("."), &format!("{tables}{simulate}{ESTIMATE}"));
    let experiment = of(&format!("{ALONG}{STATED}"));
    let simulation = published().rig(&experiment).unwrap().simulate(&experiment).unwrap();
    let recorded = ComputedRecording::of(&*simulation, &Silent).unwrap();
    let rmse = |told: &Experiment| {
        let outcome =
            estimate_computed(published(), &described(told, &*simulation), &recorded, &Silent).unwrap();
        outcome.recordings[0].segments[0].values[0]["v"].rmse
    };
    let (taken_off, left_in) = (rmse(&experiment), rmse(&of("")));
    println!("{taken_off:.2e} {left_in:.2e}");
    assert!(taken_off < NOISE / GAIN && left_in > 0.02, "{taken_off} {left_in}");
}

#[test]
fn a_drive_that_cannot_be_taken_off_is_refused_with_what_to_do() {
    let folder = tempfile::tempdir().unwrap();
    let write =
        |name: &str, text: String| std::fs::write(folder.path().join(name), HEADER.to_owned() + &text);
    write("on.csv", rows("a", (1.0, HZ, 0.0), true, (3000, 3000))).unwrap();
    write("off.csv", rows("b", (1.0, HZ, 0.0), false, (3000, 3000))).unwrap();
    let (on, off) = (recording("on", "bias_on"), recording("off", "bias_off"));
    let refused = |tables: &str, words: &[&str]| {
        let why = said(folder.path(), &format!("{tables}{ESTIMATE}"));
        println!("{why}\n");
        assert!(words.iter().all(|word| why.contains(word)), "{words:?} in: {why}");
    };
    refused(&on, &["[device.equations.feedthrough]", "role `test`"]);
    refused(&format!("{ALONG}{on}"), &["none has `bias_off`", "same labels"]);
    refused(&format!("{ALONG}{on}{off}"), &["counterpart with the bias off is missing", "`b`", "`a`"]);
    write("off.csv", rows("a", (1.0, HZ + 5.0, 0.0), false, (3000, 3000))).unwrap();
    refused(&format!("{ALONG}{on}{off}"), &["995.00 Hz", "990.00 Hz", "one frequency"]);
    refused(
        &format!("{}{on}{off}", ALONG.replace("\"u\"", "\"drive\"")),
        &["feedthrough.of", "`drive`", "known words: u"],
    );
    let other = STATED.replace("current", "charge");
    refused(&format!("{ALONG}{other}{}", recording("on", "test")), &["charge", "current"]);
    let volts = STATED.replace("0.05 A/V", "0.05");
    refused(&format!("{ALONG}{volts}{}", recording("on", "test")), &["signals.current.gain", "1/ohm"]);
    // The generator is switched off, in the first rows by which its sine is known and behind them.
    for (count, ends) in [(3000, 1500), (14_000, 9000)] {
        write("on.csv", rows("a", (1.0, HZ, 0.0), true, (count, ends))).unwrap();
        let why = said(folder.path(), &format!("{ALONG}{STATED}{}{ESTIMATE}", recording("on", "test")));
        let told = why.split("not a steady sine behind ").nth(1).and_then(|rest| rest.split(' ').next());
        let told_s: f64 = told.and_then(|time| time.parse().ok()).unwrap_or_else(|| panic!("{why}"));
        assert!((told_s - f64::from(ends) * INTERVAL).abs() < 2e-4, "{told_s}: {why}");
    }
}

#[test]
fn estimates_are_corrected_by_what_they_were_found_to_be_wrong_by() {
    let folder = tempfile::tempdir().unwrap();
    let text = HEADER.to_owned() + &rows("a", (1.0, HZ, 0.0), true, (3000, 3000));
    std::fs::write(folder.path().join("on.csv"), text).unwrap();
    let tables = |device: &str| format!("{ALONG}{STATED}{device}{}{ESTIMATE}", recording("on", "test"));
    let run = |device: &str| {
        let mut outcome = estimate(published(), &parsed(folder.path(), &tables(device)), &Silent).unwrap();
        outcome.recordings.swap_remove(0).segments.swap_remove(0).estimate.trajectories
    };
    let (plain, corrected) =
        (run(""), run("[device.equations.correction]\nv = { scale = \"1.25\", bias = \"0.1 m/s\" }\n"));
    for (plain, corrected) in plain.iter().zip(&corrected) {
        let [before, after] = [plain, corrected].map(|one| one.state("v").unwrap());
        let there = || before.mean.iter().zip(&after.mean).filter(|(v, _)| v.is_finite());
        assert!(there().count() > 1000 && there().all(|(v, w)| ((v - 0.1) / 1.25 - w).abs() < 1e-12));
        assert!(before.sd.iter().zip(&after.sd).all(|(v, w)| (v / 1.25 - w).abs() <= 1e-15));
        assert_eq!(plain.state("x").unwrap().mean.len(), corrected.state("x").unwrap().mean.len());
    }
    let why = said(
        folder.path(),
        &tables("[device.equations.correction]\nspeed = { scale = \"1\", bias = \"0 m/s\" }\n"),
    );
    assert!(why.contains("speed"), "{why}");
}

#[test]
fn a_device_is_judged_by_what_it_says_that_it_is_for() {
    let folder = tempfile::tempdir().unwrap();
    let tables = recording("on", "test") + ESTIMATE;
    let experiment = parsed(folder.path(), &tables);
    let first = |experiment: &Experiment| published().rig(experiment).unwrap().values(experiment)[0].name;
    assert_eq!(first(&experiment), "v");
    let text = DEVICE.replace("answer = \"v\"", "") + &tables;
    let other = published().parse(&text, &folder.path().join("experiment.toml")).unwrap();
    assert_eq!(first(&other), "x");
    let text = DEVICE.replace("answer = \"v\"", "answer = \"speed\"") + &tables;
    let experiment = published().parse(&text, &folder.path().join("experiment.toml"));
    let why = match experiment {
        Err(error) => error.to_string(),
        Ok(experiment) => estimate(published(), &experiment, &Silent).unwrap_err().to_string(),
    };
    assert!(why.contains("speed") && why.contains('v'), "{why}");
}

/// The first two cycles show an oscillation of 0.711 m/s; a filter that states how far that may be off begins there, and another one at rest.
#[test]
fn a_start_at_the_oscillation_that_the_first_cycles_show_is_that_of_the_motion() {
    let folder = tempfile::tempdir().unwrap();
    let text = HEADER.to_owned() + &rows("a", (1.0, HZ, 0.0), true, (3000, 3000));
    std::fs::write(folder.path().join("on.csv"), text).unwrap();
    let first = |starts: &str, sd: &str| {
        let device = format!("{starts}{ALONG}{STATED}");
        let filter =
            ESTIMATE.replacen("method = \"ekf\"\n", &format!("method = \"ekf\"\nstart_sd = {sd}\n"), 1);
        let tables = format!("{device}{}{filter}", recording("on", "test"));
        let outcome = estimate(published(), &parsed(folder.path(), &tables), &Silent).unwrap();
        let found = outcome.recordings[0].segments[0].estimate.trajectories[0].clone();
        ["x", "v"].map(|state| (found.state(state).unwrap().mean[0], found.state(state).unwrap().sd[0]))
    };
    let truth = motion(1.0, HZ, 0.0);
    let found = first("starts = true\n", "{ x = \"5 um\", v = \"20 mm/s\" }");
    println!("{found:?} {truth:?}");
    for ((found, sd), (truth, stated)) in found.into_iter().zip(truth.into_iter().zip([5e-6, 0.02])) {
        assert!(
            (found - truth).abs() < 2.0 * sd.max(2e-3 * stated) && sd <= stated * 1.0001,
            "{found} {truth}"
        );
    }
    // As without the key: the samples say themselves how well they tell it, about rest.
    let about_rest = first("", "{ x = \"1 mm\", v = \"1 m/s\" }");
    assert!(about_rest.iter().zip(truth).all(|((found, sd), truth)| (found - truth).abs() < 5.0 * sd));
}
