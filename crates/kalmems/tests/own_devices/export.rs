//! What `kalmems export` writes: the same bytes each time, a Rust module and a C source that compile, and the estimate
//! of the filter that they were made from.

mod c;

use kalmems::config::Experiment;
use kalmems::estimate::SegmentEstimate;
use kalmems::export::{ExportError, ExportRequest, Exported, SourceDigits, SourceLanguage, write_export};
use kalmems::progress::Silent;
use kalmems::recording::SampledRecording;
use kalmems::results::{Output, OutputError, Work};
use kalmems::rigs::published;
use kalmems::source::source;
use std::fs;
use std::num::NonZeroU32;
use std::path::{Path, PathBuf};

// A module that the firmware is made of.
#[rustfmt::skip]
#[allow(dead_code, clippy::all, clippy::pedantic)]
#[path = "../../../../firmware/src/generated/threshold.rs"]
mod threshold;

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

pub fn example(path: &str) -> Experiment {
    published().load(&root().join("examples").join(path)).unwrap()
}

const SCANNER: &str = "shared_scanner/microcontroller.toml";
const THRESHOLD: &str = "threshold_scanner/as_published.toml";

fn export(experiment: &Experiment, request: &ExportRequest) -> Result<Exported, ExportError> {
    source(published(), experiment, request)
}

pub fn request(target: SourceLanguage, filter: &str) -> ExportRequest {
    ExportRequest {
        target,
        filter: filter.to_owned(),
        interval_s: None,
        update_every: NonZeroU32::MIN,
        samples: 0,
        adjustable: Vec::new(),
        digits: SourceDigits::AsNeeded,
        verify: false,
        notes: Vec::new(),
    }
}

fn file<'a>(exported: &'a Exported, name: &str) -> &'a str {
    &exported.files.iter().find(|(found, _)| found == name).unwrap().1
}

/// `.ci/firmware generate` makes them anew.
#[test]
fn the_firmware_holds_what_the_examples_give() {
    let wanted = ExportRequest { samples: 3000, ..request(SourceLanguage::Rust, "Hybrid") };
    let hybrid = export(&example(THRESHOLD), &wanted).unwrap();
    for (exported, name, kept) in
        [(&hybrid, "filter.rs", "threshold.rs"), (&hybrid, "samples.rs", "threshold_samples.rs")]
    {
        let kept = root().join("firmware/src/generated").join(kept);
        let same = fs::read_to_string(&kept).unwrap() == file(exported, name);
        assert!(same, "{} is not what the example gives: run `.ci/firmware generate`", kept.display());
    }
    let text = export(&example(SCANNER), &request(SourceLanguage::C, "Euler EKF")).unwrap();
    for name in ["scanner_filter.c", "scanner_filter.h"] {
        let kept = root().join("firmware/src/generated/text").join(name);
        assert!(
            fs::read_to_string(&kept).unwrap() == file(&text, name),
            "{} is not what the equations give: run `.ci/firmware generate`",
            kept.display()
        );
    }
}

/// The estimates of the first recording of an example.
fn estimated(experiment: &Experiment) -> (SampledRecording, SegmentEstimate) {
    let rig = published().rig(experiment).unwrap();
    let index = rig.wanted(experiment).unwrap()[0];
    let file = experiment.resolve(&experiment.recording(index).unwrap().file);
    let recording = SampledRecording::read(&file, &rig.layout(experiment, index).unwrap()).unwrap();
    let mut estimates = rig.estimate(experiment, index, &recording, &Silent).unwrap();
    (recording, estimates.remove(0))
}

/// The largest difference of angles relative to the largest angle, where the sign of the motion may have been mirrored.
fn apart(estimate: &SegmentEstimate, key: &str, angle: &[f64], from: usize) -> f64 {
    let trajectory = estimate.trajectories.iter().find(|t| t.key == key).unwrap();
    let sign = if trajectory.mirrored { -1.0 } else { 1.0 };
    let theirs = &trajectory.states[0].mean;
    assert_eq!(theirs.len(), angle.len());
    let size = theirs.iter().fold(0.0_f64, |size, x| size.max(x.abs()));
    let pairs = theirs.iter().zip(angle).skip(from);
    pairs.map(|(x, y)| (sign * x - y).abs()).fold(0.0, f64::max) / size
}

