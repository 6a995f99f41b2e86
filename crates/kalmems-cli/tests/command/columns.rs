//! Columns under a laboratory's own names: with unit, factor and offset, in every format, for every command.

use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use tempfile::TempDir;

pub(super) fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../..").canonicalize().unwrap()
}

pub(super) fn run(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_kalmems")).current_dir(root()).args(arguments).output().unwrap()
}

pub(super) fn said(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

pub(super) fn done(arguments: &[&str]) -> String {
    let output = run(arguments);
    assert_eq!(output.status.code(), Some(0), "{}", said(&output));
    String::from_utf8(output.stdout).unwrap()
}

/// The message of a command that refuses, without the folder.
fn refused(arguments: &[&str], folder: &Path) -> String {
    let output = run(arguments);
    assert_eq!(output.status.code(), Some(1), "{}", said(&output));
    said(&output).replace(folder.to_str().unwrap(), "FOLDER")
}

/// As many rows as the fixtures have.
const ROWS: usize = 1200;

/// The scanner's example, shortened to the rows of the fixtures: its text and its recording.
pub(super) fn example() -> (String, String) {
    let folder = root().join("examples/shared_scanner");
    let text = std::fs::read_to_string(folder.join("experiment.toml")).unwrap();
    let end = text.find("# Read by the evaluation").unwrap();
    let estimate = text.find("[estimate]").unwrap();
    let text = format!("{}{}", &text[..end], &text[estimate..]).replace("\"8 ms\"", "\"0.4 ms\"");
    let rows = std::fs::read_to_string(folder.join("recording.csv")).unwrap();
    let rows: Vec<&str> = rows.lines().take(ROWS + 1).collect();
    (text, rows.join("\n") + "\n")
}

pub(super) const PLAIN: &str =
    "clock = { column = \"time_s\" }\nchannels = { drive = \"drive_V\", signal = \"cap_V\" }";
const OWN: &str = "clock = { column = \"t\", unit = \"s\" }\nchannels = { drive = { column = \"Vdrive\", unit = \"V\" }, \
                   signal = { column = \"Ucap\", unit = \"V\" } }";

/// Estimates a recording by an experiment whose channels are those, and gives the trajectory of the EKF.
fn trajectory(folder: &TempDir, file: &str, channels: &str) -> String {
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let (text, _) = example();
    let text = text.replace("recording.csv", file).replace(PLAIN, channels);
    assert!(text.contains(channels));
    std::fs::write(path("experiment.toml"), text).unwrap();
    let out = path(&format!("out-{file}"));
    // Of other settings.
    let _ = std::fs::remove_dir_all(&out);
    done(&["estimate", &path("experiment.toml"), "--out", &out]);
    std::fs::read_to_string(Path::new(&out).join("trajectory_ekf.csv")).unwrap()
}

fn fixture(name: &str) -> PathBuf {
    root().join("crates/kalmems-cli/tests/own_names").join(name)
}

#[test]
fn files_of_every_format_with_names_of_their_own_give_the_example_s_trajectory_to_the_last_bit() {
    let folder = tempfile::tempdir().unwrap();
    let (_, rows) = example();
    std::fs::write(folder.path().join("recording.csv"), &rows).unwrap();
    let expected = trajectory(&folder, "recording.csv", PLAIN);
    assert_eq!(expected.lines().count(), ROWS + 1);
    std::fs::write(folder.path().join("own.csv"), rows.replace("time_s,drive_V,cap_V", "t,Vdrive,Ucap"))
        .unwrap();
    let files = ["own.mat", "own.npz", "own.h5", "own.parquet", "own.tdms", "nulls.parquet"];
    for file in files {
        std::fs::copy(fixture(file), folder.path().join(file)).unwrap();
    }
    for file in files.into_iter().chain(["own.csv"]) {
        assert!(trajectory(&folder, file, OWN) == expected, "{file} differs");
    }
    let run = std::fs::read_to_string(folder.path().join("out-own.mat/run.toml")).unwrap();
    assert!(run.contains("column = \"Ucap\"") && run.contains("unit = \"V\""), "{run}");
    let metrics = std::fs::read_to_string(folder.path().join("out-own.mat/metrics.json")).unwrap();
    assert!(metrics.contains("column `Ucap`: its numbers are in `V`; the settings say so"), "{metrics}");
}

#[test]
fn scale_and_offset_are_those_of_a_copy_scaled_by_hand() {
    let folder = tempfile::tempdir().unwrap();
    let (_, rows) = example();
    // The drive through a divider by 4, in mV; the signal with 0.25 V taken off and turned over.
    let mut scaled = "t_us,probe,amp\n".to_owned();
    let mut by_hand = "time_s,drive_V,cap_V\n".to_owned();
    for (k, row) in rows.lines().skip(1).enumerate() {
        let cells: Vec<f64> = row.split(',').map(|cell| cell.parse().unwrap()).collect();
        let (probe, amp) = (cells[1] / 4.0 * 1e3, 0.25 - cells[2]);
        writeln!(scaled, "{k},{probe},{amp}").unwrap();
        let probe: f64 = probe.to_string().parse().unwrap();
        writeln!(by_hand, "{},{},{}", cells[0], probe * 4e-3, -amp + 0.25).unwrap();
    }
    std::fs::write(folder.path().join("scaled.csv"), scaled).unwrap();
    std::fs::write(folder.path().join("recording.csv"), by_hand).unwrap();
    let expected = trajectory(&folder, "recording.csv", PLAIN);
    let channels = "clock = { column = \"t_us\" }\nchannels = { drive = { column = \"probe\", unit = \"mV\", scale = 4 }, \
                    signal = { column = \"amp\", unit = \"V\", scale = -1, offset = \"0.25 V\" } }";
    assert!(trajectory(&folder, "scaled.csv", channels) == expected);
    // A sensitivity with a unit is the same factor.
    let channels = channels.replace("unit = \"mV\", scale = 4", "unit = \"V\", scale = \"4 mV/V\"");
    assert!(trajectory(&folder, "scaled.csv", &channels) == expected);
}

#[test]
fn a_column_without_unit_is_refused_with_what_to_write() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let (text, rows) = example();
    std::fs::write(path("own.csv"), rows.replace("time_s,drive_V,cap_V", "t,Vdrive,Ucap")).unwrap();
    let plain = PLAIN.replace("time_s", "t").replace("drive_V", "Vdrive").replace("cap_V", "Ucap");
    let text = text.replace("recording.csv", "own.csv").replace(PLAIN, &plain);
    std::fs::write(path("experiment.toml"), &text).unwrap();
    let estimate = ["estimate", &path("experiment.toml"), "--out", &path("out")];
    insta::assert_snapshot!(refused(&estimate, folder.path()));
    // What it says is what helps.
    std::fs::write(path("experiment.toml"), text.replace(&plain, OWN)).unwrap();
    done(&estimate);
}

