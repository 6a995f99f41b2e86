//! What the text of an experiment may say, and what is said of one that says it wrongly.

use kalmems_engines::config::*;
use kalmems_engines::units::kind;
use kalmems_rigs::published;
use kalmems_rigs::shared_scanner::device::SharedScanner;
use std::fmt::Write as _;
use std::fs;
use std::path::Path;

const SCANNER: &str = include_str!("../../../kalmems/tests/experiments/shared-scanner.toml");
const STAGE: &str = include_str!("../../../kalmems/tests/experiments/stage-room.toml");

fn parse(text: &str) -> Result<Experiment, ConfigError> {
    published().parse(text, Path::new("lab/experiment.toml"))
}

fn message(text: &str) -> String {
    parse(text).unwrap_err().to_string()
}

fn scanner() -> Experiment {
    parse(SCANNER).unwrap()
}

const ANGLE: ExpectedEntry = ExpectedEntry::new("angle", &kind::ANGLE, Sign::Any);
const RATE: ExpectedEntry = ExpectedEntry::new("rate", &kind::ANGULAR_RATE, Sign::Any);

#[test]
fn values_arrive_in_si() {
    let experiment = scanner();
    let device = experiment.device::<SharedScanner>().unwrap();
    let found = [
        device.resonator.inertia.si(),
        device.resonator.stiffness.si(),
        device.resonator.damping.si(),
        device.comb.nominal_capacitance.si(),
        device.comb.angular_width.si(),
        device.comb.bias_capacitance.si(),
        device.readout.gain.si(),
        device.readout.offset.si(),
        device.readout.noise_variance.si(),
        device.carrier.amplitude.si(),
    ];
    // As in the set's own description.
    let expected = [1.15e-14, 1.10e-4, 5.95e-12, 5.71e-12, 0.2, 9.79e-12, -3.574e11, 6.3945, 1.92e-4, 6.0];
    assert_eq!(found.map(f64::to_bits), expected.map(f64::to_bits));
    assert!(!device.carrier.included_in_drive);
    assert_eq!(device.resonator.stiffness.text(), "1.10e-4 N m/rad");
}

#[test]
fn files_are_relative_to_the_experiment_file() {
    let experiment = scanner();
    let file = &experiment.recordings[0].file;
    assert_eq!(file, Path::new("shared-scanner/recording.csv"));
    assert_eq!(experiment.resolve(file), Path::new("lab/shared-scanner/recording.csv"));
    assert_eq!(experiment.resolve(Path::new("/data/a.csv")), Path::new("/data/a.csv"));
}

#[test]
fn a_reference_takes_from_the_recording_what_it_leaves_out() {
    let experiment = scanner();
    let recording = &experiment.recordings[0];
    let reference = recording.reference.as_ref().unwrap();
    assert_eq!(reference.file(recording), Path::new("shared-scanner/truth.csv"));
    assert_eq!(reference.clock(recording), &recording.clock);

    let experiment = parse(STAGE).unwrap();
    let recording = &experiment.recordings[0];
    let reference = recording.reference.as_ref().unwrap();
    assert_eq!(reference.file(recording), recording.file);
    assert_eq!(reference.segments(recording).unwrap().column, "record");
    assert_eq!(reference.delay_s().to_bits(), 6.9e-6_f64.to_bits());
    let Clock::Rate { rate, start: None } = &experiment.recordings[3].clock else { panic!("another clock") };
    assert_eq!(rate.si().to_bits(), 8000_f64.to_bits());
}

#[test]
fn the_sigma_points_can_be_left_out() {
    let ukf = |text: &str| {
        let ukf = parse(text).unwrap().estimate.unwrap().filters.pop().unwrap();
        [ukf.alpha, ukf.beta, ukf.kappa]
    };
    let left_out = SCANNER.replace("alpha = 1\nbeta = 2\nkappa = 1\n", "");
    assert_eq!(ukf(&left_out), [None; 3]);
    let changed = SCANNER.replace("alpha = 1\n", "alpha = 0.5\n").replace("kappa = 1\n", "kappa = 0\n");
    assert_eq!(ukf(&changed), [Some(0.5), Some(2.0), Some(0.0)]);
}