/// The program fits the signal's offset on the way and integrates by Runge and Kutta; the exported filter knows the
/// offset and steps exactly: less apart than a tenth of what either is from the truth, 2 mrad.
#[test]
fn an_exported_threshold_filter_estimates_nearly_what_the_program_does() {
    let (recording, estimate) = estimated(&example(THRESHOLD));
    let signal = recording.column("cap_V").unwrap().of(&recording.segments()[0]);
    let mut filter = threshold::Estimator::<f64>::new();
    let mut angle = Vec::new();
    for (k, volts) in signal.iter().enumerate() {
        filter.step(*volts, k == 0).unwrap();
        angle.push(filter.mean()[0] * threshold::ANGLE_UNIT_RAD);
    }
    let counts = estimate.trajectories.iter().find(|t| t.key == "hybrid").unwrap().counts;
    println!("crossings {} of {}", filter.crossings(), counts.crossings);
    let found = apart(&estimate, "hybrid", &angle, 0);
    println!("threshold: {found:e} of the largest angle");
    assert_eq!(filter.crossings() as usize, counts.crossings);
    assert!(found < 2e-3, "{found:e}");
}

#[test]
fn a_filter_that_cannot_be_exported_is_refused_with_the_reason() {
    let why = |file: &str, request: &ExportRequest| export(&example(file), request).unwrap_err().to_string();
    let scanner = "shared_scanner/experiment.toml";
    for (file, request, expected) in [
        (
            scanner,
            request(SourceLanguage::Rust, "no such"),
            "the experiment has: `Model alone`, `EKF`, `UKF`",
        ),
        (
            scanner,
            request(SourceLanguage::C, "UKF"),
            "the methods `ekf`, `euler_ekf`, `steady_state` and `luenberger`",
        ),
        (THRESHOLD, request(SourceLanguage::Rust, "Hybrid as printed"), "the variant `full`"),
        (THRESHOLD, request(SourceLanguage::Rust, "Hybrid, resonance tracked"), "leave `states` out"),
        (
            THRESHOLD,
            ExportRequest {
                update_every: NonZeroU32::new(2).unwrap(),
                ..request(SourceLanguage::C, "Hybrid")
            },
            "needs every sample",
        ),
        (
            THRESHOLD,
            ExportRequest {
                update_every: NonZeroU32::new(2).unwrap(),
                ..request(SourceLanguage::Rust, "Hybrid")
            },
            "needs every sample",
        ),
        (
            scanner,
            ExportRequest { samples: 30_000, ..request(SourceLanguage::Rust, "EKF") },
            "of the first 30000 samples only 24000 have all inputs and measurements",
        ),
        (
            scanner,
            ExportRequest { samples: 3, interval_s: Some(1e-6), ..request(SourceLanguage::Rust, "EKF") },
            "leave `--rate` or `--samples` out",
        ),
        (
            "piston_mirror/experiment.toml",
            ExportRequest { interval_s: Some(5e-5), ..request(SourceLanguage::Rust, "Five states") },
            "its source has no recording to take its start from",
        ),
    ] {
        let found = why(file, &request);
        assert!(found.contains(expected), "{file}: {found}");
    }
}

#[test]
fn an_export_is_whole_and_replaces_no_other() {
    let experiment = example(SCANNER);
    let folder = tempfile::tempdir().unwrap();
    let target = folder.path().join("filter");
    let write = |filter: &str, force: bool| {
        let exported = export(&experiment, &request(SourceLanguage::C, filter)).unwrap();
        let output = Output::begin(&target, &Work::named("export", filter).forced(force))?;
        write_export(&exported, &output).unwrap();
        output.commit()
    };
    write("EKF", false).unwrap();
    let read = |name: &str| fs::read(target.join(name)).unwrap();
    let first = ["scanner_filter.c", "scanner_filter.h", "run.toml"].map(read);
    write("EKF", false).unwrap();
    assert!(first == ["scanner_filter.c", "scanner_filter.h", "run.toml"].map(read));
    assert!(matches!(write("Euler EKF", false), Err(OutputError::OtherWork { .. })));
    write("Euler EKF", true).unwrap();
    assert!(first[0] != read("scanner_filter.c"));
    let source = String::from_utf8(read("scanner_filter.c")).unwrap();
    assert!(source.contains(env!("CARGO_PKG_VERSION")) && source.contains("sha256") && !source.contains('@'));
}