#[test]
fn what_the_settings_say_of_a_column_has_to_fit_together() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let (text, rows) = example();
    std::fs::write(path("recording.csv"), rows).unwrap();
    let mut all = String::new();
    for signal in [
        "{ column = \"cap_V\", unit = \"Volt\" }",
        "{ column = \"cap_V\", unit = \"mV\" , scale = \"2 V/gn\" }",
        "{ column = \"cap_V\", offset = \"1 s\" }",
        "{ column = \"cap_V\", scale = 0 }",
        "{ column = \"cap_V\", gain = 2 }",
        "{ unit = \"V\" }",
        "{ column = \"drive_V\", unit = \"mV\" }",
        "3",
        "[\"cap_V\"]",
    ] {
        let text = text.replace("signal = \"cap_V\"", &format!("signal = {signal}"));
        std::fs::write(path("experiment.toml"), text).unwrap();
        let why = refused(&["estimate", &path("experiment.toml"), "--out", &path("out")], folder.path());
        writeln!(all, "{signal}\n  {}", why.trim_end()).unwrap();
    }
    insta::assert_snapshot!(all);
}

#[test]
fn a_stated_unit_that_differs_from_the_file_counts_and_is_reported() {
    let folder = tempfile::tempdir().unwrap();
    let (_, rows) = example();
    std::fs::write(folder.path().join("recording.csv"), &rows).unwrap();
    let expected = trajectory(&folder, "recording.csv", PLAIN);
    std::fs::write(folder.path().join("wrong.csv"), rows.replace("cap_V", "cap_mV")).unwrap();
    let channels = "clock = { column = \"time_s\" }\nchannels = { drive = \"drive_V\", signal = { column = \"cap\", unit = \"V\" } }";
    assert!(trajectory(&folder, "wrong.csv", channels) == expected);
    let metrics = std::fs::read_to_string(folder.path().join("out-wrong.csv/metrics.json")).unwrap();
    assert!(metrics.contains("the file says `mV` and the settings say `V`"), "{metrics}");
}

