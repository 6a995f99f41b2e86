//! Experiment files: those of the reference recordings, and broken ones with their messages.

use kalmems::applications::ApplicationFile;
use kalmems::applications::{calibration::GyroscopeCalibration, image::Image, spectrum::SpectrumFile};
use kalmems::config::{Clock, Experiment, Recording};
use kalmems::rigs::published;
use std::collections::BTreeSet;
use std::fs;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};

const SETS: [&str; 6] = [
    "accel-open-loop-1g",
    "piston-nominal",
    "shared-scanner",
    "stage-room",
    "stage-sweep",
    "threshold-nominal",
];

const SIMULATION: &str = "../../examples/shared_scanner/simulation.toml";

fn file(set: &str) -> PathBuf {
    Path::new("tests/experiments").join(set).with_extension("toml")
}

fn load(set: &str) -> Experiment {
    published().load(&file(set)).unwrap_or_else(|e| panic!("{e}"))
}

fn broken() -> BTreeSet<PathBuf> {
    let entries = fs::read_dir("tests/experiments/broken").unwrap();
    entries.map(|e| e.unwrap().path()).filter(|p| p.extension().is_some_and(|e| e == "toml")).collect()
}

#[test]
fn every_reference_set_can_be_described() {
    for set in SETS {
        assert_eq!(load(set).name.as_str(), set);
    }
}

#[test]
fn written_out_and_read_again_is_the_same() {
    for set in SETS {
        let experiment = load(set);
        let text = experiment.to_toml().unwrap();
        let again = published().parse(&text, &file(set)).unwrap_or_else(|e| panic!("{e}\n{text}"));
        assert_eq!(again, experiment);
        assert_eq!(again.to_toml().unwrap(), text);
    }
}

/// A simulation needs no recording; what is left out of it is written out.
#[test]
fn a_simulation_alone_is_an_experiment() {
    let path = Path::new(SIMULATION);
    let experiment = published().load(path).unwrap_or_else(|e| panic!("{e}"));
    assert!(experiment.recordings.is_empty());
    let text = experiment.to_toml().unwrap();
    assert!(text.contains("noise = true") && text.contains("seed = 1"), "{text}");
    assert_eq!(published().parse(&text, path).unwrap(), experiment);
    let simulate = experiment.simulate.unwrap();
    assert_eq!((simulate.samples(), simulate.steps_per_sample()), (60_001, 10));
}

#[test]
fn the_written_form_keeps_the_words_of_the_file() {
    insta::assert_snapshot!(load("shared-scanner").to_toml().unwrap());
}

#[test]
fn every_broken_file_is_refused_with_the_reason() {
    let mut settings = insta::Settings::clone_current();
    settings.set_snapshot_path("../experiments/broken/messages");
    settings.set_prepend_module_to_snapshot(false);
    settings.set_omit_expression(true);
    settings.bind(|| {
        for path in broken() {
            let message = match published().load(&path) {
                Ok(_) => panic!("{} was accepted", path.display()),
                Err(e) => e.to_string(),
            };
            assert!(message.starts_with(&path.display().to_string()), "{message}");
            insta::assert_snapshot!(path.file_stem().unwrap().to_str().unwrap(), message);
        }
    });
}

