//! Faults of the channels that no single channel shows: exchanged and inverted ones, a drive of another recording, and a dropped bit.

use crate::devices::Setting;
use crate::outliers::signals::{DEVICES, Of, Outcome, signals};
use kalmems::config::Experiment;
use kalmems::diagnose::InputFault;
use kalmems::progress::Silent;
use kalmems::results::{Metrics, number_check_of};
use kalmems::rigs::published;
use kalmems::simulate::ComputedRecording;
use kalmems::workflow::estimate_computed;
use std::f64::consts::TAU;

const STAGE: Of = Of::Published("micro-stage");
const COMB: Of = Of::Equations("comb_resonator/simulation.toml");

/// The figures of a recording with what the check of its channels finds.
fn checked(experiment: &Experiment, simulated: &ComputedRecording) -> Metrics {
    let outcome = estimate_computed(published(), experiment, simulated, &Silent).unwrap();
    let metrics = Metrics::of(&outcome);
    let numbers = number_check_of(published(), (&outcome, &metrics), &Silent).unwrap();
    metrics.with_numbers(numbers)
}

/// What is found of a recording with this fault, which does not pass.
fn found(of: Of, fault: impl FnOnce(&mut ComputedRecording)) -> Option<InputFault> {
    let (experiment, mut simulated) = of.recorded(&[], 711);
    fault(&mut simulated);
    let metrics = checked(&experiment, &simulated);
    let first = metrics.estimators().next().unwrap();
    println!("{}: {:?}, {:?}", of.name(), first.verdict, metrics.input_fault);
    assert!(!first.passes());
    metrics.input_fault
}

fn change(simulated: &mut ComputedRecording, meaning: &str, by: impl Fn(f64, f64) -> f64) {
    assert!(simulated.change_recorded(meaning, |values, times| {
        for (value, time_s) in values.iter_mut().zip(times) {
            *value = by(*value, *time_s);
        }
    }));
}

fn exchange(simulated: &mut ComputedRecording, [one, other]: [&str; 2]) {
    let mut kept = Vec::new();
    assert!(simulated.change_recorded(one, |values, _| kept = values.to_vec()));
    assert!(simulated.change_recorded(other, |values, _| values.swap_with_slice(&mut kept)));
    assert!(simulated.change_recorded(one, |values, _| values.copy_from_slice(&kept)));
}

#[test]
fn exchanged_channels_of_the_micro_stage_are_named() {
    for pair in [["1A", "1B"], ["1A", "2A"], ["1B", "2A"], ["2A", "2B"]] {
        let meanings = pair.map(|name| format!("signal_{name}"));
        let fault = found(STAGE, |simulated| exchange(simulated, meanings.each_ref().map(String::as_str)));
        let [one, other] = pair.map(|name| format!("`cap{name}_V`"));
        assert_eq!(fault.unwrap().found, format!("{one} and {other} are exchanged"));
    }
}

#[test]
fn inverted_channels_are_named() {
    for name in ["1A", "2B"] {
        let fault =
            found(STAGE, |simulated| change(simulated, &format!("signal_{name}"), |y, _| -y)).unwrap();
        assert_eq!(fault.found, format!("`cap{name}_V` is inverted"));
        assert!(fault.mean_nis[1] < 1.1, "{fault:?}");
    }
    let fault = found(STAGE, |simulated| change(simulated, "drive", |u, _| -u)).unwrap();
    assert_eq!(fault.found, "`drive_V` is inverted");
    // The force of a comb is the square of its voltage, which does not show the sign of the drive.
    let fault = found(COMB, |simulated| change(simulated, "signal", |y, _| -y)).unwrap();
    assert!(fault.found.ends_with("is inverted") && !fault.found.contains("drive"), "{fault:?}");
}

#[test]
fn a_drive_of_another_frequency_is_named_with_both() {
    for hz in [1650.0, 1710.0] {
        let fault =
            found(STAGE, |simulated| change(simulated, "drive", |_, t| 1.2 * (TAU * hz * t).sin())).unwrap();
        let expected = format!(
            "the drive `drive_V` does not belong to the signal: it has {hz:.2} Hz, and the signal follows from one of 1700.0"
        );
        assert!(fault.found.starts_with(&expected), "{fault:?}");
    }
}

/// Recordings without a fault have none, be the numbers of the device right or not.
#[test]
fn channels_that_are_right_are_not_named() {
    for of in DEVICES {
        let (experiment, simulated) = of.recorded(&[], 712);
        let metrics = checked(&experiment, &simulated);
        let fault = &metrics.input_fault;
        assert!(fault.is_none(), "{}: {fault:?}", of.name());
        let first = signals(&experiment).swap_remove(0);
        for bits in [8, 12, 16] {
            let mut digital = simulated.clone();
            convert(&mut digital, &first, bits, |code| code);
            let outcome = Outcome::of(&experiment, &digital);
            assert!(!outcome.refused.contains("dropped"), "{}, {bits} bits: {}", of.name(), outcome.refused);
        }
    }
    let (experiment, simulated) = STAGE.recorded(&[], 713);
    let wrong: [Setting; 3] = [
        ("device.micro_stage.resonator.natural_frequency", "\"1722 Hz\"".to_owned()),
        ("device.micro_stage.resonator.drive_gain", "\"4700 rad/s^2/V\"".to_owned()),
        ("device.micro_stage.electrodes.1A.gain", "\"-2.2e7 V ohm\"".to_owned()),
    ];
    for (key, value) in &wrong {
        let mut document: toml::Value = experiment.to_toml().unwrap().parse::<toml::Table>().unwrap().into();
        crate::devices::put(&mut document, key, Some(value));
        let told = published().parse(&toml::to_string(&document).unwrap(), experiment.path()).unwrap();
        let metrics = checked(&told, &simulated);
        assert!(!metrics.estimators().next().unwrap().passes(), "{key}");
        assert!(metrics.input_fault.is_none(), "{key}: {:?}", metrics.input_fault);
    }
}

/// What a converter of so many bits, with a range a tenth larger than the signal's, makes of it, and a fault of its codes.
fn convert(simulated: &mut ComputedRecording, signal: &str, bits: u32, fault: impl Fn(u64) -> u64) {
    assert!(simulated.change_recorded(signal, |values, _| {
        let (low, high) =
            values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), y| (l.min(*y), h.max(*y)));
        let begin = low - 0.05 * (high - low);
        let step = 1.1 * (high - low) / f64::from(1_u32 << bits);
        for value in values {
            #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, clippy::cast_precision_loss)]
            {
                *value = begin + fault(((*value - begin) / step).round() as u64) as f64 * step;
            }
        }
    }));
}

/// One of the higher bits is always 0. The highest one is found where the noise is smaller than the motion within three samples, which the threshold
/// scanner's is not.
#[test]
fn a_dropped_bit_is_named_with_its_weight() {
    for name in ["micro-stage", "threshold scanner", "piston mirror"] {
        let of = Of::Published(name);
        let (experiment, simulated) = of.recorded(&[], 714);
        let signal = signals(&experiment).swap_remove(0);
        for bit in [9, 11, 12, 13, 15] {
            if bit == 15 && name == "threshold scanner" {
                continue;
            }
            let mut spoilt = simulated.clone();
            convert(&mut spoilt, &signal, 16, |code| code & !(1 << bit));
            let outcome = Outcome::of(&experiment, &spoilt);
            println!("{name}, bit {bit}: {}", outcome.refused);
            assert!(outcome.refused.contains("bit"), "{name}, {bit}: {:?}", outcome.refused);
        }
    }
}