#[test]
fn inspect_reads_what_estimate_reads_where_a_column_is_text() {
    for name in ["text.parquet", "text.h5", "text.tdms"] {
        let text = done(&["inspect", fixture(name).to_str().unwrap()]);
        assert!(text.contains("Vdrive") && text.contains("operator"), "{name}: {text}");
    }
    // Texts that nobody, or somebody once, filled in.
    let text = done(&["inspect", fixture("nulls.parquet").to_str().unwrap()]);
    assert!(text.contains("`remark` is text with nothing in any row and is left out."), "{text}");
    assert!(text.contains("`note` is text with nothing in 1197 of 1200 rows and is left out."), "{text}");
}

/// Files that were not meant, each with a word that is nobody's business.
const CANARIES: [(&str, &str); 13] = [
    ("a word in each line", "SWORDFISH\nalpha\nbeta\n"),
    ("a line without end", "SWORDFISH"),
    ("accounts", "root:$6$SWORDFISH$abcdef:19000:0:99999:7:::\ndaemon:*:19000:0:99999:7:::\n"),
    ("an environment", "# keys\nTOKEN=SWORDFISH\nPORT=5\n"),
    ("values of a key", "SWORDFISH=1,2,3\n"),
    ("values of two keys", "SWORDFISH=1,2,3\nOTHER=4,5,6\n"),
    ("tabs", "SWORDFISH\talpha\nbeta\tSWORDFISH\n"),
    ("semicolons", "SWORDFISH;alpha\nbeta;SWORDFISH\n"),
    ("JSON in a line", "{\"SWORDFISH\": \"SWORDFISH\", \"n\": [1, 2, 3]}\n"),
    ("JSON", "{\n  \"SWORDFISH\": \"SWORDFISH\",\n  \"n\": [\n    1,\n    2\n  ]\n}\n"),
    ("lists of JSON", "[\"SWORDFISH\", 2, 3]\n[\"SWORDFISH\", 5, 6]\n"),
    (
        "prose",
        "Dear SWORDFISH, dear all,\nwe met at five, again, and SWORDFISH\nwas not there, as you know.\n",
    ),
    ("markup", "<a href=\"SWORDFISH\">SWORDFISH</a>\n<b>SWORDFISH</b>\n"),
];

/// For each file that settings can name: what it is, the command, and settings in which it is called `FILE`. All other files are
/// those of the examples.
fn settings_with_a_file() -> Vec<(&'static str, Vec<&'static str>, String)> {
    let examples = root().join("examples");
    let of = |example: &str, file: &str| {
        let folder = examples.join(example);
        let text = std::fs::read_to_string(folder.join(file)).unwrap();
        text.replace("file = \"", &format!("file = \"{}/", folder.display()))
    };
    let with = |text: &str, example: &str, file: &str| {
        let path = format!("\"{}\"", examples.join(example).join(file).display());
        assert!(text.contains(&path), "{path}");
        text.replace(&path, "\"FILE\"")
    };
    let scanner = |settings: &str, file: &str| with(&of("shared_scanner", settings), "shared_scanner", file);
    let gyroscope = |file: &str| with(&of("gyroscope", "calibration.toml"), "gyroscope", file);
    let simulation = of("shared_scanner", "simulation.toml");
    let drive = simulation.find("[simulate.drive").unwrap()..simulation.find("# For `kalmems").unwrap();
    let mut recorded = simulation.clone();
    let table = "[simulate.drive.recorded]\nfile = \"FILE\"\nclock = { column = \"time_s\" }\ncolumn = \"drive_V\"\n\n";
    recorded.replace_range(drive, table);
    let interferogram = "name = \"s\"\n[interferogram]\nfile = \"known.csv\"\ncolumns = [\"detector_1\"]\nclock = { rate = \"1 kHz\" }\n\
                         [path.trajectory]\nfile = \"known.csv\"\nclock = { column = \"time_s\" }\ncolumn = \"position_m\"\n\
                         [transform]\nlargest_path_difference = \"0.95 mm\"\napodisation = \"boxcar\"\nphase = \"power\"\nband = { from = \"1500 1/cm\", to = \"2500 1/cm\" }\n[reference]\n\
                         band = { from = \"1500 1/cm\", to = \"2500 1/cm\" }\n[reference.spectrum]\nfile = \"known.csv\"\n\
                         wavenumber = \"wavenumber_per_cm\"\ncolumn = \"height\"\n";
    let spectrum = |number: usize| {
        let mut parts: Vec<String> = interferogram.split("known.csv").map(str::to_owned).collect();
        let behind = parts.split_off(number + 1);
        format!("{}FILE{}", parts.join("known.csv"), behind.join("known.csv"))
    };
    let calibrate = vec!["calibrate", "gyro"];
    vec![
        ("a recording", vec!["estimate"], scanner("experiment.toml", "recording.csv")),
        ("a reference", vec!["estimate"], scanner("experiment.toml", "reference.csv")),
        (
            "a recording to identify from",
            vec!["identify"],
            scanner("ring_down.toml", "ring_down_recording.csv"),
        ),
        ("a recorded drive", vec!["simulate"], recorded),
        ("records of a gyroscope", calibrate.clone(), gyroscope("gyro.csv")),
        ("records of a vibrometer", calibrate.clone(), gyroscope("vibrometer.csv")),
        ("a record at rest", calibrate, gyroscope("rest.csv")),
        ("intensities", vec!["image"], scanner("image.toml", "image_intensity.csv")),
        ("a trajectory of an image", vec!["image"], scanner("image.toml", "image_trajectory.csv")),
        ("an interferogram", vec!["spectrum"], spectrum(0)),
        ("a trajectory of a spectrum", vec!["spectrum"], spectrum(1)),
        ("a known spectrum", vec!["spectrum"], spectrum(2)),
    ]
}

