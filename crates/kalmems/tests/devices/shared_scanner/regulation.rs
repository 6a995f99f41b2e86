//! The regulated scanner: the true motion over temperature ramps, against what was wanted.

use super::example;
use kalmems::config::Experiment;
use kalmems::progress::Silent;
use kalmems::results::{Output, RunInfo, Work, write_simulation};
use kalmems::rigs::published;
use kalmems::rigs::shared_scanner::regulation::{RegulatedSimulation, RegulationReport};
use kalmems::simulate::Simulation;
use std::ops::ControlFlow;
use std::time::{Duration, SystemTime};

/// The example with some of its text replaced.
fn experiment(changes: &[(&str, &str)]) -> Result<Experiment, String> {
    let path = example("regulate.toml");
    let mut text = std::fs::read_to_string(&path).unwrap();
    for (from, to) in changes {
        assert!(text.contains(from), "{from}");
        text = text.replacen(from, to, 1);
    }
    published().parse(&text, &path).map_err(|e| e.to_string())
}

fn regulated(changes: &[(&str, &str)]) -> RegulationReport {
    let simulation = RegulatedSimulation::of(&experiment(changes).unwrap()).unwrap();
    simulation.regulate(&mut |_| ControlFlow::Continue(())).unwrap()
}

/// As fast a ramp as the example's, an eighth as long.
const SHORT: [(&str, &str); 3] =
    [("\"-20 K\"", "\"-2.5 K\""), ("to = \"1200 ms\"", "to = \"325 ms\""), ("\"1250 ms\"", "\"350 ms\"")];

#[test]
fn a_short_ramp_is_held() {
    let report = regulated(&SHORT);
    let from_s = report.regulated_from_s.unwrap();
    assert!(from_s < 0.19, "{from_s}");
    assert_eq!((report.sweeps_again, report.losses, report.marks_missed), (0, 0, 0));
    let worst = report.worst.unwrap();
    assert!(worst.amplitude < 5e-3, "{worst:?}");
    assert!(worst.phase.to_degrees() < 0.1, "{worst:?}");
    // What is held is held by the commands: frequency and voltage have gone with the device.
    let at = |time_s: f64| report.windows.iter().find(|window| window.time_s > time_s).unwrap();
    let (before, after) = (at(0.195), at(0.34));
    // √(1 + 2.5 K·64 ppm/K) of the bars' share of the stiffness; the electrodes' share follows the voltage.
    let shift_hz = after.drive_hz - before.drive_hz;
    assert!((1.5..3.5).contains(&shift_hz), "{shift_hz}");
    let less = 1.0 - after.voltage / before.voltage;
    assert!((less - 2.5 * 0.0023).abs() < 3e-3, "{less}");
    let trigger = report.trigger.unwrap();
    assert!(trigger.events > 2000 && trigger.mean_s.abs() < 0.3 * trigger.rms_s, "{trigger:?}");
}

/// Held commands, and the device cools through the fold: the motion drops to rest.
#[test]
fn without_regulation_it_drops_off_the_fold() {
    let fast = [("to = \"1200 ms\"", "to = \"300 ms\""), ("\"1250 ms\"", "\"350 ms\"")];
    let hold = ("# hold_from = \"200 ms\"", "hold_from = \"200 ms\"");
    let held = regulated(&[fast[0], fast[1], hold, ("\"-20 K\"", "\"-30 K\"")]);
    let last = held.windows.last().unwrap();
    assert!(last.amplitude < 0.1 * held.wanted_amplitude, "{last:?}");
    // And heated as much it falls behind, by far more than what regulation leaves.
    let heated = regulated(&[fast[0], fast[1], hold, ("\"-20 K\"", "\"20 K\"")]);
    let last = heated.windows.last().unwrap();
    let less = 1.0 - last.amplitude / heated.wanted_amplitude;
    assert!((0.05..0.3).contains(&less), "{last:?}");
}

#[test]
fn what_cannot_be_regulated_is_refused() {
    let refused = |changes: &[(&str, &str)]| match experiment(changes) {
        Ok(experiment) => match published().rig(&experiment).unwrap().simulate(&experiment) {
            Ok(_) => panic!("{changes:?} was taken"),
            Err(why) => why.to_string(),
        },
        Err(why) => why,
    };
    for (changes, says) in [
        (&[("filter = \"EKF\"", "filter = \"UKF\"")][..], "no `[[estimate.filter]]` has the name `UKF`"),
        (&[("method = \"ekf\"", "method = \"ukf\"")][..], "cannot observe in the loop"),
        (&[("amplitude = \"11 deg\"", "amplitude = \"19 deg\"")][..], "keeps up a motion of `19 deg`"),
        (&[("to = \"31.15 kHz\"", "to = \"31.3 kHz\"")][..], "does not lie between `to` and `from`"),
        (&[("to = \"31.15 kHz\"", "to = \"32 kHz\"")][..], "the sweep goes down"),
        (&[("lowest_voltage = \"30 V\"", "lowest_voltage = \"91 V\"")][..], "is not below `highest_voltage`"),
        (&[("\"100 Hz\"", "\"1 kHz\"")][..], "is too fast"),
        (&[("lead = \"10 us\"", "lead = \"1 us\"")][..], "below two intervals"),
        (&[("to = \"1200 ms\"", "to = \"100 ms\"")][..], "is not after `from`"),
    ] {
        let why = refused(changes);
        assert!(why.contains(says), "{changes:?}: {why}");
    }
    // A temperature under another drive, and another rig's device.
    let text = std::fs::read_to_string(example("regulate.toml")).unwrap();
    let (from, to) =
        (text.find("[simulate.drive.regulated]").unwrap(), text.find("# The filter in").unwrap());
    let sine = "[simulate.drive.sine]\noffset = \"90 V\"\namplitude = \"70 V\"\nfrequency = \"31.25 kHz\"\n";
    let with_sine = format!("{}{sine}{}", &text[..from], &text[to..]);
    let why = published().parse(&with_sine, &example("regulate.toml")).unwrap_err().to_string();
    assert!(why.contains("a temperature changes under a regulated drive alone"), "{why}");
    let threshold = example("../threshold_scanner/simulation.toml");
    let other = std::fs::read_to_string(&threshold).unwrap();
    let start = other.find("[simulate.drive").unwrap();
    let end = other[start + 1..].find("\n[estimate").map_or(other.len(), |i| start + 1 + i);
    let drive = text[from..to].replace("# hold_from", "hold_from");
    let moved = format!("{}{drive}{}", &other[..start], &other[end..]);
    let moved = published().parse(&moved, &threshold).unwrap();
    let why = published().rig(&moved).unwrap().simulate(&moved).err().unwrap().to_string();
    assert!(why.contains("this device is not regulated"), "{why}");
}