#[test]
fn the_schema_accepts_what_is_right_and_refuses_what_is_broken() {
    let mut schemas = boon::Schemas::new();
    let mut compiler = boon::Compiler::new();
    compiler.add_resource("experiment.json", published().schema()).unwrap();
    let compiled = compiler.compile("experiment.json", &mut schemas).unwrap();
    let json = |path: &Path| {
        let table: toml::Table = toml::from_str(&fs::read_to_string(path).unwrap()).unwrap();
        serde_json::to_value(table).unwrap()
    };
    for set in SETS {
        schemas.validate(&json(&file(set)), compiled).unwrap_or_else(|e| panic!("{set}: {e:#}"));
    }
    schemas.validate(&json(Path::new(SIMULATION)), compiled).unwrap_or_else(|e| panic!("{e:#}"));
    // A noise that is left out is found in the recording.
    let mut without_noise = json(Path::new(SIMULATION));
    let device = without_noise["device"].as_object_mut().unwrap().values_mut().next().unwrap();
    device["readout"].as_object_mut().unwrap().remove("noise_variance").unwrap();
    schemas.validate(&without_noise, compiled).unwrap_or_else(|e| panic!("{e:#}"));
    // What a schema can know: keys, words, types and counts. Dimensions are checked when the file is read.
    for name in [
        "unknown_key_top",
        "unknown_key_resonator",
        "unknown_key_clock",
        "unknown_device",
        "unknown_role",
        "two_devices",
        "missing_key",
        "missing_file",
        "quantity_not_text",
        "plain_number",
        "nan_value",
        "empty_recordings",
        "empty_channels",
        "clock_with_neither",
        "bad_name",
        "constant_capacitance",
        "no_recording",
        "simulate_unknown_drive",
        "simulate_two_drives",
        "simulate_no_drive",
        "simulate_negative_seed",
        "simulate_adc_bits",
    ] {
        let broken = json(&file(&format!("broken/{name}")));
        assert!(schemas.validate(&broken, compiled).is_err(), "{name} passes the schema");
    }
}

/// A second validator with a schema. Its parts are compiled once, however many files it is asked about.
struct Validator {
    compiler: boon::Compiler,
    schemas: boon::Schemas,
}

impl Validator {
    fn of(schema: &serde_json::Value) -> Self {
        let mut compiler = boon::Compiler::new();
        compiler.add_resource("schema.json", schema.clone()).unwrap();
        Self { compiler, schemas: boon::Schemas::new() }
    }

    /// What it makes of a file by the part of the schema at a JSON pointer; the whole is at "".
    fn accepts(&mut self, pointer: &str, file: &serde_json::Value) -> bool {
        let place = format!("schema.json#{pointer}");
        let compiled =
            self.compiler.compile(&place, &mut self.schemas).unwrap_or_else(|e| panic!("{place}: {e}"));
        self.schemas.validate(file, compiled).inspect_err(|e| println!("{e}")).is_ok()
    }
}

/// What a second validator makes of a file by a schema.
fn accepts(schema: &serde_json::Value, file: &serde_json::Value) -> bool {
    Validator::of(schema).accepts("", file)
}

fn example(name: &str) -> String {
    fs::read_to_string(Path::new("../../examples/shared_scanner").join(name)).unwrap()
}

fn as_json(toml: &str) -> serde_json::Value {
    serde_json::to_value(toml::from_str::<toml::Table>(toml).unwrap()).unwrap()
}

#[test]
fn the_schemas_of_studies_and_images_accept_the_examples_and_refuse_what_is_broken() {
    let (studies, images) = (kalmems::study::schema(), Image::schema());
    let (study, image) = (example("study.toml"), example("image.toml"));
    assert_eq!((&studies["title"], &images["title"]), (&"A kalmems study".into(), &"A kalmems image".into()));
    assert!(accepts(&studies, &as_json(&study)) && accepts(&images, &as_json(&image)));
    assert!(accepts(&images, &as_json(&example("two_axes_image.toml"))));
    // Words and plain numbers are varied as well.
    let others = "name = \"a\"\nexperiment = \"b.toml\"\n[[vary]]\nkey = \"estimate.filter[0].alpha\"\n\
                  normal = { mean = 0.5, sd = 0.1 }\n[[vary]]\nkey = \"estimate.first_peak\"\nvalues = [\"positive\"]\n";
    assert!(accepts(&studies, &as_json(others)));
    for (schema, text, from, to) in [
        (&studies, &study, "[[vary]]", "[[varied]]"),
        (&studies, &study, "points = 7", "points = 1"),
        (&studies, &study, "points = 7", "points = \"7\""),
        (&studies, &study, "applies_to = \"told\"", "applies_to = \"tolld\""),
        (&studies, &study, "scale = \"log\"", "scale = \"ln\""),
        (&studies, &study, "grid = {", "values = [1]\ngrid = {"),
        (&studies, &study, "experiment =", "# experiment ="),
        (&images, &image, "[intensity]", "[intensities]"),
        (&images, &image, "pixels = 100", "pixels = 1"),
        (&images, &image, "fill = \"neighbours\"", "fill = \"white\""),
        (&images, &image, "search = \"5 deg\"", "search = 5"),
        (&images, &image, "clock = { rate = \"2 MHz\" }", "clock = { }"),
        (&images, &image, "column = \"x_mrad\"", ""),
    ] {
        assert!(text.contains(from), "{from}");
        assert!(!accepts(schema, &as_json(&text.replacen(from, to, 1))), "{to} passes the schema");
    }
    // Each is a schema of its own files alone.
    assert!(!accepts(&studies, &as_json(&image)) && !accepts(&images, &as_json(&study)));
    // A study that varies nothing.
    // A calibration varies nothing but what its filters hold as uncertain.
    assert!(accepts(&studies, &as_json("name = \"a\"\nexperiment = \"b.toml\"")));
}

