//! Whole inspections of small files and of the independent recordings.

use super::*;
use crate::recording::FindingKind;
use std::f64::consts::TAU;
use std::fmt::Write as _;

fn inspected(text: &str) -> Result<Inspection, ReadError> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.csv");
    std::fs::write(&path, text).unwrap();
    inspect(&path)
}

/// Two records of a tone of 2 V at 1300 Hz, sampled with 100 kHz.
fn two_records() -> String {
    let mut text = "record,time_us,cap_mV,drive_V,remark\n".to_owned();
    for (label, rows) in [("first", 500), ("second", 1000)] {
        for i in 0..rows {
            let value = 2000.0 * (TAU * 0.013 * f64::from(i)).sin() + 100.0;
            writeln!(text, "{label},{}0,{value:.3},0,ok{}", i, i % 3).unwrap();
        }
    }
    text
}

#[test]
fn a_file_of_two_records_as_text() {
    insta::assert_snapshot!(inspected(&two_records()).unwrap().to_text());
}

#[test]
fn a_file_of_two_records_as_json() {
    let inspection = inspected(&two_records()).unwrap();
    let mut json = serde_json::to_value(&inspection).unwrap();
    assert_eq!(json["segments"][1]["label"], "second");
    assert_eq!(json["channels"][0]["unit"], "mV");
    assert_eq!(json["channels"][0]["si_unit"], "V");
    let frequency = json["channels"][0]["spectrum"]["lines"][0]["frequency"].take();
    approx::assert_relative_eq!(frequency.as_f64().unwrap(), 1300.0, max_relative = 1e-4);
    let fields: Vec<_> = json.as_object().unwrap().keys().map(String::as_str).collect();
    assert_eq!(
        fields.join(" "),
        "source rows recognised time segment_column segments channels window frequency_unit diagnosis unchecked"
    );
}

#[test]
fn the_column_of_times_is_found_by_its_unit_where_it_has_another_name() {
    let with = |name: &str, other: &str| {
        let mut text = format!("{name},{other}\n");
        (0..200).for_each(|i| writeln!(text, "{i},{}", i % 7).unwrap());
        serde_json::to_value(inspected(&text).unwrap()).unwrap()
    };
    for name in ["t_s", "Zeit_s", "sec_s", "abscissa_ms"] {
        let found = with(name, "cap_V");
        assert_eq!(found["time"], name);
        assert_eq!(found["channels"].as_array().unwrap().len(), 1);
    }
    // A delay behind a signal is none.
    assert!(with("cap_V", "delay_us")["time"].is_null());
}

#[test]
fn a_file_without_time_and_with_holes_as_text() {
    let mut text = "sample_index,gyro_dps\n".to_owned();
    for i in 0..200 {
        match i {
            50..60 => writeln!(text, "{i},"),
            _ => writeln!(text, "{i},{}", i % 7),
        }
        .unwrap();
    }
    insta::assert_snapshot!(inspected(&text).unwrap().to_text());
}

#[test]
fn a_file_that_is_no_recording_is_inspected_all_the_same() {
    let text = "time_s,cap_V\n0,1\n1,2\n1,high\n3,4\n5\n2,6\n";
    insta::assert_snapshot!(inspected(text).unwrap().to_text());
}

#[test]
fn what_has_no_rows_is_an_error() {
    for text in ["", "time_s,cap_V\n", "1,2\n3,4\n"] {
        assert!(matches!(inspected(text), Err(ReadError::Unusable { .. })), "{text:?}");
    }
}

/// What is recognised in a file whose rows are `header` and then `row` of each index.
fn recognised(header: &str, rows: usize, row: impl Fn(usize) -> String) -> String {
    let mut text = format!("{header}\n");
    for i in 0..rows {
        writeln!(text, "{}", row(i)).unwrap();
    }
    inspected(&text).unwrap().recognised.join(" ")
}

