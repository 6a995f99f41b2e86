//! Single faults that the program knows: it names them, alone or among those that the recording cannot tell apart.

use super::faults::{Does, Fault, hum, late, scaled, spikes};
use crate::devices::DEVICES;
use crate::side_by_side::side_by_side;
use kalmems::diagnose::{Diagnosis, DiagnosisFinding};
use std::collections::BTreeMap;

const SHARED: &str = "shared scanner";
const AXES: &str = "two axes";
const THRESHOLD: &str = "threshold scanner";
const ACCELEROMETER: &str = "accelerometer";
const STAGE: &str = "micro-stage";
const PISTON: &str = "piston mirror";

const fn told(
    device: &'static str,
    key: &'static str,
    is_named: &'static str,
    value: f64,
    unit: &'static str,
) -> Fault {
    Fault { device, does: Does::Told(key, value, unit), is_named, sizes: [1e-5, 0.5] }
}

const fn too_quiet(
    device: &'static str,
    key: &'static str,
    is_named: &'static str,
    value: f64,
    unit: &'static str,
) -> Fault {
    Fault { device, does: Does::ToldTooSmall(key, value, unit), is_named, sizes: [0.05, 20.0] }
}

const fn records(
    device: &'static str,
    meaning: &'static str,
    change: fn(&mut [f64], &[f64], f64, u64),
    is_named: &'static str,
    sizes: [f64; 2],
) -> Fault {
    Fault { device, does: Does::Records(meaning, change), is_named, sizes }
}

const SCALE: &str = "the scale of the drive's column";
const TIME: &str = "the time of the drive's column";
const LINE: &str = "a line of";
const SPIKES: &str = "samples of the signal";

