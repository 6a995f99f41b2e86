//! The C sources: compiled without a warning, and compared with the library and the program.

use super::*;
use kalmems::rigs::published;
use kalmems::simulate::{ComputedRecording, described};
use kalmems_core::Scalar;
use std::ops::ControlFlow;
use std::process::Command;

/// Where to compile, if there is a compiler.
fn compiler_and_folder() -> Option<tempfile::TempDir> {
    if Command::new("cc").arg("--version").output().is_err() {
        println!("SKIPPED: there is no C compiler");
        return None;
    }
    Some(tempfile::tempdir().unwrap())
}

/// What the names of its types and functions begin with.
fn name_of(exported: &Exported) -> &str {
    exported.files[0].0.strip_suffix(".h").unwrap()
}

/// The lines of numbers that a program around the exported source writes.
fn said(folder: &Path, exported: &Exported, main: &str, input: &str) -> Vec<Vec<f64>> {
    let name = name_of(exported);
    fs::create_dir_all(folder).unwrap();
    for (name, content) in &exported.files {
        fs::write(folder.join(name), content).unwrap();
    }
    fs::write(folder.join("main.c"), format!("#include <stdio.h>\n#include \"{name}.h\"\n{main}")).unwrap();
    let compiled = Command::new("cc")
        .args(["-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic", "-O2", "-ffp-contract=off"])
        .args(["-o", "program", "main.c"])
        .arg(format!("{name}.c"))
        .current_dir(folder)
        .output()
        .unwrap();
    assert!(compiled.status.success(), "{}", String::from_utf8_lossy(&compiled.stderr));
    let (given, taken) = (folder.join("input"), folder.join("program"));
    fs::write(&given, input).unwrap();
    let ran = Command::new(taken).stdin(fs::File::open(given).unwrap()).output().unwrap();
    assert!(ran.status.success());
    let text = String::from_utf8(ran.stdout).unwrap();
    text.lines().map(|l| l.split(' ').map(|x| x.parse().unwrap()).collect()).collect()
}

/// What a program around the threshold scanner's filter says after each of the signals: mean, variances, how many
/// crossings there were and whether it was taken.
fn threshold_said(folder: &Path, exported: &Exported, signal: &[f64]) -> Vec<Vec<f64>> {
    let name = name_of(exported);
    let main = format!(
        "int main(void)\n{{\n    static {name}_t filter;\n    float signal;\n    int taken, first = 1;\n    \
         {name}_start(&filter);\n    while (scanf(\"%f\", &signal) == 1) {{\n        \
         taken = first ? {name}_begin(&filter, signal) : {name}_step(&filter, signal);\n        first = 0;\n        \
         printf(\"%.9g %.9g %.9g %.9g %u %d\\n\", (double)filter.angle, (double)filter.rate, (double)filter.p00, \
         (double)filter.p11, (unsigned)filter.crossings, taken);\n    }}\n    return 0;\n}}\n"
    );
    let input: Vec<String> = signal.iter().map(|volts| format!("{volts:e}\n")).collect();
    said(folder, exported, &main, &input.concat())
}

/// The same of the library.
fn threshold_run<T: Scalar + Into<f64>>(signal: &[f64]) -> Vec<[f64; 6]> {
    let mut filter = threshold::Estimator::<T>::new();
    let one = |(k, volts): (usize, &f64)| {
        #[allow(clippy::cast_possible_truncation)] // as the C source has it
        let taken = filter.step(T::of(f64::from(*volts as f32)), k == 0).is_ok();
        let (mean, p) = (filter.mean(), filter.covariance());
        let [angle, rate, p00, p11] = [mean[0], mean[1], p.get(0, 0), p.get(1, 1)].map(Into::into);
        [angle, rate, p00, p11, f64::from(filter.crossings()), f64::from(u8::from(taken))]
    };
    signal.iter().enumerate().map(one).collect()
}