#[test]
fn the_schema_of_spectra_accepts_the_example_and_refuses_what_is_broken() {
    let text = fs::read_to_string("../../examples/piston_mirror/two_lines_spectrum.toml").unwrap();
    let schema = SpectrumFile::schema();
    assert!(accepts(&schema, &as_json(&text)));
    let recorded = "name = \"a\"\ninterferogram = { file = \"a.csv\", columns = [\"detector_1\"] }\n\
                    path = { laser = { wavenumber = \"15798 1/cm\", samples_per_fringe = 2 } }\n\
                    transform = { apodisation = \"blackman_harris_3\", phase = \"power\" }\n";
    assert!(accepts(&schema, &as_json(recorded)));
    for (text, from, to) in [
        (text.as_str(), "norton_beer_medium", "norton_beer"),
        (&text, "phase = \"none\"", "phase = \"left\""),
        (&text, "[light]", "[interferogram]"),
        (&text, "[path.trajectory]", "[path.positions]"),
        (&text, "apodisation", "apodization"),
        (recorded, "[\"detector_1\"]", "[]"),
        (recorded, "phase = \"power\"", "phase = \"power\", zero_filling = 65"),
        (recorded, "interferogram =", "interferograms ="),
    ] {
        assert!(text.contains(from), "{from}");
        assert!(!accepts(&schema, &as_json(&text.replacen(from, to, 1))), "{to} passes the schema");
    }
}

#[test]
fn the_schema_of_calibrations_accepts_the_examples_and_refuses_what_is_broken() {
    let schema = GyroscopeCalibration::schema();
    let example = |name: &str| fs::read_to_string(Path::new("../../examples/gyroscope").join(name)).unwrap();
    let calibration = example("calibration.toml");
    for text in [&calibration, &example("by_stage.toml"), &example("three_axes.toml")] {
        assert!(accepts(&schema, &as_json(text)));
    }
    for name in ["unit.toml", "table.toml", "motion.toml"] {
        let text = fs::read_to_string(Path::new("../../examples/inertial_unit").join(name)).unwrap();
        assert!(accepts(&schema, &as_json(&text)), "{name}");
        for (from, to) in
            [("gravity =", "gravitation ="), ("axis = \"z\"", "axis = \"w\""), ("order = 2", "order = 7")]
        {
            if text.contains(from) {
                assert!(!accepts(&schema, &as_json(&text.replacen(from, to, 1))), "{to} passes the schema");
            }
        }
    }
    for (from, to) in [
        ("[sensor]", "[gyro]"),
        ("clock_tolerance", "tolerance"),
        ("[[condition.reference]]\nname", "[[condition.references]]\nname"),
        ("clock = \"1 ppm\"", "clock = true"),
        ("distribution = \"rectangular\"", "distribution = \"round\""),
        ("trials = 200000", "trials = 10"),
        ("target_width", "width"),
    ] {
        assert!(calibration.contains(from), "{from}");
        assert!(!accepts(&schema, &as_json(&calibration.replacen(from, to, 1))), "{to} passes the schema");
    }
    // The name that the table of the unit had first.
    let earlier = calibration.replacen("[sensor]", "[gyroscope]", 1);
    assert!(accepts(&schema, &as_json(&earlier)));
    assert!(!accepts(&schema, &as_json(&format!("{earlier}\n[sensor]\nrate = \"8 kHz\"\n"))));
    let neither = &calibration[..calibration.find("[[condition]]").unwrap()];
    assert!(!accepts(&schema, &as_json(neither)));
}