/// Written down before any of them was diagnosed.
const FAULTS: [Fault; 48] = [
    // A stiffness, or what stands for it.
    told(SHARED, "device.shared_scanner.resonator.stiffness", "resonator.stiffness", 1.10e-4, "N m"),
    told(
        AXES,
        "device.shared_scanner.second_axis.resonator.stiffness",
        "second_axis.resonator.stiffness",
        1.00e-4,
        "N m",
    ),
    told(
        THRESHOLD,
        "device.threshold_scanner.resonator.natural_frequency",
        "resonator.natural_frequency",
        624.6,
        "Hz",
    ),
    told(ACCELEROMETER, "device.accelerometer.proof_mass.spring", "proof_mass.spring", 3.0, "N/m"),
    told(
        STAGE,
        "device.micro_stage.resonator.natural_frequency",
        "resonator.natural_frequency",
        1714.5,
        "Hz",
    ),
    // Damping.
    told(SHARED, "device.shared_scanner.resonator.damping", "resonator.damping", 5.95e-12, "N m s"),
    told(
        THRESHOLD,
        "device.threshold_scanner.resonator.damping_ratio",
        "resonator.damping_ratio",
        0.0066,
        "",
    ),
    told(ACCELEROMETER, "device.accelerometer.proof_mass.damping", "proof_mass.damping", 7e-4, "N s/m"),
    // Inertia.
    told(SHARED, "device.shared_scanner.resonator.inertia", "resonator.inertia", 1.15e-14, "kg m^2"),
    told(ACCELEROMETER, "device.accelerometer.proof_mass.mass", "proof_mass.mass", 3.8e-9, "kg"),
    // Capacitances.
    told(SHARED, "device.shared_scanner.comb.nominal_capacitance", "comb.nominal_capacitance", 5.71, "pF"),
    told(SHARED, "device.shared_scanner.comb.bias_capacitance", "comb.bias_capacitance", 9.79, "pF"),
    // Widths and gaps.
    told(SHARED, "device.shared_scanner.comb.angular_width", "comb.angular_width", 0.2, "rad"),
    told(
        AXES,
        "device.shared_scanner.second_axis.comb.angular_width",
        "second_axis.comb.angular_width",
        0.2,
        "rad",
    ),
    told(ACCELEROMETER, "device.accelerometer.plates.gap", "plates.gap", 2.3, "um"),
    told(ACCELEROMETER, "device.accelerometer.plates.area", "plates.area", 1.86, "mm^2"),
    told(STAGE, "device.micro_stage.electrodes.1A.gap", "electrodes.1A.gap", 19.2, "um"),
    told(STAGE, "device.micro_stage.electrodes.2B.w2", "electrodes.2B.w2", -475.0, "um"),
    // Gains and offsets of the readout.
    told(SHARED, "device.shared_scanner.readout.gain", "readout.gain", -0.3574, "V/pF"),
    told(AXES, "device.shared_scanner.readout.gain", "readout.gain", -0.3574, "V/pF"),
    told(
        ACCELEROMETER,
        "device.accelerometer.readout.feedback_capacitance",
        "readout.feedback_capacitance",
        20.0,
        "pF",
    ),
    told(STAGE, "device.micro_stage.electrodes.1A.gain", "electrodes.1A.gain", -2.40752e7, "V ohm"),
    told(SHARED, "device.shared_scanner.readout.offset", "readout.offset", 6.3945, "V"),
    Fault {
        device: THRESHOLD,
        does: Does::Has("device.threshold_scanner.readout.offset", "mV"),
        is_named: "readout.offset",
        sizes: [0.1, 100.0],
    },
    // Noise.
    too_quiet(
        SHARED,
        "device.shared_scanner.readout.noise_variance",
        "readout.noise_variance",
        1.92e-4,
        "V^2",
    ),
    too_quiet(
        THRESHOLD,
        "device.threshold_scanner.readout.noise_variance",
        "readout.noise_variance",
        1.89225e-3,
        "V^2",
    ),
    too_quiet(
        ACCELEROMETER,
        "device.accelerometer.readout.noise_variance",
        "readout.noise_variance",
        4.88e-9,
        "V^2",
    ),
    too_quiet(
        STAGE,
        "device.micro_stage.electrodes.1B.noise_variance",
        "electrodes.1B.noise_variance",
        1.6e-11,
        "V^2",
    ),
    too_quiet(
        PISTON,
        "device.piston_mirror.readout.noise_density",
        "readout.noise_density",
        0.393,
        "aF/sqrt(Hz)",
    ),
    // Lateness.
    Fault {
        device: SHARED,
        does: Does::Has("device.shared_scanner.readout.delay", "us"),
        is_named: "readout.delay",
        sizes: [0.01, 4.0],
    },
    // Carriers, bias and feedback.
    told(SHARED, "device.shared_scanner.carrier.amplitude", "carrier.amplitude", 6.0, "V"),
    told(
        ACCELEROMETER,
        "device.accelerometer.readout.carrier_amplitude",
        "readout.carrier_amplitude",
        0.6,
        "V",
    ),
    told(ACCELEROMETER, "device.accelerometer.feedback.bias", "feedback.bias", 0.173, "V"),
    // The film between the plates.
    Fault {
        device: ACCELEROMETER,
        does: Does::Has("device.accelerometer.proof_mass.squeezed_film", ""),
        is_named: "proof_mass.squeezed_film",
        sizes: [1e-3, 0.5],
    },
    // The drive's gain, its column's scale and time.
    told(THRESHOLD, "device.threshold_scanner.drive.gain", "drive.gain", 60.0, "rad/s^2/V^2"),
    told(STAGE, "device.micro_stage.resonator.drive_gain", "resonator.drive_gain", 3782.5, "rad/s^2/V"),
    records(SHARED, "drive", scaled, SCALE, [1e-4, 0.5]),
    records(THRESHOLD, "drive", scaled, SCALE, [1e-4, 0.5]),
    records(SHARED, "drive", late, TIME, [0.01, 5.0]),
    records(STAGE, "drive", late, TIME, [0.01, 20.0]),
    // Feedthrough.
    told(
        THRESHOLD,
        "device.threshold_scanner.readout.feedthrough_capacitance",
        "readout.feedthrough_capacitance",
        0.2,
        "pF",
    ),
    // Lines.
    records(SHARED, "signal", hum, LINE, [0.01, 10.0]),
    records(THRESHOLD, "signal", hum, LINE, [0.01, 10.0]),
    records(PISTON, "signal", hum, LINE, [0.01, 10.0]),
    // Outliers.
    records(SHARED, "signal", spikes, SPIKES, [5.0, 100.0]),
    records(THRESHOLD, "signal", spikes, SPIKES, [5.0, 100.0]),
    records(ACCELEROMETER, "signal", spikes, SPIKES, [5.0, 100.0]),
    records(PISTON, "signal", spikes, SPIKES, [5.0, 100.0]),
];