/// Over the whole recording, with a gap of 50 samples in it.
#[test]
fn the_c_source_of_the_threshold_chain_agrees_with_the_library() {
    let Some(folder) = compiler_and_folder() else { return };
    let experiment = example(THRESHOLD);
    let (recording, _) = estimated(&experiment);
    let mut signal = recording.column("cap_V").unwrap().of(&recording.segments()[0]).to_vec();
    signal[4000..4050].fill(f64::NAN);
    let exported = export(&experiment, &request(SourceLanguage::C, "Hybrid")).unwrap();
    let theirs = threshold_said(&folder.path().join("source"), &exported, &signal);
    for (name, ours) in [("f32", threshold_run::<f32>(&signal)), ("f64", threshold_run::<f64>(&signal))] {
        assert_eq!(theirs.len(), ours.len());
        for i in 0..4 {
            let size = ours.iter().fold(0.0_f64, |size, said| size.max(said[i].abs()));
            let worst = ours.iter().zip(&theirs).map(|(a, b)| (a[i] - b[i]).abs()).fold(0.0, f64::max) / size;
            println!("{name}, quantity {i}: {worst:e}");
            assert!(worst < 1e-5, "{name}, quantity {i}: {worst:e}");
        }
        assert!(ours.iter().zip(&theirs).all(|(a, b)| a[4] == b[4] && a[5] == b[5]));
        let refused = ours.iter().filter(|said| said[5] == 0.0).count();
        assert_eq!((refused, ours.last().unwrap()[4] > 20.0), (50, true));
    }
}

/// Either curve, either sign, with and without a gate, on simulated decays: as near to the truth as what the program
/// estimates, which fits the signal's offset on the way where the exported filter knows it, and far nearer to that.
#[test]
fn the_c_source_of_any_threshold_chain_is_as_good_as_the_program() {
    let Some(folder) = compiler_and_folder() else { return };
    for (shape, gain, gate) in [
        ("logistic", "2.82", ""),
        ("gaussian", "1.5", "gate = 4"),
        ("gaussian", "-1.5", ""),
        ("logistic", "-2.82", "gate = 4"),
    ] {
        let text = format!(
            r#"
name = "decay"
[device.threshold_scanner.resonator]
natural_frequency = "624.6 Hz"
damping_ratio = 0.0066
[device.threshold_scanner.comb]
threshold_angle = "3.7 mrad"
shape = "{shape}"
gain = "{gain} mV s/rad"
steepness = "76 1/rad"
[device.threshold_scanner.readout]
feedback_resistance = "10 Mohm"
bias = "10 V"
offset = "5 mV"
feedthrough_capacitance = "0 F"
noise_variance = "1.89225e-3 V^2"
[simulate]
duration = "24 ms"
sampling_rate = "500 kHz"
integration_rate = "500 kHz"
start = {{ angle = "-0.105 rad", rate = "420 rad/s" }}
seed = 1
[simulate.drive.constant]
voltage = "0 V"
[estimate]
skip = "0 s"
crossings = {{ width = "30 us", separation = "300 us", threshold = 4 }}
process_noise = {{ angular_acceleration = "4758 rad^2/s^3" }}
[[estimate.filter]]
name = "Hybrid"
method = "ekf"
threshold = {{ {gate} }}
start = {{ angle = "-0.102 rad", rate = "413 rad/s" }}
start_sd = {{ angle = "5 mrad", rate = "20 rad/s" }}
"#
        );
        let written = published().parse(&text, Path::new("decay.toml")).unwrap_or_else(|e| panic!("{e}"));
        let rig = published().rig(&written).unwrap();
        let simulation = rig.simulate(&written).unwrap();
        let experiment = described(&written, simulation.as_ref());
        let simulated = ComputedRecording::of(simulation.as_ref(), &Silent).unwrap();
        let recording = simulated.recorded(&rig.layout(&experiment, 0).unwrap()).unwrap();
        let estimate = rig.estimate(&experiment, 0, &recording, &Silent).unwrap().remove(0);
        let request = ExportRequest { interval_s: Some(2e-6), ..request(SourceLanguage::C, "Hybrid") };
        let exported = export(&experiment, &request).unwrap();
        let signal = recording.column("cap_V").unwrap().of(&recording.segments()[0]);
        let folder = folder.path().join(format!("{shape}{gain}"));
        let theirs = threshold_said(&folder, &exported, signal);
        let mut truth = Vec::new();
        let mut keep = |angle: f64| {
            truth.push(angle);
            ControlFlow::Continue(())
        };
        simulation.run(&mut |sample| keep(sample.truth[0])).unwrap();
        let trajectory = &estimate.trajectories[0];
        let rms = |of: &dyn Fn(usize) -> f64| {
            ((0..truth.len()).map(|k| of(k).powi(2)).sum::<f64>() / truth.len() as f64).sqrt()
        };
        // The unit is 1/N_θ.
        let (here, there) = (|k: usize| theirs[k][0] / 76.0, |k: usize| trajectory.states[0].mean[k]);
        let [ours, program, apart] =
            [rms(&|k| here(k) - truth[k]), rms(&|k| there(k) - truth[k]), rms(&|k| here(k) - there(k))];
        let crossings = theirs.last().unwrap()[4];
        println!(
            "{shape} {gain} {gate}: errors {ours:e} and {program:e}, apart {apart:e}, {crossings} crossings"
        );
        assert!(crossings == trajectory.counts.crossings as f64);
        assert!(
            !trajectory.mirrored && ours < 1.05 * program && apart < 0.2 * program,
            "{shape} {gain} {gate}"
        );
    }
}