/// What is written, and that it is the same each time.
#[test]
fn a_run_is_written_whole_and_the_same_again() {
    let brief = [("\"1250 ms\"", "\"160 ms\""), ("to = \"1200 ms\"", "to = \"300 ms\"")];
    let experiment = experiment(&brief).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let mut all = Vec::new();
    for name in ["one", "two"] {
        let simulation = published().rig(&experiment).unwrap().simulate(&experiment).unwrap();
        let target = folder.path().join(name);
        let info = || RunInfo { started: SystemTime::UNIX_EPOCH, took: Duration::ZERO };
        let output = Output::begin(&target, &Work::named("simulate", name)).unwrap();
        let summary = write_simulation(
            &experiment,
            published().rig(&experiment).unwrap(),
            &*simulation,
            &output,
            info,
            &Silent,
        )
        .unwrap();
        output.commit().unwrap();
        assert!(summary.told[0].starts_with("regulated from"), "{:?}", summary.told);
        assert!(summary.outlook.unwrap().contains("phase margin"));
        let read = |file: &str| std::fs::read(target.join(file)).unwrap();
        all.push(
            ["recording.csv", "regulation.csv", "trigger.csv", "regulation.json", "regulation.svg"].map(read),
        );
    }
    assert!(all[0] == all[1]);
    let windows = String::from_utf8(all[0][1].clone()).unwrap();
    let columns = |line: &str| line.split(',').count();
    assert!(windows.lines().all(|line| columns(line) == 16) && windows.lines().count() > 150);
}

/// The bar: 20 K in a second either way, eight seeds each. Amplitude within 0.5 %, phase within 0.1° of the truth,
/// from the first regulated sample to the end.
#[test]
#[ignore = "slow"]
fn slow_twenty_kelvin_either_way() {
    for change in ["\"-20 K\"", "\"20 K\""] {
        let (mut amplitudes, mut phases, mut nees) = (Vec::new(), Vec::new(), Vec::new());
        for seed in 1..=8 {
            let seed = format!("seed = {seed}");
            let report = regulated(&[("seed = 1", &seed), ("\"-20 K\"", change)]);
            let (worst, trigger) = (report.worst.unwrap(), report.trigger.unwrap());
            println!(
                "{change} {seed}: regulated from {:.1} ms, amplitude {:.3} % ({:.3} rms), phase {:.4} deg ({:.4} rms), \
                 trigger {:.1} ns rms, mean {:.2} ns, NEES {:.2}",
                1e3 * report.regulated_from_s.unwrap(),
                100.0 * worst.amplitude,
                100.0 * worst.amplitude_rms,
                worst.phase.to_degrees(),
                worst.phase_rms.to_degrees(),
                1e9 * trigger.rms_s,
                1e9 * trigger.mean_s,
                trigger.nees
            );
            assert_eq!((report.sweeps_again, report.losses, report.marks_missed), (0, 0, 0));
            amplitudes.push(100.0 * worst.amplitude);
            phases.push(worst.phase.to_degrees());
            nees.push(trigger.nees);
        }
        for (name, values, most) in [("amplitude/%", &amplitudes, 0.5), ("phase/deg", &phases, 0.1)] {
            let low = values.iter().copied().fold(f64::INFINITY, f64::min);
            let high = values.iter().copied().fold(0.0, f64::max);
            println!("{change} {name}: {low:.4} to {high:.4}");
            assert!(high < most, "{name}");
        }
    }
}

/// Without the gain as a state, what the gain drifts by is taken for amplitude.
#[test]
#[ignore = "slow"]
fn slow_a_gain_that_is_not_tracked_is_taken_for_amplitude() {
    let told = regulated(&[]);
    let untold = regulated(&[("gain = { start_sd = \"1 %\", drift = \"5e-6 1/s\" }\n", "")]);
    let off = |report: &RegulationReport| report.worst.unwrap().amplitude;
    println!("tracked {:.3} %, not tracked {:.3} %", 100.0 * off(&told), 100.0 * off(&untold));
    assert!(off(&untold) > 1.5 * off(&told));
}

/// The whole of the simulation is behind the rig's own door as well.
#[test]
fn the_rig_hands_it_out() {
    let experiment = experiment(&[]).unwrap();
    let simulation = published().rig(&experiment).unwrap().simulate(&experiment).unwrap();
    assert_eq!(simulation.samples(), 1_250_001);
    assert!(simulation.files().files.is_empty());
    let direct = RegulatedSimulation::of(&experiment).unwrap();
    assert_eq!(direct.outlook(), simulation.outlook());
}