#[test]
fn what_is_recognised() {
    let report = [
        (
            "text and time",
            recognised("r,time_s,x_V", 60, |i| format!("{},{},{i}", ["a", "b"][i / 30], i % 30)),
        ),
        (
            "a number with a unit",
            recognised("f_Hz,time_s,x_V", 60, |i| format!("{},{},{i}", 1711 + i / 20, i % 20)),
        ),
        ("a flag in one record", recognised("flag,time_s,x_V", 60, |i| format!("{},{i},{i}", i / 30))),
        ("a flag without time", recognised("flag,x_V", 60, |i| format!("{},{i}", i / 30))),
        ("a flag that returns", recognised("flag,x_V", 60, |i| format!("{},{i}", i / 15 % 2))),
        ("text without time", recognised("r,n,x_V", 60, |i| format!("{},{i},{i}", ["a", "b"][i / 30]))),
        ("a word per row", recognised("r,time_s,x_V", 60, |i| format!("row{i},{i},{i}"))),
        ("a time that starts again", recognised("time_s,x_V", 60, |i| format!("{},{i}", i % 30))),
        ("a phase is no time", recognised("phase_s", 60, |i| i.to_string())),
    ];
    let report: Vec<String> = report.iter().map(|(name, sentences)| format!("{name}: {sentences}")).collect();
    insta::assert_snapshot!(report.join("\n"));
}

#[test]
fn a_series_for_a_figure() {
    let inspection = inspected("time_ms,x_mV\n0,1\n1,5\n2,\n3,2\n").unwrap();
    let segment = inspection.longest_segment().unwrap();
    let series = inspection.series("x_mV", 0..segment.rows, 2).unwrap();
    let expected = ChannelSeries {
        start: vec![0.0, 0.002],
        minimum: vec![0.001, 0.002],
        maximum: vec![0.005, 0.002],
        missing: 1,
    };
    assert_eq!(series, expected);
    assert!(inspection.series("y_V", 0..segment.rows, 2).is_none());
}

#[test]
fn an_inspection_can_be_stopped() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.csv");
    std::fs::write(&path, two_records()).unwrap();
    let stopped = inspect_with(&path, &mut |_, _| ControlFlow::Break(()));
    assert!(matches!(stopped, Err(ReadError::Interrupted { .. })));
}

fn reference(file: &str) -> Inspection {
    let folder = std::env::var_os("KALMEMS_REFERENCE_DATA").expect("KALMEMS_REFERENCE_DATA names the folder");
    inspect(&Path::new(&folder).join(file)).unwrap()
}

fn strongest(inspection: &Inspection, column: &str) -> SignalLine {
    let channel = inspection.channels.iter().find(|c| c.column == column).unwrap();
    channel.spectrum.as_ref().unwrap().lines[0]
}

#[test]
#[ignore = "needs KALMEMS_REFERENCE_DATA"]
fn reference_recordings_show_their_lines() {
    for (file, column, frequency) in [
        ("recordings/shared-scanner/recording.csv", "drive_V", 31.35e3),
        ("recordings/shared-scanner/recording.csv", "cap_V", 31.35e3),
        ("recordings/stage-room/bias_on.csv", "drive_V", 1700.0),
        ("recordings/stage-room/bias_on.csv", "ldv_V", 1700.0),
        ("recordings/stage-sweep/recording.csv", "drive_V", 1711.0),
        ("recordings/accel-open-loop-1g/recording.csv", "output_V", 10.0),
    ] {
        let inspection = reference(file);
        let line = strongest(&inspection, column);
        let bin = inspection.channels[0].spectrum.as_ref().map_or(f64::NAN, |s| s.resolution);
        assert!(
            (line.frequency - frequency).abs() < 0.02 * bin,
            "{file} {column}: {line:?}, one bin is {bin}"
        );
    }
    // Without time, in cycles per sample; the gyroscope samples with 3 kHz.
    let gyro = reference("recordings/stage-room/gyro.csv");
    assert_eq!((gyro.segments.len(), gyro.frequency_unit), (4, "1/sample"));
    // The drive is 90 V and 90 V of amplitude.
    let drive = strongest(&reference("recordings/shared-scanner/recording.csv"), "drive_V");
    approx::assert_relative_eq!(drive.amplitude, 90.0, max_relative = 1e-3);
}