#[test]
fn every_example_experiment_passes_the_schema() {
    let schema = published().schema();
    let folder = fs::read_dir("../../examples/shared_scanner").unwrap();
    let names = folder.map(|entry| entry.unwrap().file_name().into_string().unwrap());
    let experiments: Vec<String> = names
        .filter(|name| Path::new(name).extension().is_some_and(|ending| ending == "toml"))
        .filter(|name| !name.ends_with("image.toml") && name != "study.toml")
        .collect();
    assert!(experiments.len() >= 9, "{experiments:?}");
    let mut validator = Validator::of(&schema);
    for name in experiments {
        assert!(validator.accepts("", &as_json(&example(&name))), "{name}");
    }
}

#[test]
#[ignore = "long: `.ci/run --all` runs it"]
fn long_every_example_in_a_schema_is_accepted_by_it() {
    /// The examples in a schema, each with the pointer to the part that they are of.
    fn examples<'a>(
        value: &'a serde_json::Value,
        pointer: &str,
        found: &mut Vec<(String, &'a serde_json::Value)>,
    ) {
        let own = value.get("examples").and_then(|examples| examples.as_array());
        found.extend(own.into_iter().flatten().map(|example| (pointer.to_owned(), example)));
        match value {
            serde_json::Value::Object(map) => {
                for (key, part) in map {
                    let key = key.replace('~', "~0").replace('/', "~1");
                    examples(part, &format!("{pointer}/{key}"), found);
                }
            }
            serde_json::Value::Array(items) => {
                for (place, part) in items.iter().enumerate() {
                    examples(part, &format!("{pointer}/{place}"), found);
                }
            }
            _ => {}
        }
    }
    for (whole, least) in [
        (published().schema(), 50),
        (kalmems::study::schema(), 8),
        (Image::schema(), 4),
        (SpectrumFile::schema(), 4),
        (GyroscopeCalibration::schema(), 12),
    ] {
        let (mut found, mut validator) = (Vec::new(), Validator::of(&whole));
        examples(&whole, "", &mut found);
        for (pointer, example) in &found {
            assert!(validator.accepts(pointer, example), "{example} at {pointer}");
        }
        assert!(found.len() > least, "{} examples", found.len());
    }
}

#[test]
#[ignore = "needs KALMEMS_REFERENCE_DATA"]
fn every_named_file_and_column_is_there() {
    let data = std::env::var_os("KALMEMS_REFERENCE_DATA")
        .expect("KALMEMS_REFERENCE_DATA is not set; it names the folder that contains `recordings/`");
    let folder = Path::new(&data).join("recordings");
    for set in SETS {
        // As if the experiment file stood among the recordings.
        let text = fs::read_to_string(file(set)).unwrap();
        let experiment = published().parse(&text, &folder.join("experiment.toml")).unwrap();
        for recording in &experiment.recordings {
            for (file, column) in named_columns(recording) {
                let path = experiment.resolve(&file);
                let csv = fs::File::open(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
                let mut header = String::new();
                BufReader::new(csv).read_line(&mut header).unwrap();
                assert!(
                    header.trim().split(',').any(|name| name == column),
                    "{set}: `{column}` is not in {}: {header}",
                    path.display()
                );
            }
        }
    }
}

fn named_columns(recording: &Recording) -> Vec<(PathBuf, String)> {
    fn collect(
        file: &Path,
        segments: Option<&kalmems::config::Segments>,
        clock: &Clock,
        channels: &kalmems::config::Channels,
    ) -> Vec<(PathBuf, String)> {
        let mut names: Vec<String> = channels.iter().map(|(_, column)| column.to_owned()).collect();
        names.extend(segments.map(|s| s.column.clone()));
        if let Clock::Column(column) = clock {
            names.push(column.column.name().to_owned());
        }
        names.into_iter().map(|name| (file.to_owned(), name)).collect()
    }
    let mut all =
        collect(&recording.file, recording.segments.as_ref(), &recording.clock, &recording.channels);
    if let Some(reference) = &recording.reference {
        all.extend(collect(
            reference.file(recording),
            reference.segments(recording),
            reference.clock(recording),
            &reference.channels,
        ));
    }
    all
}