/// Compiles C without a warning, with these further arguments, and runs it; `None` without a compiler.
pub fn compiled(files: &[(String, String)], folder: &Path, flags: &[&str]) -> Option<std::process::Output> {
    use std::process::Command;
    for (name, content) in files {
        fs::write(folder.join(name), content).unwrap();
    }
    let sources: Vec<&String> = files
        .iter()
        .map(|(name, _)| name)
        .filter(|name| Path::new(name).extension().is_some_and(|e| e == "c"))
        .collect();
    let warnings =
        ["-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Wdouble-promotion", "-Wshadow", "-Werror"];
    let made = Command::new("gcc")
        .current_dir(folder)
        .args(["-std=c99", "-O1"])
        .args(warnings)
        .args(flags)
        .args(["-o", "program"])
        .args(&sources)
        .output();
    let Ok(made) = made else {
        println!("skipped: there is no gcc");
        return None;
    };
    assert!(made.status.success(), "{}", String::from_utf8_lossy(&made.stderr));
    Some(Command::new(folder.join("program")).stdin(std::process::Stdio::null()).output().unwrap())
}

#[test]
fn a_filter_of_equations_tests_itself_against_the_library() {
    let experiment = example(SCANNER);
    let expanded = kalmems::expand::expand(published(), &experiment).unwrap();
    let own = published().parse(&expanded.text, experiment.path()).unwrap();
    for filter in own.estimate.as_ref().unwrap().filters.iter().map(|filter| filter.name.to_string()) {
        let wanted = ExportRequest {
            samples: 300,
            adjustable: vec!["stiffness".to_owned()],
            ..request(SourceLanguage::C, &filter)
        };
        let exported = export(&own, &wanted).unwrap();
        let folder = tempfile::tempdir().unwrap();
        if let Some(run) = compiled(&exported.files, folder.path(), &[]) {
            assert!(run.status.success(), "{filter}: {}", String::from_utf8_lossy(&run.stderr));
        }
        // Another source of the same bytes.
        assert_eq!(export(&own, &wanted).unwrap().files, exported.files);
        let rust = export(&own, &ExportRequest { target: SourceLanguage::Rust, ..wanted }).unwrap();
        assert!(rust.files.iter().any(|(name, _)| name == "scanner_filter.rs"));
    }
}

#[test]
fn several_steps_of_a_sample_are_as_many_predictions() {
    let experiment = example("tuning_fork/experiment.toml");
    let text = experiment.text().replacen("method = \"ekf\"", "method = \"ekf\"\nsteps = 6", 1);
    let experiment = published().parse(&text, experiment.path()).unwrap();
    let wanted = ExportRequest { samples: 300, ..request(SourceLanguage::C, "EKF") };
    let exported = export(&experiment, &wanted).unwrap();
    let header = exported.files.iter().find(|(name, _)| name == "tuning_fork.h").unwrap();
    assert!(header.1.contains("in 6 parts by"), "{}", header.1);
    // Rehearsed and tested in these parts: numbers of 32 bits alone would not suffice.
    assert!(header.1.contains("64 bits"), "{}", header.1);
    self_tested(&experiment, (&wanted, exported), ("tuning_fork", 1e-5));
    let refused = export(
        &experiment,
        &ExportRequest { adjustable: vec!["q".to_owned()], ..request(SourceLanguage::C, "EKF") },
    );
    assert!(refused.unwrap_err().to_string().contains("unknown word `q`"));
}

/// The program that comes with a source reads a sample in each line, and takes the predictions that one needs.
#[test]
fn the_program_of_a_source_estimates_what_the_library_does_where_a_sample_takes_several_predictions() {
    for (path, key, measured) in [
        ("comb_resonator/experiment.toml", "ekf", ["drive", "signal"]),
        ("thermal_mirror/experiment.toml", "ekf", ["drive", "bridge"]),
    ] {
        // What a source does not do: with the numbers of the thermal mirror the filter loses the signal, and would be started again.
        let keys = "method = \"ekf\"\ngate = false\nsteps = 3";
        let text = example(path).text().replacen("method = \"ekf\"", keys, 1);
        let experiment = published().parse(&text, example(path).path()).unwrap();
        let exported = export(&experiment, &request(SourceLanguage::C, "EKF")).unwrap();
        let folder = tempfile::tempdir().unwrap();
        if compiled(&exported.files, folder.path(), &[]).is_none() {
            return;
        }
        let main = file(&exported, "main.c");
        let columns = main.split("each the numbers ").nth(1).unwrap().split(", and writes").next().unwrap();
        let (recording, estimate) = estimated(&experiment);
        let described = experiment.recording(0).unwrap();
        let [drive, signal] = measured.map(|meaning| {
            let (_, column) = described.channels.iter().find(|(own, _)| *own == meaning).unwrap();
            &recording.column(column).unwrap().values
        });
        let mut input = String::new();
        for k in 3..signal.len() - 2 {
            // The middle of an interval by the polynomial of fifth order through the samples around it.
            let pair = |away: usize| drive[k - 1 - away] + drive[k + away];
            let middle = (150.0 * pair(0) - 25.0 * pair(1) + 3.0 * pair(2)) / 256.0;
            for column in columns.split(", ") {
                let value = match column {
                    start if start.ends_with("_start") => drive[k - 1],
                    middles if middles.ends_with("_middle") => middle,
                    end if end.ends_with("_end") => drive[k],
                    _ => signal[k],
                };
                input += &format!("{value:e} ");
            }
            input.push('\n');
        }
        let given = folder.path().join("samples");
        fs::write(&given, input).unwrap();
        let program = std::process::Command::new(folder.path().join("program"));
        let ran = { program }.stdin(fs::File::open(given).unwrap()).output().unwrap();
        let first: Vec<f64> = (String::from_utf8(ran.stdout).unwrap().lines())
            .map(|line| line.split(' ').next().unwrap().parse().unwrap())
            .collect();
        let trajectory = estimate.trajectories.iter().find(|trajectory| trajectory.key == key).unwrap();
        let mean = &trajectory.states[0].mean;
        assert_eq!(first.len(), mean.len() - 5);
        // Behind the start, where the library has corrected by one sample more.
        let half = mean.len() / 2;
        let size = mean.iter().fold(0.0_f64, |size, x| size.max(x.abs()));
        let pairs = mean[half..mean.len() - 2].iter().zip(&first[half - 3..]);
        let worst = pairs.map(|(theirs, own)| (theirs - own).abs()).fold(0.0, f64::max) / size;
        println!("{path}: {worst:e} of the largest value");
        assert!(worst < 1e-3, "{path}: {worst:e}");
    }
}