/// A folder with those settings, each in a file of its own, and what else they name.
fn folder_of_settings(settings: &[(&str, Vec<&str>, String)]) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    for (number, (_, _, text)) in settings.iter().enumerate() {
        std::fs::write(folder.path().join(format!("{number}.toml")), text).unwrap();
    }
    let rows: String =
        (0..200).fold("time_s,position_m,detector_1,wavenumber_per_cm,height\n".to_owned(), |text, k| {
            let time_s = 1e-3 * f64::from(k);
            let position = 1e-3 * (std::f64::consts::TAU * 20.0 * time_s).cos();
            format!("{text}{time_s},{position},{},{},1\n", (0.6 * f64::from(k)).cos(), 1000 + 10 * k)
        });
    std::fs::write(folder.path().join("known.csv"), rows).unwrap();
    folder
}

/// A file that was not meant shows nothing of itself, whatever named it.
#[test]
#[ignore = "long: `.ci/run --all` runs it"]
fn long_a_file_of_another_kind_is_not_quoted() {
    let settings = settings_with_a_file();
    let folder = folder_of_settings(&settings);
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let quotes = |output: &Output| {
        let all = format!("{}{}", String::from_utf8_lossy(&output.stdout), said(output));
        all.to_lowercase().contains("swordfish").then_some(all)
    };
    for (turn, (name, text)) in CANARIES.into_iter().enumerate() {
        std::fs::write(path("FILE"), text).unwrap();
        for (number, (kind, command, _)) in settings.iter().enumerate() {
            // One reader reads for all of these settings: the first text is met by each, and each further one by two of them.
            if turn > 0 && ![turn - 1, (turn + 5) % settings.len()].contains(&number) {
                continue;
            }
            let file = path(&format!("{number}.toml"));
            let output =
                run(&[command.as_slice(), &[&file, "--out", &path(&format!("out{number}"))]].concat());
            assert_eq!(quotes(&output), None, "{name} as {kind}");
            assert_eq!(output.status.code(), Some(1), "{name} as {kind}: {}", said(&output));
            assert!(said(&output).contains("expected"), "{name} as {kind}: {}", said(&output));
        }
        let output = run(&["inspect", &path("FILE")]);
        assert_eq!((output.status.code(), quotes(&output)), (Some(1), None), "{name}");
        // The settings themselves, and samples that arrive.
        for command in ["estimate", "identify", "simulate", "image", "spectrum", "study"] {
            let output = run(&[command, &path("FILE"), "--out", &path("out")]);
            assert_ne!(output.status.code(), Some(0), "{command} {name}");
            assert_eq!(quotes(&output), None, "{command} {name}");
        }
        let stream = run(&["stream", "examples/shared_scanner/stream.toml", "--from", &path("FILE")]);
        assert_eq!(quotes(&stream), None, "stream {name}");
    }
    // As arrays, which it is not.
    std::fs::write(path("other.npz"), CANARIES[2].1).unwrap();
    let output = run(&["inspect", &path("other.npz")]);
    assert_eq!((output.status.code(), quotes(&output)), (Some(1), None));
}