#[test]
fn a_rig_takes_the_values_it_knows() {
    let experiment = scanner();
    let ekf = &experiment.estimate.as_ref().unwrap().filters[1];
    let key = Key::from("estimate").child("filter").index(1).child("start_sd");
    let values = experiment.values(key, &ekf.start_sd, [RATE, ANGLE]).unwrap();
    assert_eq!(values.map(f64::to_bits), [15e3, 0.15].map(f64::to_bits));
}

/// The key of the start of a filter, and its values.
fn start_of(filter: usize) -> Key {
    Key::from("estimate").child("filter").index(filter).child("start")
}

fn start(experiment: &Experiment, filter: usize) -> &Values {
    match &experiment.estimate.as_ref().unwrap().filters[filter].start {
        Some(FilterStart::Values(values)) => values,
        other => panic!("{other:?}"),
    }
}

#[test]
fn a_rig_refuses_the_values_it_does_not_know() {
    let of = |text: &str| {
        let experiment = parse(text).unwrap();
        experiment.values(start_of(1), start(&experiment, 1), [ANGLE, RATE]).unwrap_err().to_string()
    };
    let start = "method = \"ekf\"\nstart = { angle = \"0.05 rad\", rate = \"0 rad/s\" }";
    assert!(SCANNER.contains(start));
    let with = |new: &str| of(&SCANNER.replace(start, &format!("method = \"ekf\"\nstart = {new}")));
    insta::assert_snapshot!(
        with("{ angel = \"0.05 rad\", rate = \"0 rad/s\" }"),
        @"lab/experiment.toml:46: estimate.filter[1].start.angel: unknown key `angel`; did you mean `angle`? known keys: angle, rate"
    );
    insta::assert_snapshot!(with("{ angle = \"0.05 rad\" }"), @r#"lab/experiment.toml:46: estimate.filter[1].start.rate: the key is missing; write `rate = "0.1 deg/s"`"#);
    insta::assert_snapshot!(with("{ angle = \"0.05 rad\", rate = \"0 Hz\" }"), @"lab/experiment.toml:46: estimate.filter[1].start.rate: `0 Hz` has the dimension 1/s; expected an angular rate (rad/s), such as `0.1 deg/s`");
    insta::assert_snapshot!(with("{ angle = 0.05, rate = \"0 rad/s\" }"), @r#"lab/experiment.toml:46: estimate.filter[1].start.angle: `0.05` has no unit; expected an angle (rad), such as `"0.2 rad"`"#);
}

#[test]
fn a_rig_checks_the_sign_of_values() {
    let experiment = scanner();
    let positive = ExpectedEntry::new("rate", &kind::ANGULAR_RATE, Sign::Positive);
    let error = experiment.values(start_of(0), start(&experiment, 0), [ANGLE, positive]).unwrap_err();
    insta::assert_snapshot!(error, @"lab/experiment.toml:41: estimate.filter[0].start.rate: `0 rad/s` is not above 0; expected an angular rate above 0, such as `0.1 deg/s`");
}

#[test]
fn a_rig_takes_the_columns_it_knows() {
    let experiment = scanner();
    let channels = &experiment.recordings[0].channels;
    let key = || Key::from("recording").index(0).child("channels");
    assert_eq!(experiment.columns(key(), channels, ["signal", "drive"]).unwrap(), ["cap_V", "drive_V"]);
    let unknown = experiment.columns(key(), channels, ["driven", "signal"]).unwrap_err();
    insta::assert_snapshot!(unknown, @"lab/experiment.toml:27: recording[0].channels.drive: unknown key `drive`; did you mean `driven`? known keys: driven, signal");
    let missing = experiment.columns(key(), channels, ["drive", "signal", "monitor"]).unwrap_err();
    insta::assert_snapshot!(missing, @r#"lab/experiment.toml:27: recording[0].channels.monitor: the key is missing; name the column, such as `monitor = "monitor_V"`"#);
}

#[test]
fn the_first_fault_in_the_file_is_reported() {
    let text = SCANNER.replace("stiffness", "stifness").replace("angular_width", "angular_widht");
    let error = parse(&text).unwrap_err();
    assert_eq!(error.place.position, Some(LineAndColumn { line: 6, column: 1 }));
    assert_eq!(error.place.key.to_string(), "device.shared_scanner.resonator.stifness");
    assert!(matches!(&error.fault, ConfigFault::UnknownKey { suggestion: Some(s), .. } if s == "stiffness"));
}

#[test]
fn line_ends_and_byte_order_marks_of_other_systems_are_read() {
    assert_eq!(parse(&SCANNER.replace('\n', "\r\n")).unwrap(), scanner());
    assert_eq!(parse(&format!("\u{feff}{SCANNER}")).unwrap(), scanner());
    let error = parse(&SCANNER.replace("stiffness", "stifness").replace('\n', "\r\n")).unwrap_err();
    assert_eq!(error.place.position, Some(LineAndColumn { line: 6, column: 1 }));
}

#[test]
fn columns_count_characters() {
    let error = parse("name = \"µµ\" x").unwrap_err();
    assert_eq!(error.place.position, Some(LineAndColumn { line: 1, column: 13 }));
}

#[test]
fn files_that_cannot_be_read_say_so() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, bytes: &[u8]| {
        let path = folder.path().join(name);
        fs::write(&path, bytes).unwrap();
        Experiment::load(&path).unwrap_err()
    };
    assert_eq!(Experiment::load(&folder.path().join("none.toml")).unwrap_err().fault, ConfigFault::NotFound);
    assert_eq!(Experiment::load(folder.path()).unwrap_err().fault, ConfigFault::Folder);
    let large = write("large.toml", &vec![b'#'; 1_000_001]);
    assert_eq!(large.fault, ConfigFault::TooLarge { limit: 1_000_000 });
    assert!(matches!(write("fits.toml", &vec![b'#'; 1_000_000]).fault, ConfigFault::MissingKey { .. }));
    let latin = write("latin.toml", b"name = \"a\"\ndescription = \"5 \xb5m\"\n");
    assert_eq!(latin.fault, ConfigFault::NotUtf8);
    assert_eq!(latin.place.position, Some(LineAndColumn { line: 2, column: 18 }));
    assert!(latin.to_string().ends_with("latin.toml:2: the file is not UTF-8 text; save it as UTF-8"));
    let text = "#".repeat(1_000_001);
    assert_eq!(parse(&text).unwrap_err().fault, ConfigFault::TooLarge { limit: 1_000_000 });
}

#[test]
fn messages_stay_short_whatever_the_file_holds() {
    let long = "x".repeat(100_000);
    for text in [
        format!("{long} = 1"),
        format!("name = \"{long}\""),
        format!("name = {long}"),
        format!("\"a\\nb\" = \"{long}\""),
        format!("name = \"a\"\ndevice.piston_mirror.readout.noise_density = \"{long}\""),
        format!("name = \"a\"\ndevice.piston_mirror.readout.noise_density = \"1 {}\"", &long[..90]),
        format!("name = \"a\"\ndevice.{long} = {{}}"),
        format!("name = \"a\"\ndevice = {{ {long} = 1, b = 2 }}"),
        format!("a = {}1{}", "[".repeat(10_000), "]".repeat(10_000)),
        format!("{long} = 1\n{long} = 2"),
    ] {
        let message = message(&text);
        assert!(message.len() < 1000, "{} bytes: {}", message.len(), &message[..200]);
        assert!(!message.contains('\n'), "{message}");
    }
}

#[test]
fn every_single_line_of_a_good_file_matters() {
    // Without any one line that is a key, a table or a list, the file is refused or says something else.
    let whole = scanner();
    for left_out in 0..SCANNER.lines().count() {
        let mut text = String::new();
        for (i, line) in SCANNER.lines().enumerate() {
            if i != left_out {
                writeln!(text, "{line}").unwrap();
            }
        }
        let line = SCANNER.lines().nth(left_out).unwrap();
        let silent = line.is_empty();
        assert_eq!(parse(&text).is_ok_and(|experiment| experiment == whole), silent, "{line}");
    }
}

proptest::proptest! {
    /// No text makes the reader panic, and every message names the file.
    #[test]
    fn any_damage_is_an_error_or_an_experiment(
        at in 0..STAGE.len(), remove in 0_usize..40, insert in "[ -~\\n\\u{b5}]{0,8}"
    ) {
        let text: String = STAGE.chars().take(at)
            .chain(insert.chars())
            .chain(STAGE.chars().skip(at + remove))
            .collect();
        match parse(&text) {
            Ok(experiment) => {
                let again = parse(&experiment.to_toml().unwrap()).unwrap();
                proptest::prop_assert_eq!(again, experiment);
            }
            Err(e) => {
                let message = e.to_string();
                proptest::prop_assert!(message.starts_with("lab/experiment.toml"), "{}", message);
                proptest::prop_assert!(!message.contains('\n'), "{}", message);
            }
        }
    }
}

#[test]
fn a_channel_is_a_name_or_a_table_and_comes_back_as_it_was() {
    let channels = "{ drive = \"drive_V\", signal = \"cap_V\" }";
    assert!(SCANNER.contains(channels));
    let mapped = "{ drive = { column = \"Vdrive\", unit = \"mV\", scale = 4 }, signal = { column = \"Ucap\", unit = \"V\", \
                  offset = \"0.1 V\" } }";
    let text = SCANNER.replacen(channels, mapped, 1).replacen("\"time_s\" }", "\"t\", unit = \"ms\" }", 1);
    let experiment = parse(&text).unwrap();
    let recording = &experiment.recordings[0];
    assert_eq!(recording.channels.column("drive"), Some("Vdrive"));
    let layout = recording.layout(&["Vdrive", "Ucap"]);
    assert_eq!(layout.clock, kalmems_engines::recording::TimeSource::Column("t".to_owned()));
    let drive = layout.declared.iter().find(|known| known.key == "drive").unwrap();
    let reading = drive.reading.as_ref().unwrap();
    assert_eq!(
        (reading.unit.as_ref().unwrap().0.as_str(), reading.scale.as_ref().unwrap().si()),
        ("mV", 4.0)
    );
    assert!(layout.declared.iter().any(|known| known.is_clock() && known.reading.is_some()));
    let again = parse(&experiment.to_toml().unwrap()).unwrap();
    assert_eq!(again, experiment);
    // What says nothing but a name is written as one.
    let plain = scanner().to_toml().unwrap();
    assert!(plain.contains("signal = \"cap_V\"") && plain.contains("column = \"time_s\""), "{plain}");
}

#[test]
fn a_column_that_two_channels_read_otherwise_is_refused() {
    let text = SCANNER.replacen("drive = \"drive_V\"", "drive = { column = \"cap_V\", scale = 2 }", 1);
    insta::assert_snapshot!(message(&text), @"lab/experiment.toml:27: recording[0].channels.signal: the column `cap_V` is that of `drive` as well, and there its numbers are read otherwise; say the same of them in both places");
}

#[test]
fn what_a_number_or_a_list_should_be_is_said_in_words_of_this_program() {
    let clock = "clock = { column = \"time_s\" }";
    let text =
        SCANNER.replacen(clock, &format!("format = {{ kind = \"csv\", header_line = 0 }}\n{clock}"), 1);
    insta::assert_snapshot!(message(&text), @"lab/experiment.toml:26: recording[0].format.header_line: found the number `0`; expected a whole number of 1 or more, without quotes; write `header_line = 1`");
    insta::assert_snapshot!(message(&SCANNER.replacen("[[recording]]", "[recording]", 1)), @"lab/experiment.toml:23: recording: found a table; expected a list of tables; add a table headed `[[recording]]`, with double brackets");
}

#[test]
fn a_second_filter_with_the_same_name_is_refused() {
    let text = format!(
        "{SCANNER}\n[[estimate.filter]]\nname = \"Twice\"\nmethod = \"model\"\nstart = {{ angle = \"0 rad\", rate = \
                        \"0 rad/s\" }}\n"
    );
    let twice = format!("{text}{}", &text[SCANNER.len()..]);
    let said = message(&twice);
    assert!(said.contains("give this one another, such as `name = \"Twice-2\"`"), "{said}");
    assert!(!said.contains("recording"), "{said}");
}