/// A file that another program wrote, of the fixtures of the formats.
fn fixture(name: &str) -> Inspection {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../kalmems-formats/tests/fixtures");
    inspect(&folder.join(name)).unwrap_or_else(|error| panic!("{name}: {error}"))
}

/// A text beside numbers tells records apart, or is left out; it is no reason to refuse the file.
#[test]
fn a_column_of_text_does_not_make_a_binary_file_unusable() {
    for name in ["none.parquet", "columns.h5", "segments.tdms", "fields.npy", "variables.mat", "stored.npz"] {
        let inspection = fixture(name);
        assert_eq!(inspection.rows, 120, "{name}");
        assert_eq!(inspection.time.as_deref(), Some("time_s"), "{name}");
        assert_eq!(inspection.segment_column.as_deref(), Some("phase"), "{name}");
        assert!(inspection.channels.iter().any(|channel| channel.column == "cap_V"), "{name}");
    }
    let inspection = fixture("columns.h5");
    assert!(
        inspection.recognised.contains(&"`words` is text and is left out.".to_owned()),
        "{:?}",
        inspection.recognised
    );
}

#[test]
fn of_columns_of_several_lengths_those_of_most_are_inspected() {
    let inspection = fixture("differential/mat5_lengths.mat");
    assert_eq!(inspection.rows, 200);
    let columns: Vec<&str> = inspection.channels.iter().map(|channel| channel.column.as_str()).collect();
    assert_eq!(columns, ["t", "u"]);
    let sentence = "`slow` has 20 rows and is left out, as most columns have another number of rows.";
    assert!(inspection.recognised.contains(&sentence.to_owned()), "{:?}", inspection.recognised);
}

/// Stored scales, soft links, a link to the root and data that grow along both axes.
#[test]
fn files_of_laboratories_are_inspected() {
    let links = fixture("differential/links_latest.h5");
    assert_eq!(links.rows, 200);
    assert!(links.channels.iter().any(|channel| channel.column == "out"));
    let both = fixture("differential/both_v108.h5");
    assert_eq!((both.rows, both.channels.len()), (450, 3));
    let scaled = fixture("differential/netcdf_earliest.h5");
    // A number of 16 bits times 0.00025, and no 8 kV.
    let packed = scaled.channels.iter().find(|channel| channel.column.starts_with('p')).unwrap();
    assert!(packed.statistics.maximum.unwrap() < 8.0, "{:?}", packed.statistics);
    assert_eq!(packed.statistics.missing, 2);
}

/// The numbers of which a meter says that they were beyond its range count as that, and not as numbers.
#[test]
fn numbers_that_say_overload_are_counted_and_have_no_part_in_the_figures() {
    let mut text = "time_s,cap_V\n".to_owned();
    for i in 0..400 {
        let value = match i {
            100 | 101 => "9.90000000E+37".to_owned(),
            200 => "9.91E37".to_owned(),
            300 => "OL".to_owned(),
            _ => format!("{:.4}", 0.05 * (TAU * 0.03 * f64::from(i)).sin()),
        };
        writeln!(text, "{:.3},{value}", f64::from(i) * 1e-3).unwrap();
    }
    let inspection = inspected(&text).unwrap();
    let cap = &inspection.channels[0].statistics;
    assert_eq!((cap.count, cap.missing), (396, 4));
    assert!(cap.maximum.unwrap() < 0.051);
    let found: Vec<(FindingKind, usize)> =
        inspection.diagnosis.iter().map(|finding| (finding.kind, finding.count)).collect();
    assert_eq!(found, [(FindingKind::Overload, 3), (FindingKind::Nan, 1)]);
    let said = inspection.diagnosis[0].to_string();
    assert!(said.contains("`9.90000000E+37` is written where a value is beyond the range"), "{said}");
}