/// What a table of numbers is called, and what is wrong in it, is told all the same.
#[test]
fn a_table_of_numbers_is_quoted_where_that_helps() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let (text, rows) = example();
    std::fs::write(path("experiment.toml"), text).unwrap();
    let estimate = ["estimate", &path("experiment.toml"), "--out", &path("out")];
    std::fs::write(path("recording.csv"), rows.replace("cap_V", "capacitance")).unwrap();
    let why = refused(&estimate, folder.path());
    assert!(why.contains("there are `time_s`, `drive_V`, `capacitance`"), "{why}");
    std::fs::write(path("recording.csv"), rows.replacen("\n0.000500,", "\nlate,", 1)).unwrap();
    let why = refused(&estimate, folder.path());
    assert!(why.contains("`late` is no time"), "{why}");
}

/// The table that names a file has another name in each kind of settings.
#[test]
fn advice_on_a_text_without_names_fits_the_settings_that_name_it() {
    let settings = settings_with_a_file();
    let folder = folder_of_settings(&settings);
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    for (text, expected) in [
        ("0,1\n1,2\n2,3\n", "write such a `format` in the table that names the file"),
        ("a,b;c\n1,2;3\n", "separator = \",\" }` in the table that names the file"),
    ] {
        std::fs::write(path("FILE"), text).unwrap();
        for (number, (kind, command, _)) in settings.iter().enumerate() {
            let file = path(&format!("{number}.toml"));
            let out = path(&format!("out{number}"));
            let why = refused(&[command.as_slice(), &[&file, "--out", &out]].concat(), folder.path());
            assert!(why.contains(expected) && !why.contains("[[recording]]"), "{kind}: {why}");
        }
    }
}

/// Columns that the reader leaves out are in the file all the same: what `inspect` says of them, `estimate` says where one of
/// them is asked for.
#[test]
fn a_column_that_is_left_out_is_refused_with_the_reason() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let file = root().join("crates/kalmems-formats/tests/fixtures/refused.h5");
    std::fs::copy(file, path("refused.h5")).unwrap();
    let (text, _) = example();
    let mut all = String::new();
    for [drive, signal] in [["complex", "virtual"], ["raw", "gone"], ["far", "cube"], ["image", "rate"]] {
        let channels = format!(
            "clock = {{ column = \"time_s\" }}\nchannels = {{ drive = {{ column = \"{drive}\", unit = \"V\" }}, \
             signal = \"{signal}_V\" }}"
        );
        let text = text.replace("recording.csv", "refused.h5").replace(PLAIN, &channels);
        std::fs::write(path("experiment.toml"), text).unwrap();
        all += &refused(&["estimate", &path("experiment.toml"), "--out", &path("out")], folder.path());
    }
    insta::assert_snapshot!(all);
}

#[test]
fn no_estimate_and_no_usable_recording_are_no_success() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    std::fs::write(path("twice.csv"), "time_s,cap_V\n0,1\n1,2\n1,3\n").unwrap();
    let output = run(&["inspect", &path("twice.csv")]);
    assert_eq!(output.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&output.stdout).contains("cannot be used as a recording"));
    assert!(said(&output).contains("cannot be used as a recording"), "{}", said(&output));
    // A readout with the wrong sign: nothing can follow it.
    let (text, rows) = example();
    std::fs::write(path("recording.csv"), rows).unwrap();
    let model = text.find("[[estimate.filter]]").unwrap();
    let second = text.find("[[estimate.filter]]\nname = \"EKF\"").unwrap();
    let text = format!("{}{}", &text[..model], &text[second..]).replace("-0.3574 V/pF", "0.3574 V/pF");
    std::fs::write(path("experiment.toml"), text).unwrap();
    let why = refused(&["estimate", &path("experiment.toml"), "--out", &path("out")], folder.path());
    assert!(why.contains("no filter gave an estimate"), "{why}");
    assert!(folder.path().join("out/metrics.json").is_file());
}

/// An array of rows without names, as `numpy.save` writes it.
fn npy(rows: &[Vec<f64>]) -> Vec<u8> {
    let shape = (rows.len(), rows[0].len());
    let mut header = format!("{{'descr': '<f8', 'fortran_order': False, 'shape': {shape:?}, }}");
    while (header.len() + 11) % 64 != 0 {
        header.push(' ');
    }
    header.push('\n');
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend(u16::try_from(header.len()).unwrap().to_le_bytes());
    bytes.extend(header.bytes());
    bytes.extend(rows.iter().flatten().flat_map(|number| number.to_le_bytes()));
    bytes
}

/// The numbers of a CSV as an array without names.
fn as_npy(csv: &Path) -> Vec<u8> {
    let text = std::fs::read_to_string(csv).unwrap();
    let row = |line: &str| line.split(',').map(|cell| cell.parse().unwrap()).collect();
    npy(&text.lines().skip(1).map(row).collect::<Vec<Vec<f64>>>())
}

