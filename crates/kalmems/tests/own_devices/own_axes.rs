//! Devices of equations whose angles are driven each by a sine of its own, and angles whose sign no signal tells over a loss of the signal.

use kalmems::config::Experiment;
use kalmems::estimate::{SegmentEstimate, Trajectory, TrajectoryKind};
use kalmems::expand::expand;
use kalmems::progress::Silent;
use kalmems::recording::SampledRecording;
use kalmems::rigs::published;
use kalmems::workflow::{SegmentOutcome, estimate};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

fn example(file: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/shared_scanner").join(file)
}

/// The scanner of one axis, written out as equations, with one filter, and its recording.
fn one_axis() -> (Experiment, SampledRecording) {
    let path = example("true_stiffness.toml");
    let own = published().load(&path).unwrap();
    let text = expand(published(), &own).unwrap().text;
    // By a stiffness that is off a filter that goes on without a signal leaves the motion.
    let told = text.replace("stiffness = \"0.00011 N m\"", "stiffness = \"0.0001102 N m\"");
    assert_ne!(told, text, "{text}");
    let text = told;
    let mut experiment = published().parse(&text, &path).unwrap();
    experiment.estimate.as_mut().unwrap().filters.retain(|filter| filter.name.as_str() == "EKF");
    let file = experiment.resolve(&experiment.recording(0).unwrap().file);
    let layout = published().rig(&experiment).unwrap().layout(&experiment, 0).unwrap();
    (experiment, SampledRecording::read(&file, &layout).unwrap())
}

fn followed(experiment: &Experiment, recording: &SampledRecording) -> Trajectory {
    let rig = published().rig(experiment).unwrap();
    let found = rig.estimate(experiment, 0, recording, &Silent).unwrap_or_else(|error| panic!("{error}"));
    let SegmentEstimate { trajectories, .. } = found.into_iter().next().unwrap();
    trajectories.into_iter().next().unwrap()
}

/// A filter that has lost the signal is started again from it, which tells no sign; the drive has kept the phase of the motion all the while, and with it the
/// sign.
#[test]
fn a_sign_that_no_signal_tells_is_kept_over_a_loss_of_the_signal() {
    let (experiment, recording) = one_axis();
    let whole = followed(&experiment, &recording);
    let mut restarts = 0;
    for shift in 0..12 {
        let from_s = 10e-3 + f64::from(shift) * 7.3e-6;
        // The cable is out: a level with noise.
        let lost = recording.what_if("cap_V", |time_s, values| {
            let mut noise = kalmems::simulate::WhiteNoise::new(7, 0);
            let level = values.iter().sum::<f64>() / values.len() as f64;
            let rows = time_s.iter().zip(values).filter(|(t, _)| (from_s..from_s + 4e-3).contains(*t));
            rows.for_each(|(_, y)| *y = level + 0.014 * noise.sample());
        });
        let found = followed(&experiment, &lost);
        restarts += found.restarts.len();
        let last = found.time_s.len() - 2000..found.time_s.len();
        let of = |one: &Trajectory| one.states[0].mean[last.clone()].to_vec();
        let alike: f64 = of(&whole).iter().zip(of(&found)).map(|(whole, found)| whole * found).sum();
        assert!(alike > 0.0, "lost at {from_s} s: {:?}", found.restarts);
    }
    assert!(restarts >= 12, "{restarts}");
}