#[test]
fn a_slow_channel_without_a_unit_is_no_label_of_records() {
    let recognised = |name: &str, first: f64| {
        let mut text = format!("cap_V,{name}\n");
        for i in 0..2000 {
            writeln!(text, "{},{:.1}", f64::from(i % 50), first + f64::from(i / 300) * 0.1).unwrap();
        }
        inspected(&text).unwrap()
    };
    let slow = recognised("temp", 25.0);
    assert_eq!((slow.segment_column, slow.segments.len(), slow.channels.len()), (None, 1, 2));
    // A word that says so makes it one.
    assert_eq!(recognised("sweep", 25.0).segments.len(), 7);
}

/// Times with so few digits that they repeat: each column changes where the time does not go on, and none is a label.
#[test]
fn a_column_that_changes_in_every_row_is_no_label_however_often_the_time_repeats() {
    let mut text = "time_unix_s,ax\n".to_owned();
    for i in 0..500 {
        writeln!(text, "1.73234e+09,{}", i * 7919 % 1009).unwrap();
    }
    let inspection = inspected(&text).unwrap();
    assert_eq!((inspection.segment_column.as_deref(), inspection.segments.len()), (None, 1));
    assert!(!inspection.is_usable());
    let said = inspection.diagnosis[0].to_string();
    assert!(said.contains("clock = { rate ="), "{said}");
}

#[test]
fn indices_of_names_are_no_units() {
    let mut text = "time_s,Voltage_0,Voltage_1,gyro_rad[1],pos_min,q_1\n".to_owned();
    (0..50).for_each(|i| writeln!(text, "{i},{i},{i},{i},{i},{i}").unwrap());
    let units: Vec<String> =
        inspected(&text).unwrap().channels.into_iter().map(|channel| channel.unit).collect();
    assert_eq!(units, ["", "", "", "", "1"]);
}

/// An angle in degrees is no suggestion for a temperature.
#[test]
fn degrees_celsius_are_kept_as_they_stand() {
    let mut text = "time_s,board_degC\n".to_owned();
    (0..50).for_each(|i| writeln!(text, "{i},{}", i * 7 % 5).unwrap());
    let said = inspected(&text).unwrap().diagnosis[0].to_string();
    assert!(
        said.starts_with("line 1, column `board_degC`: degrees Celsius count from another zero"),
        "{said}"
    );
}

#[test]
fn waveforms_of_a_file_are_stretches_with_rates_of_their_own() {
    let inspection = fixture("waveforms.tdms");
    let found: Vec<(usize, Option<f64>, bool)> = inspection
        .segments
        .iter()
        .map(|segment| (segment.rows, segment.rate_hz.map(f64::round), segment.uniform))
        .collect();
    assert_eq!(found, [(60, Some(1000.0), true), (40, Some(1000.0), true), (50, Some(2000.0), true)]);
    let said: Vec<String> = inspection.diagnosis.iter().map(ToString::to_string).collect();
    assert_eq!(
        said,
        [
            "line 61, column `time_s`: the file begins a new waveform, 60 s after 0.059 s (the first of 2 waveforms); the times are \
          kept as they stand: a new stretch begins, and the estimate begins anew"
        ]
    );
}

#[test]
fn a_channel_with_other_times_is_left_out_with_the_reason() {
    let inspection = fixture("between.tdms");
    let sentence =
        "`cap_V` is left out, as it starts 0.0033 s after `drive_V`: 3.3 samples, no whole number.";
    assert!(inspection.recognised.contains(&sentence.to_owned()), "{:?}", inspection.recognised);
    assert_eq!(inspection.channels.len(), 1);
    assert_eq!(inspection.unchecked, ["the columns that are left out (`cap_V`)"]);
    let later = fixture("later.tdms");
    assert_eq!((later.rows, later.channels[1].statistics.missing), (48, 8));
}