/// An oscillator whose passes of a place are recorded, with filters that they correct and filters with a constant gain.
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
v = "-0.02*rate*v - rate^2*x"
[device.equations.measure]
signal = "x/1[mm/V] in V"
[device.equations.events]
pass = "x - place"
[device.equations.noise]
v = "1e-3[m^2/s^3]"
signal = "1e-4[V^2]"
pass = "1e-14[s^2]"
[simulate]
duration = "20 ms"
sampling_rate = "100 kHz"
integration_rate = "200 kHz"
start = { x = "0 m", v = "6.283185307179586 m/s" }
seed = 4
[simulate.drive.constant]
voltage = "0 V"
"#;

const OSCILLATOR_FILTERS: [(&str, &str); 6] = [
    ("told", "method = \"ekf\"\nevents = { pass = { sd = \"2 um\" } }"),
    ("told by Euler", "method = \"euler_ekf\"\nevents = { pass = { sd = \"2 um\" } }"),
    ("settled", "method = \"steady_state\""),
    ("placed", "method = \"luenberger\"\nobserver_bandwidth = \"1 kHz\""),
    ("by its time", "method = \"ekf\"\nevents = { pass = {} }"),
    ("gated", "method = \"ekf\"\nevents = { pass = { sd = \"2 um\", gate = 4 } }"),
];

fn oscillator(folder: &Path) -> Experiment {
    use std::fmt::Write as _;
    let simulated = published().parse(OSCILLATOR, &folder.join("oscillator.toml")).unwrap();
    let simulation = published().rig(&simulated).unwrap().simulate(&simulated).unwrap();
    let mut csv = "time_s,signal_V,pass_ago_s\n".to_owned();
    simulation
        .run(&mut |sample| {
            let [signal, ago] = sample.recorded else { panic!("{:?}", sample.recorded) };
            let ago = if ago.is_finite() { format!("{ago:e}") } else { String::new() };
            writeln!(csv, "{:.9},{signal:e},{ago}", sample.time_s).unwrap();
            std::ops::ControlFlow::Continue(())
        })
        .unwrap();
    fs::write(folder.join("recording.csv"), csv).unwrap();
    let mut text = OSCILLATOR.split("[simulate]").next().unwrap().to_owned()
        + "[[recording]]\nrole = \"test\"\nfile = \"recording.csv\"\nclock = { column = \"time_s\" }\n\
           channels = { signal = \"signal_V\", pass = \"pass_ago_s\" }\n[estimate]\nskip = \"1 ms\"\n";
    for (name, what) in OSCILLATOR_FILTERS {
        write!(
            text,
            "[[estimate.filter]]\nname = \"{name}\"\n{what}\nstart = {{ x = \"20 um\", v = \"6.2 m/s\" }}\n\
             start_sd = {{ x = \"30 um\", v = \"0.1 m/s\" }}\n"
        )
        .unwrap();
    }
    published().parse(&text, &folder.join("oscillator.toml")).unwrap_or_else(|error| panic!("{error}"))
}