#[test]
#[ignore = "long: `.ci/run --all` runs it"]
fn long_calibrate_takes_formats_and_columns_as_estimate_does() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let example = root().join("examples/gyroscope");
    let text = std::fs::read_to_string(example.join("calibration.toml")).unwrap();
    for file in ["gyro.csv", "vibrometer.csv", "rest.csv"] {
        std::fs::copy(example.join(file), folder.path().join(file)).unwrap();
    }
    std::fs::write(path("rest.npy"), as_npy(&example.join("rest.csv"))).unwrap();
    let vibrometer = std::fs::read_to_string(example.join("vibrometer.csv")).unwrap();
    std::fs::write(path("own.csv"), vibrometer.replacen("ldv_V", "ldv", 1)).unwrap();
    std::fs::write(path("calibration.toml"), &text).unwrap();
    let own = text
        .replace("file = \"rest.csv\"", "file = \"rest.npy\"\nformat = { kind = \"npy\", columns = [\"w\"] }")
        .replace("\"gyro_y_rad_per_s\"", "{ column = \"w\", unit = \"rad/s\" }")
        .replace("\"vibrometer.csv\"", "\"own.csv\"")
        .replace("\"ldv_V\"", "{ column = \"ldv\", unit = \"mV\", scale = 1000 }");
    std::fs::write(path("own.toml"), own).unwrap();
    let [plain, own] = ["calibration", "own"].map(|name| -> serde_json::Value {
        let file = path(&format!("{name}.toml"));
        serde_json::from_str(&done(&["calibrate", "gyro", &file, "--out", &path(name), "--json"])).unwrap()
    });
    assert!(plain["results"].is_array() && plain["rest"].is_array(), "{plain}");
    // With blanks between the cells.
    std::fs::write(path("blanks.txt"), vibrometer.replace(',', " ")).unwrap();
    std::fs::write(path("blanks.toml"), text.replace("\"vibrometer.csv\"", "\"blanks.txt\"")).unwrap();
    let blanks = done(&["calibrate", "gyro", &path("blanks.toml"), "--out", &path("blanks"), "--json"]);
    let blanks: serde_json::Value = serde_json::from_str(&blanks).unwrap();
    assert_eq!((&plain["results"], &plain["rest"]), (&blanks["results"], &blanks["rest"]));
    assert_eq!((&plain["results"], &plain["rest"]), (&own["results"], &own["rest"]));
    assert!(own["findings"].to_string().contains("its numbers are in `mV`, times `1000`"), "{own}");
}

#[test]
fn image_takes_formats_and_columns_as_estimate_does() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let example = root().join("examples/shared_scanner");
    let text = std::fs::read_to_string(example.join("image.toml")).unwrap();
    // A search would take its time.
    let text = text.replace("search = ", "# search = ");
    for file in ["image_intensity.csv", "image_trajectory.csv"] {
        std::fs::copy(example.join(file), folder.path().join(file)).unwrap();
    }
    std::fs::write(path("i.npy"), as_npy(&example.join("image_intensity.csv"))).unwrap();
    let trajectory = std::fs::read_to_string(example.join("image_trajectory.csv")).unwrap();
    std::fs::write(path("own.csv"), trajectory.replacen("time_us,x_mrad,y_mrad", "t,x,y", 1)).unwrap();
    let own = text
        .replace(
            "file = \"image_intensity.csv\"",
            "file = \"i.npy\"\nformat = { kind = \"npy\", columns = [\"i\"] }",
        )
        .replace("\"intensity_1\"", "{ column = \"i\", unit = \"1\" }")
        .replace("image_trajectory.csv", "own.csv")
        .replace("{ column = \"time_us\" }", "{ column = \"t\", unit = \"us\" }")
        .replace("\"x_mrad\"", "{ column = \"x\", unit = \"mrad\" }")
        .replace("\"y_mrad\"", "{ column = \"y\", unit = \"rad\", scale = 0.001 }");
    // With blanks between the cells.
    std::fs::write(path("blanks.txt"), trajectory.replace(',', "  ")).unwrap();
    let blanks = text.replace("image_trajectory.csv", "blanks.txt");
    let names = ["image", "own", "blanks"];
    for (name, text) in names.into_iter().zip([&text, &own, &blanks]) {
        std::fs::write(path(&format!("{name}.toml")), text).unwrap();
        done(&["image", &path(&format!("{name}.toml")), "--out", &path(name)]);
    }
    let [plain, own, blanks] =
        names.map(|name| std::fs::read(Path::new(&path(name)).join("image.png")).unwrap());
    assert!(plain == own && plain == blanks && !plain.is_empty());
}