/// Two resonators, each before an electrode of its own, seen by one signal that is even in both.
fn two_electrodes(drives: &str, of: &str, signal: &str) -> String {
    format!(
        r#"
name = "two_electrodes"
[device.equations.states]
tilt = "rad"
tilt_rate = "rad/s"
roll = "rad"
roll_rate = "rad/s"
[device.equations.inputs]
{drives}
[device.equations.parameters]
tilt_resonance = "15 kHz"
roll_resonance = "6.3 kHz"
damping = "0.3 %"
force = "3e6 rad/s^2/V"
width = "0.3 rad"
depth = "1 V"
noise = "1e-6 V^2"
[device.equations.let]
w = "2*pi*tilt_resonance"
u = "2*pi*roll_resonance"
[device.equations.derivative]
tilt = "tilt_rate"
tilt_rate = "force*push_tilt - 2*damping*w*tilt_rate - w^2*tilt"
roll = "roll_rate"
roll_rate = "force*push_roll - 2*damping*u*roll_rate - u^2*roll"
[device.equations.measure]
signal = "{signal}"
[device.equations.noise]
signal = "noise"
[device.equations.angles]
tilt = "tilt_rate"
roll = "roll_rate"
[device.equations.oscillation]
of = {of}
harmonic = 2
"#
    )
}

const EVEN: &str = "depth*(exp(-(tilt/width)^2) + exp(-(roll/width)^2)) in V";
const BOTH: &str = "[\"tilt\", \"roll\"]";
const TWO_INPUTS: &str = "push_tilt = \"V\"\npush_roll = \"V\"";

