//! The lock-in of a device of one's own, whose line follows from the equations.

use crate::parts::same_bits_in_a_stream;
use kalmems::config::Experiment;
use kalmems::progress::Silent;
use kalmems::recording::SampledRecording;
use kalmems::results::Metrics;
use kalmems::rigs::published;
use kalmems::workflow;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

fn example(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples").join(name).join("experiment.toml")
}

/// An example with a lock-in in the place of its filters, where its table says which state oscillates.
fn with_lock_in(name: &str, oscillation: &str) -> Result<Experiment, String> {
    let text = std::fs::read_to_string(example(name)).unwrap();
    let (device, _) = text.split_once("[[estimate.filter]]").unwrap();
    let text = format!(
        "{device}[[estimate.filter]]\nname = \"lock-in\"\nmethod = \"lock_in\"\n\n[device.equations.oscillation]\n{oscillation}\n"
    );
    let experiment = published().parse(&text, &example(name)).map_err(|error| error.to_string())?;
    let rig = published().rig(&experiment).map_err(|error| error.to_string())?;
    rig.wanted(&experiment).map_err(|error| error.to_string())?;
    Ok(experiment)
}

/// The comb swings by 4.5 µm about a place that the mean square of its voltage holds, 64 nm from rest, and its amplifier has a pole that
/// takes 3 % of the line and turns it by 14°. From 24 ms on, four time constants after the drive was switched on, what is left is the third
/// harmonic of the hardening spring, h·A³/32 = 1.8 nm, of which a lock-in knows nothing, and what the noise, 5 nm of a sample, leaves of
/// the 40 samples of a cycle.
#[test]
fn a_lock_in_finds_amplitude_level_and_phase_behind_a_pole_of_the_amplifier() {
    let text = with_lock_in("comb_resonator", "of = \"x\"").unwrap().to_toml().unwrap();
    // The time constant of the amplifier as it was simulated: the file states 4 us, which would turn the motion by 0.3°.
    let text = text.replace("skip = \"6 ms\"", "skip = \"24 ms\"").replace("\"4 us\"", "\"4.1 us\"");
    let experiment = published().parse(&text, &example("comb_resonator")).unwrap();
    let outcome = workflow::estimate(published(), &experiment, &Silent).unwrap_or_else(|e| panic!("{e}"));
    let metrics = Metrics::of(&outcome);
    let lock_in = metrics.estimators().next().unwrap();
    let error = lock_in.values["x"].rmse;
    println!("{error:e}");
    assert!(error < 5e-9, "{error:e}");
}

#[test]
fn a_lock_in_gives_the_same_bits_in_a_stream_as_over_a_whole_recording() {
    let file = example("comb_resonator");
    let text = with_lock_in("comb_resonator", "of = \"x\"").unwrap().to_toml().unwrap()
        + "\n[stream]\nrate = \"400 kHz\"\n[stream.input.text]\ncolumns = [\"time_s\", \"drive_V\", \"signal_V\"]\n";
    let experiment = published().parse(&text, &file).unwrap();
    let rig = published().rig(&experiment).unwrap();
    let path = experiment.resolve(&experiment.recording(0).unwrap().file);
    let recording = SampledRecording::read(&path, &rig.layout(&experiment, 0).unwrap()).unwrap();
    same_bits_in_a_stream(&experiment, &recording, (&std::fs::read(&path).unwrap(), 4000));
}

#[test]
fn a_device_without_what_a_lock_in_needs_is_refused_with_the_reason() {
    let mut told = String::new();
    for (what, name, oscillation) in [
        ("a state that is not there", "comb_resonator", "of = \"y\""),
        ("a state whose rate is no state", "comb_resonator", "of = \"v\""),
        ("a harmonic that is not read", "comb_resonator", "of = \"x\"\nharmonic = 3"),
        ("feedthrough of the drive", "tuning_fork", "of = \"x\""),
        ("a measurement of other states too", "thermal_mirror", "of = \"angle\""),
    ] {
        let why = with_lock_in(name, oscillation).expect_err(what);
        let why = why.rsplit_once("experiment.toml").unwrap().1;
        writeln!(told, "{what}:\n{why}\n").unwrap();
    }
    let text = std::fs::read_to_string(example("comb_resonator")).unwrap();
    let bent =
        "time = \"amplifier_time\" }, squared = { of = \"output^2/1[V] in V\", time = \"amplifier_time\" } }";
    let text_of_bent =
        text.replace("time = \"amplifier_time\" } }", bent).replace("\"output in V\"", "\"squared in V\"");
    let (device, _) = text_of_bent.split_once("[[estimate.filter]]").unwrap();
    let claims = "method = \"lock_in\"\n\n[device.equations.oscillation]\nof = \"x\"\n";
    let text_of_bent = format!("{device}[[estimate.filter]]\nname = \"lock-in\"\n{claims}");
    let experiment = published().parse(&text_of_bent, &example("comb_resonator")).unwrap();
    let why = published().rig(&experiment).unwrap().wanted(&experiment).unwrap_err().to_string();
    writeln!(told, "a square behind the amplifier:\n{}\n", why.rsplit_once("experiment.toml").unwrap().1)
        .unwrap();
    let (device, _) = text.split_once("[[estimate.filter]]").unwrap();
    let text = format!("{device}[[estimate.filter]]\nname = \"lock-in\"\nmethod = \"lock_in\"\n");
    let experiment = published().parse(&text, &example("comb_resonator")).unwrap();
    let why = published().rig(&experiment).unwrap().wanted(&experiment).unwrap_err().to_string();
    writeln!(told, "no oscillation stated:\n{}", why.rsplit_once("experiment.toml").unwrap().1).unwrap();
    insta::assert_snapshot!(told);
}