#[test]
fn spectrum_takes_formats_and_columns_as_estimate_does() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let rows: Vec<Vec<f64>> = (-512..512)
        .map(|k| {
            let x = f64::from(k) * 0.5e-6;
            vec![(std::f64::consts::TAU * 2e5 * x).cos() * (-(x / 1e-4).powi(2)).exp()]
        })
        .collect();
    std::fs::write(path("i.npy"), npy(&rows)).unwrap();
    let csv: Vec<String> = rows.iter().map(|row| format!("{}\n", row[0])).collect();
    std::fs::write(path("i.csv"), format!("detector_1\n{}", csv.concat())).unwrap();
    let known: Vec<String> =
        (1000..3000).map(|nu| format!("{nu},{}\n", f64::from((nu - 2000_i32).pow(2)))).collect();
    std::fs::write(path("known.csv"), format!("wavenumber_per_cm,height\n{}", known.concat())).unwrap();
    std::fs::write(path("nu.csv"), format!("nu,height\n{}", known.concat())).unwrap();
    let blanks = format!("wavenumber_per_cm height\n{}", known.concat().replace(',', "\t"));
    std::fs::write(path("blanks.txt"), blanks).unwrap();
    let text = "name = \"s\"\n[interferogram]\nfile = \"i.csv\"\ncolumns = [\"detector_1\"]\n[path]\nstep = \"0.5 um\"\n[transform]\n\
                apodisation = \"boxcar\"\nphase = \"power\"\n[reference]\nband = { from = \"1500 1/cm\", to = \"2500 1/cm\" }\n\
                [reference.spectrum]\nfile = \"known.csv\"\nwavenumber = \"wavenumber_per_cm\"\ncolumn = \"height\"\n";
    let own = text
        .replace("file = \"i.csv\"", "file = \"i.npy\"\nformat = { kind = \"npy\", columns = [\"d\"] }")
        .replace("[\"detector_1\"]", "[{ column = \"d\", unit = \"1\" }]")
        .replace("known.csv", "nu.csv")
        .replace("\"wavenumber_per_cm\"", "{ column = \"nu\", unit = \"1/cm\" }");
    let blanks = text.replace("known.csv", "blanks.txt");
    let [plain, own, blanks] =
        [("s", text), ("own", &own), ("blanks", &blanks)].map(|(name, text)| -> serde_json::Value {
            std::fs::write(path(&format!("{name}.toml")), text).unwrap();
            let file = path(&format!("{name}.toml"));
            serde_json::from_str(&done(&["spectrum", &file, "--out", &path(name), "--json"])).unwrap()
        });
    assert!(plain["reference"]["rms_over_peak"].is_number(), "{plain}");
    assert_eq!(plain["reference"], own["reference"]);
    assert_eq!(plain["reference"], blanks["reference"]);
    // The schema asks for this name, so that nothing is found about its unit.
    assert!(!plain["findings"].to_string().contains("wavenumber_per_cm"), "{plain}");
}

#[test]
fn where_the_times_count_from_stands_in_metrics_report_and_record_of_the_run() {
    let folder = tempfile::tempdir().unwrap();
    let (_, rows) = example();
    let mut epoch = "time_unix_s,drive_V,cap_V\n".to_owned();
    for row in rows.lines().skip(1) {
        let (time, cells) = row.split_once(',').unwrap();
        let (whole, part) = time.split_once('.').unwrap();
        writeln!(epoch, "{}.{part},{cells}", 1_763_834_400 + whole.parse::<u64>().unwrap()).unwrap();
    }
    std::fs::write(folder.path().join("recording.csv"), &rows).unwrap();
    std::fs::write(folder.path().join("epoch.csv"), epoch).unwrap();
    let channels = PLAIN.replace("time_s", "time_unix_s");
    let expected = trajectory(&folder, "recording.csv", PLAIN);
    assert!(trajectory(&folder, "epoch.csv", &channels) == expected);
    let text = |name: &str| std::fs::read_to_string(folder.path().join("out-epoch.csv").join(name)).unwrap();
    let metrics: serde_json::Value = serde_json::from_str(&text("metrics.json")).unwrap();
    let origin = &metrics["recordings"][0]["origin"];
    assert_eq!(origin["seconds"], "1763834400", "{origin}");
    assert_eq!(origin["utc"], "2025-11-22T18:00:00Z", "{origin}");
    assert!(text("report.html").contains("2025-11-22T18:00:00Z"));
    assert!(text("run.toml").contains("1763834400"), "{}", text("run.toml"));
}