#[test]
#[ignore = "long: `.ci/run --all` runs it"]
fn long_a_stiffness_is_named_with_the_inertia_that_cannot_be_told_from_it_and_offered_as_a_state() {
    let faulty = FAULTS[0].of_size(0.003, 31);
    let found = faulty.diagnosis();
    let names: Vec<&str> = found.causes.iter().map(|cause| cause.name.as_str()).collect();
    assert!(found.finding == DiagnosisFinding::Explained && names.len() == 2, "{names:?}");
    assert!(names.contains(&"resonator.stiffness") && names.contains(&"resonator.inertia"), "{names:?}");
    let right = FAULTS[0].right_error(0.003, 31).unwrap();
    assert!(faulty.error_with(&found, "resonator.stiffness").unwrap() < 1.3 * right);

    let states = |name: &str| &found.causes.iter().find(|cause| cause.name == name).unwrap().states;
    assert_eq!(states("resonator.stiffness"), &["stiffness = { start_sd = \"0.6 %\" }"]);
    assert_eq!(states("resonator.inertia"), &["inertia = { start_sd = \"0.6 %\" }"]);
    assert!(
        found
            .to_text()
            .contains("as a state of the filter: states = { stiffness = { start_sd = \"0.6 %\" } }")
    );
}

#[test]
#[ignore = "long: `.ci/run --all` runs it"]
fn long_a_harmonic_of_the_motion_in_the_signal_is_named() {
    let right = Fault { device: SHARED, does: Does::Has("simulate.seed", ""), is_named: "", sizes: [1.0; 2] };
    let mut faulty = right.of_size(31.0, 31);
    let motion_hz = faulty.motion_hz();
    faulty.put_line(3.0 * motion_hz, 0.5);
    let found = faulty.diagnosis();
    let names: Vec<&str> = found.causes.iter().map(|cause| cause.name.as_str()).collect();
    assert!(
        names.len() == 1 && names[0].ends_with("harmonic 3 of the motion"),
        "{names:?} {:?}",
        found.tests
    );
}

#[test]
#[ignore = "10 seconds in a release build"]
fn slow_hum_is_named_with_its_frequency() {
    let place = FAULTS.iter().position(|fault| fault.is_named == LINE && fault.device == THRESHOLD).unwrap();
    let found = FAULTS[place].of_size(1.0, 31).diagnosis();
    let names: Vec<&str> = found.causes.iter().map(|cause| cause.name.as_str()).collect();
    // Two periods in the 40 ms of the recording, one and a half of them after the settling time.
    let hz = names
        .first()
        .and_then(|name| name.strip_prefix("a line of ")?.split(' ').next()?.parse::<f64>().ok());
    assert!(names.len() == 1 && hz.is_some_and(|hz| (hz - 50.0).abs() < 0.5), "{names:?} {:?}", found.tests);
}

#[test]
fn of_filters_that_are_right_nothing_is_changed() {
    for device in DEVICES.iter().filter(|device| device.name != "two axes") {
        let right = Fault {
            device: device.name,
            does: Does::Records("signal", |_, _, _, _| {}),
            is_named: "",
            sizes: [1.0; 2],
        };
        // A stage has several signals, none of which is called so.
        let right = if device.name == STAGE {
            Fault { does: Does::Has("simulate.seed", ""), ..right }
        } else {
            right
        };
        let found = right.of_size(31.0, 31).diagnosis();
        assert_eq!(found.finding, DiagnosisFinding::NothingToChange, "{}: {:?}", device.name, found.tests);
        assert!(found.causes.is_empty() && found.closest.is_empty());
    }
}

/// Of as many filters that are right, in how many the diagnosis finds something to change.
#[test]
#[ignore = "two minutes on two processors, beside other work, in a release build"]
fn slow_of_filters_that_are_right_nothing_is_changed() {
    let all: Vec<(&str, u32)> =
        DEVICES.iter().flat_map(|device| (7001..7041).map(|seed| (device.name, seed))).collect();
    let found = side_by_side(&all, |(device, seed)| {
        let does = Does::Has("simulate.seed", "");
        let right = Fault { device, does, is_named: "", sizes: [1.0; 2] };
        right.of_size(f64::from(*seed), u64::from(*seed)).diagnosis()
    });
    for device in &DEVICES {
        let own = all.iter().zip(&found).filter(|((name, _), _)| *name == device.name);
        println!("{:18} {:?}", device.name, counted(own.map(|(_, found)| in_words(found))));
    }
    let changed = found.iter().filter(|found| found.finding != DiagnosisFinding::NothingToChange).count();
    println!("{changed} of {} filters that are right are to be changed", found.len());
    assert!(20 * changed <= found.len(), "{changed} of {}", found.len());
}

/// A finding with the causes that it names.
fn in_words(found: &Diagnosis) -> String {
    let listed: Vec<&str> = found.causes.iter().map(|cause| cause.name.as_str()).collect();
    format!("{:?}: {}", found.finding, listed.join(", "))
}