/// An experiment on a recording of both resonators under sines near their resonances, each an input of its own, simulated by a rotation from sample to sample.
fn recorded(folder: &Path, device: &str) -> Experiment {
    const RATE_HZ: f64 = 500e3;
    let mut rows = String::from("time_s,tilt_V,roll_V,cap_V,tilt_rad,roll_rad\n");
    let mut noise = kalmems::simulate::WhiteNoise::new(3, 0);
    let steady = |resonance_hz: f64, drive_hz: f64, time_s: f64| {
        // x″ + 2ζωx′ + ω²x = F·sin Ωt has the steady motion F·sin(Ωt − δ)/|…|.
        let [own, driven] = [resonance_hz, drive_hz].map(|hz| hz * std::f64::consts::TAU);
        let [apart, damped] = [own * own - driven * driven, 2.0 * 0.003 * own * driven];
        3e6 / apart.hypot(damped) * (driven * time_s - damped.atan2(apart)).sin()
    };
    for k in 0..15_000 {
        let time_s = f64::from(k) / RATE_HZ;
        let volts = [15.02e3, 6.31e3].map(|hz| (std::f64::consts::TAU * hz * time_s).sin());
        let [tilt, roll] = [4.0 * steady(15e3, 15.02e3, time_s), 1.0 * steady(6.3e3, 6.31e3, time_s)];
        let even = |angle: f64| (-(angle / 0.3).powi(2)).exp();
        let signal = even(tilt) + even(roll) + 1e-3 * noise.sample();
        writeln!(rows, "{time_s:.9},{:e},{:e},{signal:e},{tilt:e},{roll:e}", 4.0 * volts[0], volts[1])
            .unwrap();
    }
    std::fs::write(folder.join("recording.csv"), rows).unwrap();
    let text = format!(
        "{device}
[[recording]]
role = \"test\"
file = \"recording.csv\"
clock = {{ column = \"time_s\" }}
channels = {{ push_tilt = \"tilt_V\", push_roll = \"roll_V\", signal = \"cap_V\" }}
reference = {{ channels = {{ tilt = \"tilt_rad\", roll = \"roll_rad\" }} }}
[estimate]
skip = \"10 ms\"
process_noise = {{ tilt_rate = \"1 rad^2/s^3\", roll_rate = \"1 rad^2/s^3\" }}
[[estimate.filter]]
name = \"EKF\"
method = \"ekf\"
start = \"from_signal\"
[[estimate.filter]]
name = \"lock-in\"
method = \"lock_in\"
[[estimate.filter]]
name = \"settled\"
method = \"steady_state\"
start = \"from_signal\"
"
    );
    published().parse(&text, &folder.join("experiment.toml")).unwrap_or_else(|error| panic!("{error}"))
}

/// Started, locked in, and told of each by amplitude and phase: a device that is no published one, whose axes have an input each.
#[test]
fn two_axes_with_an_input_each_are_told_apart_in_one_signal() {
    let folder = tempfile::tempdir().unwrap();
    let experiment = recorded(folder.path(), &two_electrodes(TWO_INPUTS, BOTH, EVEN));
    let outcome = estimate(published(), &experiment, &Silent).unwrap_or_else(|error| panic!("{error}"));
    let SegmentOutcome { errors, estimate, .. } = &outcome.recordings[0].segments[0];
    assert_eq!((estimate.motion.frequency_hz.round(), estimate.other_axes.len()), (15_020.0, 1));
    assert_eq!(
        (estimate.other_axes[0].angle, estimate.other_axes[0].motion.frequency_hz.round()),
        ("roll", 6_310.0)
    );
    for (trajectory, errors) in estimate.trajectories.iter().zip(errors) {
        let errors = errors.as_ref().unwrap();
        assert!(
            trajectory.failure.is_none() && trajectory.lock.held(),
            "{}: {:?}",
            trajectory.name,
            trajectory.lock
        );
        if trajectory.kind == TrajectoryKind::LockIn {
            // The signal is even in both, so that its lines alone tell no sign.
            let rms = |one: &Trajectory, place: usize| {
                let values = &one.states[place].mean[6_000..14_000];
                (values.iter().map(|x| x * x).sum::<f64>() / values.len() as f64).sqrt()
            };
            let filtered = &estimate.trajectories[0];
            for (locked, own) in [(0, 0), (2, 2)] {
                let ratio = rms(trajectory, locked) / rms(filtered, own);
                assert!((ratio - 1.0).abs() < 0.01, "{locked}: {ratio}");
            }
            continue;
        }
        for axis in errors.each() {
            let [error, phase] = [axis.angle.rmse_deg, axis.peak_phase_rmse_deg.unwrap()];
            println!("{} {}: {error:.5} deg, phase {phase:.4} deg", trajectory.name, axis.of);
            assert!(
                error < 0.1 && phase < 0.5 && axis.peaks_without_partner == 0,
                "{} {}",
                trajectory.name,
                axis.of
            );
        }
    }
}

#[test]
fn an_oscillation_of_several_states_that_cannot_be_told_apart_is_refused_by_name() {
    let folder = tempfile::tempdir().unwrap();
    recorded(folder.path(), &two_electrodes(TWO_INPUTS, BOTH, EVEN));
    let refused = |of: &str, signal: &str| {
        let device = two_electrodes(TWO_INPUTS, of, signal);
        let path = folder.path().join("experiment.toml");
        let lock_in = "[[recording]]\nrole = \"test\"\nfile = \"recording.csv\"\nclock = { column = \"time_s\" }\n\
                       channels = { push_tilt = \"tilt_V\", push_roll = \"roll_V\", signal = \"cap_V\" }\n\
                       [estimate]\nskip = \"10 ms\"\n[[estimate.filter]]\nname = \"lock-in\"\nmethod = \"lock_in\"\n";
        match published().parse(&format!("{device}{lock_in}"), &path) {
            Err(error) => error.to_string(),
            Ok(experiment) => estimate(published(), &experiment, &Silent).unwrap_err().to_string(),
        }
    };
    let mixed = refused(BOTH, "depth*exp(-(tilt^2 + roll^2)/width^2) in V");
    assert!(mixed.contains("no sum of a part of `tilt` and one of `roll`"), "{mixed}");
    let three = refused("[\"tilt\", \"roll\", \"tilt\"]", EVEN);
    assert!(three.contains("3 states are named; expected 2 at most"), "{three}");
    let unknown = refused("[\"tilt\", \"yaw\"]", EVEN);
    assert!(unknown.contains("`yaw`, which is not a state"), "{unknown}");
    let one = refused("\"tilt\"", EVEN);
    assert!(one.contains("depends on `roll` as well"), "{one}");
}