/// What a message says to write is taken by `inspect` and by `new`, which writes it into the experiment.
#[test]
fn what_a_message_asks_for_is_an_argument_of_inspect_and_new_and_stands_in_the_experiment() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let (_, rows) = example();
    let body = || rows.lines().skip(1);
    std::fs::write(path("bare.csv"), body().fold(String::new(), |text, row| text + row + "\n")).unwrap();
    let message = refused(&["inspect", &path("bare.csv")], folder.path());
    assert!(message.contains("columns = [\"time_s\"") && message.contains("`--columns`"), "{message}");
    let names = "time_s,drive_V,cap_V";
    assert!(done(&["inspect", &path("bare.csv"), "--columns", names]).contains("cap_V"));
    let two = "time_s;drive,V;cap,V\n".to_owned()
        + &body().take(50).fold(String::new(), |text, row| text + &row.replace(',', ";") + "\n");
    std::fs::write(path("two.csv"), two.replace("drive,V", "drive_V,x").replace("cap,V", "cap_V")).unwrap();
    let columns = done(&["inspect", &path("two.csv"), "--separator", ";"]);
    assert!(columns.contains("50 rows") && columns.contains("cap_V"), "{columns}");
    let rated = done(&["inspect", &path("bare.csv"), "--columns", "n,drive_V,cap_V", "--rate", "1 MHz"]);
    assert!(rated.contains("follow each other at 1 MHz, as stated"), "{rated}");
    let written = path("bare.toml");
    let arguments =
        ["new", &path("bare.csv"), "--columns", names, "--device", "shared_scanner", "--write", &written];
    done(&arguments);
    let text = std::fs::read_to_string(&written).unwrap();
    let format = "format = { kind = \"csv\", columns = [\"time_s\", \"drive_V\", \"cap_V\"] }";
    assert!(text.contains(format), "{text}");
}

/// A number that says overload while the filter settles is a missing sample like any other, and takes none of its neighbours along.
#[test]
fn an_overload_within_the_settling_time_costs_one_sample() {
    let folder = tempfile::tempdir().unwrap();
    let (_, rows) = example();
    let with = |cell: &str| {
        let replaced = rows.lines().enumerate().map(|(line, row)| match row.rsplit_once(',') {
            Some((before, _)) if line == 101 => format!("{before},{cell}\n"),
            _ => format!("{row}\n"),
        });
        replaced.collect::<String>()
    };
    for (name, text) in
        [("whole.csv", rows.clone()), ("over.csv", with("9.90000000E+37")), ("empty.csv", with(""))]
    {
        std::fs::write(folder.path().join(name), text).unwrap();
    }
    let rows_without_a_number = |trajectory: &str| {
        let has_empty = |row: &&str| row.split(',').any(str::is_empty);
        trajectory.lines().filter(has_empty).count()
    };
    let [whole, over, empty] =
        ["whole.csv", "over.csv", "empty.csv"].map(|file| trajectory(&folder, file, PLAIN));
    assert!(over == empty, "an overload is an empty cell");
    assert_eq!(rows_without_a_number(&over), rows_without_a_number(&whole) + 1);
    assert_eq!(over.lines().count(), whole.lines().count());
}

/// A stated range counts in an estimate as in any command: what is at its end is predicted and not taken.
#[test]
fn a_stated_full_scale_takes_samples_out_of_an_estimate() {
    let folder = tempfile::tempdir().unwrap();
    let (_, rows) = example();
    let railed: Vec<String> = rows
        .lines()
        .enumerate()
        .map(|(line, row)| match row.rsplit_once(',') {
            Some((before, _)) if (500..503).contains(&line) => format!("{before},5.5"),
            _ => row.to_owned(),
        })
        .collect();
    let empty: Vec<String> = rows
        .lines()
        .enumerate()
        .map(|(line, row)| match row.rsplit_once(',') {
            Some((before, _)) if (500..503).contains(&line) => format!("{before},"),
            _ => row.to_owned(),
        })
        .collect();
    for (name, rows) in [("railed.csv", railed), ("empty.csv", empty)] {
        std::fs::write(folder.path().join(name), rows.join("\n") + "\n").unwrap();
    }
    let stated = "clock = { column = \"time_s\" }\nchannels = { drive = \"drive_V\", signal = { column = \"cap_V\", full_scale \
                  = \"5.5 V\" } }";
    assert_eq!(trajectory(&folder, "railed.csv", stated), trajectory(&folder, "empty.csv", PLAIN));
}