/// Compiles an exported filter in C and in Rust and runs its test of itself: C is as near the library as `most` says, relative to the
/// largest value of each state, and Rust within what its own test takes.
fn self_tested(
    experiment: &Experiment,
    (wanted, mut exported): (&ExportRequest, Exported),
    (name, most): (&str, f64),
) {
    let filter = &wanted.filter;
    // The program says how far the source is off.
    let (_, main) = exported.files.iter_mut().find(|(name, _)| name == "main.c").unwrap();
    *main = format!(
        "#include \"{name}_self_test.h\"\n#include <stdio.h>\nint main(void)\n{{\n    float worst;\n    \
         const int passes = {name}_self_test(&worst);\n    printf(\"%g\\n\", (double)worst);\n    return !passes;\n}}\n"
    );
    let made = tempfile::tempdir().unwrap();
    if let Some(run) = compiled(&exported.files, made.path(), &[]) {
        let worst: f64 = String::from_utf8_lossy(&run.stdout).trim().parse().unwrap();
        println!("{filter:?}: C is off by {worst:.1e} of the largest value of a state");
        assert!(run.status.success() && worst < most, "{filter:?}: {worst:e}");
    }
    let rust = export(experiment, &ExportRequest { target: SourceLanguage::Rust, ..wanted.clone() }).unwrap();
    let made = tempfile::tempdir().unwrap();
    for (name, content) in &rust.files {
        fs::write(made.path().join(name), content).unwrap();
    }
    let compiler = std::process::Command::new("rustc")
        .current_dir(made.path())
        .args(["--edition=2024", "-Dwarnings", "-Copt-level=1", "-o", "program", "main.rs"])
        .output()
        .unwrap();
    assert!(compiler.status.success(), "{filter:?}: {}", String::from_utf8_lossy(&compiler.stderr));
    let mut program = std::process::Command::new(made.path().join("program"));
    let run = program.stdin(std::process::Stdio::null()).output().unwrap();
    assert!(run.status.success(), "{filter:?}: {}", String::from_utf8_lossy(&run.stderr));
}

#[test]
fn filters_with_events_and_with_a_constant_gain_test_themselves_against_the_library() {
    let folder = tempfile::tempdir().unwrap();
    let experiment = oscillator(folder.path());
    for (filter, _) in OSCILLATOR_FILTERS.iter().take(4) {
        let wanted = ExportRequest { samples: 900, ..request(SourceLanguage::C, filter) };
        let exported = export(&experiment, &wanted).unwrap();
        let is_told = filter.starts_with("told");
        assert_eq!(file(&exported, "oscillator.h").contains("oscillator_update_pass"), is_told);
        let count = file(&exported, "oscillator_self_test.c").matches("-1.0F}").count();
        // 9 ms are 18 passes.
        assert!(!is_told || (900 - 19..=900 - 17).contains(&count), "{filter}: {count}");
        self_tested(&experiment, (&wanted, exported), ("oscillator", 1e-5));
    }
}

/// Three cycles of the recording tell the start, and the source starts behind the first sample that corrects the filter.
#[test]
fn a_filter_that_takes_its_start_from_the_signal_starts_where_the_recording_tells_it() {
    let experiment = example("piston_mirror/experiment.toml");
    for filter in ["Five states", "Three states"] {
        let wanted = ExportRequest { samples: 900, ..request(SourceLanguage::C, filter) };
        let exported = export(&experiment, &wanted).unwrap();
        assert!(file(&exported, "piston_mirror.c").contains("Its start is the one that the recording tells"));
        // The rate of the amplitude is 0 within its deviation.
        self_tested(&experiment, (&wanted, exported), ("piston_mirror", 1e-3));
    }
}

#[test]
fn events_that_a_source_cannot_have_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let experiment = oscillator(folder.path());
    let refused = |experiment: &Experiment, filter: &str| {
        export(experiment, &request(SourceLanguage::C, filter)).unwrap_err().to_string()
    };
    let said = refused(&experiment, "by its time");
    assert!(said.contains("event `pass`") && said.contains("a constant one by `sd`"), "{said}");
    let said = refused(&experiment, "gated");
    assert!(said.contains("leave `gate` out"), "{said}");
    let detector = "detector = { width = \"60 us\", separation = \"300 us\", threshold = 4 }";
    let text = experiment.to_toml().unwrap().replacen(
        "[estimate]\n",
        &format!("[estimate]\nevents = {{ pass = {{ signal = \"signal\", {detector} }} }}\n"),
        1,
    );
    let shown = published().parse(&text, experiment.path()).unwrap();
    let said = refused(&shown, "told");
    assert!(said.contains("the detector is not part of the exported source"), "{said}");
}