/// How often each is there.
fn counted(all: impl Iterator<Item = String>) -> BTreeMap<String, u32> {
    let mut counts = BTreeMap::new();
    all.for_each(|one| *counts.entry(one).or_insert(0) += 1);
    counts
}

/// Fresh recordings of each kind of fault.
const RECORDINGS: u64 = 5;

/// How much larger than that of the right model the error may be with what a diagnosis says.
const MENDED: f64 = 1.3;

/// What diagnoses of recordings with a kind of fault come to.
struct Diagnosed {
    named: u64,
    /// The error of the answer with the lines that are to be pasted over that of the right model, root mean square over the recordings; not a
    /// number where there are none.
    error_over_right: f64,
}

impl Diagnosed {
    /// That of a kind with its place in the list; `None` of one that no size shows in the innovations.
    fn of((place, fault): &(u64, &Fault)) -> Option<Self> {
        let key = match fault.does {
            Does::Told(key, ..) | Does::ToldTooSmall(key, ..) | Does::Has(key, _) => key,
            Does::Records(..) => fault.is_named,
        };
        let Some(size) = fault.visible_size() else {
            println!("{:18} {key:58} is not seen in the innovations", fault.device);
            return None;
        };
        // Mean squares of the errors with what is pasted, and of the right model.
        let (mut named, mut errors, mut all) = (0, [0.0; 2], Vec::new());
        for seed in (0..RECORDINGS).map(|k| 2001 + 10 * place + k) {
            let faulty = fault.of_size(size, seed);
            let found = faulty.diagnosis();
            let cause = found.causes.iter().find(|cause| cause.name.contains(fault.is_named));
            named += u64::from(cause.is_some());
            all.push(in_words(&found));
            let is_of_recording = matches!(fault.does, Does::Records(..));
            if let Some(cause) = cause.filter(|cause| !is_of_recording && !cause.edits.is_empty()) {
                let both = [faulty.error_with(&found, &cause.name), fault.right_error(size, seed)];
                errors
                    .iter_mut()
                    .zip(both)
                    .for_each(|(sum, error)| *sum += error.unwrap_or(f64::NAN).powi(2));
            }
        }
        let error_over_right = (errors[0] / errors[1]).sqrt();
        // As soon as it is known: all of them take long.
        let mended = Some(error_over_right)
            .filter(|ratio| !ratio.is_nan())
            .map(|ratio| format!(", error {ratio:.2} of the right model's"));
        let findings = counted(all.into_iter());
        let findings: Vec<String> =
            findings.iter().map(|(what, count)| format!("\n    {count}: {what}")).collect();
        println!(
            "{:18} {key:58} {size:9.2e}: {named} of {RECORDINGS} named{}{}",
            fault.device,
            mended.unwrap_or_default(),
            findings.concat()
        );
        Some(Self { named, error_over_right })
    }
}

#[test]
#[ignore = "a quarter of an hour on two processors, beside other work, in a release build"]
fn slow_single_faults_are_named() {
    let kinds: Vec<(u64, &Fault)> = (0..).zip(&FAULTS).collect();
    let found = side_by_side(&kinds, Diagnosed::of);
    println!("| device | kinds | named | largest error over the right model's |\n|---|--:|--:|--:|");
    for device in &DEVICES {
        let own = kinds.iter().zip(&found).filter(|((_, fault), _)| fault.device == device.name);
        let own: Vec<&Diagnosed> = own.filter_map(|(_, found)| found.as_ref()).collect();
        let (kinds, named) = (own.len() as u64, own.iter().map(|found| found.named).sum::<u64>());
        let largest = own.iter().map(|found| found.error_over_right).fold(f64::NAN, f64::max);
        println!("| {} | {kinds} | {named} of {} | {largest:.2} |", device.name, RECORDINGS * kinds);
    }
    let found: Vec<&Diagnosed> = found.iter().flatten().collect();
    let named: u64 = found.iter().map(|found| found.named).sum();
    let all = RECORDINGS * found.len() as u64;
    let pasted: Vec<f64> =
        (found.iter().map(|found| found.error_over_right)).filter(|ratio| !ratio.is_nan()).collect();
    let mended = pasted.iter().filter(|ratio| **ratio <= MENDED).count();
    println!(
        "{named} of {all} named; of {mended} of {} kinds the error is within {MENDED} of that of the right model",
        pasted.len()
    );
    assert!(named as f64 >= 0.9 * all as f64 && mended as f64 >= 0.9 * pasted.len() as f64);
}