/// What was not looked for is not said to be absent.
#[test]
fn nothing_is_said_of_checks_that_did_not_run() {
    let text = |header: &str, rows: usize| {
        let mut text = format!("{header}\n");
        (0..rows).for_each(|i| writeln!(text, "{i},{}", i * 7 % 5).unwrap());
        inspected(&text).unwrap().to_text()
    };
    assert!(text("time_s,x_V", 100).contains("\nNothing is missing, irregular, saturated or constant.\n\n"));
    let short = text("time_s,x_V", 10);
    assert!(short.contains("\nNothing is missing, irregular or constant.\n"), "{short}");
    assert!(
        short.contains("Not checked: whether a signal is saturated, as no segment has more than 10 rows.")
    );
    let timeless = text("n_V,x_V", 100);
    assert!(timeless.contains(
        "\nNothing is missing, saturated or constant.\nNot checked: whether the times are regular"
    ));
}

/// A check that ran in some segments alone is said to have run in none, and those without it are counted.
#[test]
fn a_check_that_short_segments_did_not_allow_is_named_with_their_number() {
    let mut text = "record,time_s,x_V\n".to_owned();
    for (record, rows) in [("a", 100), ("b", 12), ("c", 2)] {
        (0..rows).for_each(|i| writeln!(text, "{record},{i},{}", i * 7 % 5).unwrap());
    }
    let said = inspected(&text).unwrap().to_text();
    assert!(
        said.contains(
            "\nNothing is missing.\nNot checked: whether the times are regular, in 1 segment of fewer than 3 rows; \
             whether a signal is saturated, in 2 segments of fewer than 24 rows; whether a signal is constant, in 1 segment of \
             fewer than 8 rows.\n"
        ),
        "{said}"
    );
    let one = inspected("time_s,x_V\n0,1\n").unwrap().to_text();
    assert!(one.contains("\nNothing is missing.\n"), "{one}");
    assert!(one.contains("whether a signal is constant, as no segment has more than 1 row."), "{one}");
    let mut few = "time_s,x_V,y_V\n".to_owned();
    (0..60).for_each(|i| writeln!(few, "{i},{},{}", i * 7 % 5, if i < 9 { "1" } else { "" }).unwrap());
    let few = inspected(&few).unwrap();
    assert_eq!(few.unchecked, ["whether `y_V` is saturated or constant, as it has no more than 9 values"]);
}

/// A file whose only column is the time has nothing that could be missing.
#[test]
fn nothing_is_said_of_a_file_without_a_signal() {
    let mut text = "time_s,word\n".to_owned();
    (0..50).for_each(|i| writeln!(text, "{i},w{i}").unwrap());
    let said = inspected(&text).unwrap().to_text();
    assert!(
        said.contains("\nNothing is irregular.\nNot checked: any signal, as no column is one; "),
        "{said}"
    );
}

/// Digits that may stand in groups or behind a decimal comma are a reason to refuse, and no text that is passed over.
#[test]
fn a_number_that_can_be_read_in_two_ways_is_refused_and_read_once_the_decimal_mark_is_stated() {
    let mut text = "time_s,cap_mV\n".to_owned();
    (0..50).for_each(|i| writeln!(text, "{i},\"{},{}\"", 1 + i % 7, 100 + i).unwrap());
    let inspection = inspected(&text).unwrap();
    let said = inspection.diagnosis[0].to_string();
    assert!(!inspection.is_usable());
    assert!(said.starts_with("line 2, column `cap_mV`: `1,100` is one number with groups"), "{said}");
    assert!(said.contains("`decimal = \".\"`"), "{said}");
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("grouped.csv");
    std::fs::write(&path, &text).unwrap();
    let csv = kalmems_formats::CsvHints { decimal: Some('.'), ..kalmems_formats::CsvHints::default() };
    let hints = kalmems_formats::Hints { csv, ..kalmems_formats::Hints::default() };
    let stated = StatedFile { hints, time: None, rate_hz: None };
    let read = inspect_stated(&path, &stated, &mut |_, _| ControlFlow::Continue(())).unwrap();
    assert_eq!((read.diagnosis.len(), read.channels[0].statistics.minimum), (0, Some(1.100)));
    // One cell that can mean nothing else decides for those before it as well.
    let sure = inspected(&format!("{text}50,\"1,150.5\"\n")).unwrap();
    assert_eq!((sure.diagnosis.len(), sure.channels[0].statistics.minimum), (0, Some(1.100)));
}