/// For a Cortex-M as well, without a loop that never runs, and not where a compiler may take it that each number is finite or may group sums anew.
#[test]
fn the_c_sources_compile_for_a_microcontroller_and_refuse_arithmetic_that_knows_no_gap() {
    let Some(folder) = compiler_and_folder() else { return };
    let compiler = |program: &str, name: &str, flags: &[&str]| {
        let warnings = ["-std=c99", "-O2", "-Wall", "-Wextra", "-Wpedantic", "-Wdouble-promotion", "-Werror"];
        Command::new(program)
            .current_dir(folder.path())
            .args(warnings)
            .args(flags)
            .args(["-c", "-o", "object.o", &format!("{name}.c")])
            .output()
    };
    for (example_of, filter) in [(THRESHOLD, "Hybrid"), (SCANNER, "EKF")] {
        let exported = export(&example(example_of), &request(SourceLanguage::C, filter)).unwrap();
        let name = name_of(&exported);
        for (file, content) in &exported.files {
            fs::write(folder.path().join(file), content).unwrap();
        }
        for flags in [
            &["-ffast-math"][..],
            &["-ffinite-math-only"],
            &["-fassociative-math", "-fno-signed-zeros", "-fno-trapping-math"],
        ] {
            let refused = compiler("gcc", name, flags);
            let Ok(refused) = refused else { continue };
            let said = String::from_utf8_lossy(&refused.stderr);
            assert!(!refused.status.success() && said.contains("without -ffast-math"), "{flags:?}: {said}");
        }
        for processor in ["cortex-m0plus", "cortex-m4", "cortex-m7"] {
            let flags = [format!("-mcpu={processor}"), "-mthumb".to_owned()];
            let Ok(made) = compiler("arm-none-eabi-gcc", name, &flags.each_ref().map(String::as_str)) else {
                println!("SKIPPED: there is no arm-none-eabi-gcc");
                break;
            };
            assert!(made.status.success(), "{processor}: {}", String::from_utf8_lossy(&made.stderr));
        }
    }
}

/// What cppcheck finds in the C sources is in the list of deviations from MISRA C, with its reason.
#[test]
fn the_c_sources_keep_to_misra_but_for_the_listed_rules() {
    let Some(folder) = compiler_and_folder() else { return };
    let decision = fs::read_to_string(root().join("decisions/misra_deviations.md")).unwrap();
    let rows = decision.lines().filter(|line| line.starts_with("| ")).skip(1);
    let listed: Vec<&str> =
        rows.flat_map(|row| row.split('|').nth(1).unwrap().split(',')).map(str::trim).collect();
    assert!(listed.contains(&"19.2") && !listed.contains(&"17.2"));
    for (example_of, filter) in [
        (THRESHOLD, "Hybrid"),
        (SCANNER, "EKF"),
        ("accelerometer/experiment.toml", "Settled gain"),
        ("piston_mirror/experiment.toml", "Five states"),
        ("comb_resonator/experiment.toml", "EKF"),
    ] {
        let exported = export(&example(example_of), &request(SourceLanguage::C, filter)).unwrap();
        let name = name_of(&exported);
        for (file, content) in &exported.files {
            fs::write(folder.path().join(file), content).unwrap();
        }
        let checked = Command::new("cppcheck")
            .args(["--quiet", "--std=c99", "--addon=misra", "--enable=style", &format!("{name}.c")])
            .current_dir(folder.path())
            .output();
        let Ok(checked) = checked else {
            println!("SKIPPED: there is no cppcheck");
            return;
        };
        let found = String::from_utf8_lossy(&checked.stderr);
        assert!(found.contains("misra-c2012-15.5"), "the rules of MISRA were not checked: {found}");
        for line in found.lines() {
            if let Some((_, rule)) = line.split_once("[misra-c2012-") {
                assert!(listed.contains(&rule.trim_end_matches(']')), "{example_of}: {line}");
            }
        }
    }
}