/// A counter of µs in 32 bits, and stamps of a 400 Hz clock that are rounded to ms.
#[test]
fn counters_go_on_behind_their_end_and_rounded_stamps_have_the_rate_of_their_mean() {
    let mut text = "time_us,cap_V\n".to_owned();
    for i in 0..400_u64 {
        writeln!(text, "{},{}", (4_294_667_296 + 1000 * i) % (1 << 32), i * 7 % 5).unwrap();
    }
    let counter = inspected(&text).unwrap();
    assert_eq!((counter.segments.len(), counter.segments[0].uniform), (1, true));
    approx::assert_relative_eq!(counter.segments[0].duration_s.unwrap(), 0.399, max_relative = 1e-9);
    let said = counter.diagnosis[0].to_string();
    assert!(said.starts_with("line 302, column `time_us`: a counter of 32 bits begins again"), "{said}");
    let mut text = "time_ms,cap_V\n".to_owned();
    (0..400).for_each(|i| writeln!(text, "{},{}", (f64::from(i) * 2.5).floor(), i * 7 % 5).unwrap());
    let rounded = inspected(&text).unwrap();
    approx::assert_relative_eq!(rounded.segments[0].rate_hz.unwrap(), 400.0, max_relative = 2e-3);
    let said = rounded.diagnosis[0].to_string();
    assert!(
        said.contains("those of a steady clock, rounded to 0.001 s, 40 % of an interval of 0.0024"),
        "{said}"
    );
}

/// Times in whole intervals: a row that is missing is a gap, and none of rounding.
#[test]
fn a_missing_row_is_no_rounded_stamp() {
    let mut text = "time_us,cap_V\n".to_owned();
    (0..400).filter(|i| *i != 150).for_each(|i| writeln!(text, "{i},{}", i * 7 % 5).unwrap());
    let found = inspected(&text).unwrap();
    approx::assert_relative_eq!(found.segments[0].rate_hz.unwrap(), 1e6, max_relative = 1e-12);
    let said = found.diagnosis[0].to_string();
    assert!(said.contains("1 sample is missing where one is expected every 1e-6 s"), "{said}");
}

/// Rows of two sensors in one table have times and values that belong to neither.
#[test]
fn rows_of_sensors_that_take_turns_are_no_recording_and_a_state_that_changes_often_is() {
    let turns = |name: &str| {
        let mut text = format!("time_s,{name},x_V\n");
        for i in 0..200 {
            writeln!(text, "{},{},{i}", f64::from(i) * 0.01, ["acc", "gyr"][usize::from(i % 3 == 1)])
                .unwrap();
        }
        inspected(&text).unwrap()
    };
    let mixed = turns("sensor");
    assert!(!mixed.is_usable());
    let said = mixed.diagnosis[0].to_string();
    assert!(
        said.contains("column `sensor`: rows of `acc`, `gyr` take turns; expected rows of one source"),
        "{said}"
    );
    assert!(turns("state").is_usable());
}

#[test]
fn a_stated_rate_and_a_stated_format_are_taken() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.dat");
    std::fs::write(&path, "1;2\n3;4\n5;7\n").unwrap();
    let columns = Some(["a_V", "b_V"].map(str::to_owned).to_vec());
    let hints = kalmems_formats::Hints { columns, ..kalmems_formats::Hints::default() };
    let stated = StatedFile { hints, time: None, rate_hz: Some(200.0) };
    let found = inspect_stated(&path, &stated, &mut |_, _| ControlFlow::Continue(())).unwrap();
    assert_eq!((found.rows, found.frequency_unit, found.segments[0].duration_s), (3, "Hz", Some(0.01)));
    assert!(found.recognised.iter().any(|said| said.contains("follow each other at 200 Hz, as stated")));
}
