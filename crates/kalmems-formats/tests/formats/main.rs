//! The same recording from every format: `fixtures/make.py` wrote it with each format's reference tool, and as a text
//! that the standard library parses here. Every number is compared bit by bit.

mod hostile;
mod times;

use kalmems_formats::{
    Block, Fault, Format, FormatError, Hints, Table, Wanted, has_more_rows, open, open_reader,
};
use std::collections::HashMap;
use std::io::Cursor;
use std::path::{Path, PathBuf};

fn fixture(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures").join(name)
}

fn group(path: &str) -> Hints {
    Hints { group: Some(path.to_owned()), ..Hints::default() }
}

fn named(names: &[&str]) -> Hints {
    Hints { columns: Some(names.iter().map(|name| (*name).to_owned()).collect()), ..Hints::default() }
}

/// The reference: cells as text.
fn reference() -> HashMap<String, Vec<String>> {
    let text = std::fs::read_to_string(fixture("reference.csv")).unwrap();
    let mut lines = text.lines();
    let names: Vec<&str> = lines.next().unwrap().split(',').collect();
    let mut columns: HashMap<String, Vec<String>> = HashMap::new();
    for line in lines {
        for (name, cell) in names.iter().zip(line.split(',')) {
            columns.entry((*name).to_owned()).or_default().push(cell.to_owned());
        }
    }
    assert_eq!(columns["time_s"].len(), 120);
    columns
}

/// What a table holds: numbers and labels in the order in which they were wanted, and faults.
#[derive(Default)]
struct Content {
    numbers: Vec<Vec<f64>>,
    labels: Vec<Vec<String>>,
    faults: Vec<(u64, Option<usize>, Fault)>,
}

fn content(table: &mut dyn Table, wanted: &[Wanted], capacity: usize) -> Result<Content, FormatError> {
    table.want(wanted)?;
    let mut block = Block::with_capacity(capacity);
    let mut content = Content::default();
    let mut row = 0;
    loop {
        table.read(&mut block)?;
        if block.is_end() {
            return Ok(content);
        }
        assert!(block.rows <= capacity && block.lines[0] == (0, row + 1));
        content.numbers.resize_with(block.numbers.len(), Vec::new);
        for (all, some) in content.numbers.iter_mut().zip(&block.numbers) {
            assert_eq!(some.len(), block.rows);
            all.extend(some);
        }
        content.labels.resize_with(block.labels.len(), Vec::new);
        for (all, some) in content.labels.iter_mut().zip(&block.labels) {
            assert_eq!(some[0].0, 0, "a block begins with a label");
            let ends = some.iter().skip(1).map(|(start, _)| *start).chain([block.rows]);
            for ((start, label), end) in some.iter().zip(ends) {
                let label = String::from_utf8(label.clone()).unwrap();
                all.extend(std::iter::repeat_n(label, end - start));
            }
        }
        content
            .faults
            .extend(block.faults.iter().map(|fault| (fault.line, fault.column, fault.fault.clone())));
        row += block.rows as u64;
    }
}

fn column(table: &dyn Table, name: &str) -> usize {
    let columns = &table.description().columns;
    columns.iter().position(|c| c.name == name).unwrap_or_else(|| panic!("no `{name}` in {columns:?}"))
}

/// Compares columns of a fixture with the reference: as they are, and as thousandths.
fn compare(name: &str, hints: &Hints, columns: &[&str]) {
    let reference = reference();
    for (power, capacity) in [(0, 37), (-3, 1000), (0, 1)] {
        let mut table = open(&fixture(name), hints).unwrap_or_else(|error| panic!("{name}: {error}"));
        let wanted: Vec<Wanted> = columns
            .iter()
            .map(|column_name| match *column_name {
                "phase" | "words" | "letters" | "code" => {
                    Wanted::Label { column: column(&*table, column_name) }
                }
                _ => Wanted::Number { column: column(&*table, column_name), power },
            })
            .collect();
        let content =
            content(&mut *table, &wanted, capacity).unwrap_or_else(|error| panic!("{name}: {error}"));
        assert!(content.faults.is_empty(), "{name}: {:?}", content.faults);
        let (mut numbers, mut labels) = (content.numbers.iter(), content.labels.iter());
        for column in columns {
            if matches!(*column, "phase" | "words" | "letters" | "code") {
                assert_eq!(labels.next().unwrap(), &reference["phase"], "{name}: {column}");
                continue;
            }
            let found = numbers.next().unwrap();
            assert_eq!(found.len(), 120, "{name}: {column}");
            for (row, (found, text)) in found.iter().zip(&reference[*column]).enumerate() {
                let expected: f64 = match (power, text.split_once('e')) {
                    (0, _) => text.parse().unwrap(),
                    (_, None) => format!("{text}e{power}").parse().unwrap(),
                    (_, Some((digits, exponent))) => {
                        format!("{digits}e{}", exponent.parse::<i32>().unwrap() + power).parse().unwrap()
                    }
                };
                assert_eq!(
                    found.to_bits(),
                    expected.to_bits(),
                    "{name}: {column} in row {row}, {text}e{power}"
                );
            }
        }
    }
}

const NUMBERS: [&str; 3] = ["time_s", "drive_V", "cap_V"];
const ALL: [&str; 6] = ["time_s", "drive_V", "cap_V", "temperature_K", "count_1", "phase"];

#[test]
fn npy_is_the_text() {
    for name in ["plain.npy", "fortran.npy", "swapped.npy"] {
        compare(name, &named(&NUMBERS), &NUMBERS);
    }
    compare("fields.npy", &Hints::default(), &ALL);
    compare("fields.npy", &Hints::default(), &["code", "cap_V", "phase"]);
    compare("aligned.npy", &Hints::default(), &["count_1", "cap_V"]);
}

#[test]
fn npz_is_the_text() {
    for name in ["stored.npz", "deflated.npz"] {
        compare(name, &Hints::default(), &ALL);
    }
    compare("matrix.npz", &Hints { group: Some("run".to_owned()), ..named(&NUMBERS) }, &NUMBERS);
}

#[test]
fn parquet_is_the_text() {
    for name in ["none", "snappy", "gzip", "lz4", "zstd", "polars", "groups", "encoded", "sums"] {
        compare(&format!("{name}.parquet"), &Hints::default(), &ALL);
    }
}

#[test]
fn a_null_is_missing() {
    let mut table = open(&fixture("missing.parquet"), &Hints::default()).unwrap();
    let wanted = [Wanted::Number { column: 1, power: 0 }, Wanted::Number { column: 0, power: 0 }];
    let content = content(&mut *table, &wanted, 50).unwrap();
    let lines: Vec<u64> = (0..120).filter(|k| k % 7 == 2).map(|k| k + 1).collect();
    assert_eq!(content.faults, lines.iter().map(|line| (*line, Some(1), Fault::Missing)).collect::<Vec<_>>());
    for (row, text) in reference()["cap_V"].iter().enumerate() {
        let expected = if row % 7 == 2 { f64::NAN } else { text.parse().unwrap() };
        assert_eq!(content.numbers[0][row].to_bits(), expected.to_bits());
    }
}

#[test]
fn hdf5_is_the_text() {
    for name in ["columns.h5", "links.h5"] {
        // The only group with columns, and the same by its path; units from attributes.
        compare(name, &Hints::default(), &ALL);
        compare(name, &group("/rig"), &["words", "cap_V"]);
    }
    compare("table.h5", &Hints::default(), &NUMBERS);
    compare("compound.h5", &Hints::default(), &ALL);
    compare("several.h5", &group("/b"), &["time_s"]);
    compare("many.h5", &Hints::default(), &NUMBERS);
}

#[test]
fn mat_is_the_text() {
    compare("variables.mat", &Hints::default(), &ALL);
    compare("variables.mat", &Hints::default(), &["letters", "cap_V"]);
    compare("packed.mat", &Hints::default(), &ALL);
    compare("struct.mat", &Hints::default(), &ALL);
    compare("struct.mat", &group("rig"), &ALL);
    compare("matrix.mat", &named(&NUMBERS), &NUMBERS);
    compare("swapped.mat", &Hints::default(), &["time_s", "drive_V", "cap_V", "count_1"]);
}

#[test]
fn mat_73_is_the_text() {
    compare("variables73.mat", &Hints::default(), &ALL);
    compare("variables73.mat", &Hints::default(), &["letters", "cap_V"]);
    compare("struct73.mat", &Hints::default(), &ALL);
    compare("struct73.mat", &group("rig"), &["letters"]);
    compare("matrix73.mat", &Hints { group: Some("run".to_owned()), ..named(&NUMBERS) }, &NUMBERS);
}

#[test]
fn tdms_is_the_text() {
    compare("segments.tdms", &Hints::default(), &ALL);
    for name in ["interleaved.tdms", "chunks.tdms", "swapped.tdms"] {
        compare(name, &group("rig"), &["time_s", "drive_V", "cap_V", "temperature_K", "count_1"]);
    }
}

#[test]
fn a_clock_of_the_file_becomes_the_time() {
    let mut table = open(&fixture("clock.tdms"), &Hints::default()).unwrap();
    assert!(
        table.description().recognised.contains("time_s = 0.25 s + k·"),
        "{}",
        table.description().recognised
    );
    assert_eq!(column(&*table, "time_s"), 0);
    let wanted = [Wanted::Number { column: 0, power: 0 }, Wanted::Number { column: 1, power: 0 }];
    let content = content(&mut *table, &wanted, 50).unwrap();
    for (k, time) in content.numbers[0].iter().enumerate() {
        assert_eq!(*time, 0.25 + k as f64 * (1.0 / 48_000.0));
    }
    assert_eq!(content.numbers[0].len(), 120);
    compare("clock.tdms", &Hints::default(), &["drive_V", "cap_V"]);
}

#[test]
fn of_a_recording_that_was_not_ended_whole_rows_are_read() {
    // 20 rows of 32 bytes and 11 bytes more are missing: the 100th row is cut.
    let mut table = open(&fixture("cut.tdms"), &Hints::default()).unwrap();
    assert_eq!(table.description().rows, Some(99));
    assert!(table.description().recognised.contains("was not ended"));
    let wanted = [Wanted::Number { column: column(&*table, "cap_V"), power: 0 }];
    let content = content(&mut *table, &wanted, 50).unwrap();
    for (found, text) in content.numbers[0].iter().zip(&reference()["cap_V"]) {
        assert_eq!(found.to_bits(), text.parse::<f64>().unwrap().to_bits());
    }
    assert_eq!(content.numbers[0].len(), 99);
}

#[test]
fn sound_is_in_parts_of_full_scale() {
    // The same by NumPy, two columns for each kind of sample.
    let names: Vec<String> = (0..10).map(|column| format!("c{column}_1")).collect();
    let hints = Hints { columns: Some(names), ..Hints::default() };
    let mut table = open(&fixture("sound.npy"), &hints).unwrap();
    let wanted: Vec<Wanted> = (0..10).map(|column| Wanted::Number { column, power: 0 }).collect();
    let expected = content(&mut *table, &wanted, 120).unwrap().numbers;
    for (place, name) in ["u8", "i16", "i32", "f32", "f64"].iter().enumerate() {
        let mut table = open(&fixture(&format!("{name}.wav")), &Hints::default()).unwrap();
        assert!(table.description().recognised.contains("time_s = k/(48000 Hz)"));
        let wanted: Vec<Wanted> = (0..3).map(|column| Wanted::Number { column, power: 0 }).collect();
        let found = content(&mut *table, &wanted, 50).unwrap().numbers;
        assert_eq!(found[0], (0..120).map(|k| f64::from(k) / 48_000.0).collect::<Vec<f64>>());
        assert_eq!(found[1..], expected[2 * place..2 * place + 2], "{name}");
    }
    for name in ["i24", "rf64", "bw64"] {
        let mut table = open(&fixture(&format!("{name}.wav")), &named(&["cap_V", "drive_V"])).unwrap();
        let wanted =
            ["cap_V", "drive_V"].map(|name| Wanted::Number { column: column(&*table, name), power: 0 });
        let found = content(&mut *table, &wanted, 50).unwrap().numbers;
        for (found, expected) in found.iter().zip(&expected[4..6]) {
            // The upper 24 bits of 32.
            let cut: Vec<f64> = expected.iter().map(|x| (x * 8_388_608.0).floor() / 8_388_608.0).collect();
            assert_eq!(*found, cut, "{name}");
        }
    }
}

#[test]
fn what_is_read_is_said() {
    for (name, hints, format, words) in [
        ("stored.npz", Hints::default(), "NPZ", "6 arrays, a column each; left out: `rate` (shape ())"),
        ("fields.npy", Hints::default(), "NPY", "`skipped` (complex numbers), `pair` (an array in each row)"),
        ("table.h5", Hints::default(), "HDF5", "`/run` of 120 rows and 3 columns"),
        ("struct.mat", Hints::default(), "MAT 5", "the fields of the only struct, `rig`, a column each"),
        ("variables73.mat", Hints::default(), "MAT 7.3", "the variables, a column each"),
        ("i24.wav", Hints::default(), "WAV", "2 channels of integers in 24 bits, in parts of full scale"),
        ("groups.parquet", Hints::default(), "Parquet", "120 rows in 3 groups"),
        ("segments.tdms", Hints::default(), "TDMS", "the channels of the group `rig`, a column each"),
    ] {
        let table = open(&fixture(name), &hints).unwrap();
        assert_eq!(table.description().format, format);
        let recognised = &table.description().recognised;
        assert!(recognised.contains(words), "{name}: {recognised}");
    }
}

fn refusal(result: Result<Box<dyn Table>, FormatError>) -> String {
    match result {
        Ok(table) => panic!("read as {:?}", table.description()),
        Err(error) => error.to_string(),
    }
}

#[test]
fn what_is_ambiguous_is_refused_with_what_to_write() {
    for (name, hints, words) in [
        (
            "plain.npy",
            Hints::default(),
            "write their names, such as `format = { kind = \"npy\", columns = [\"time_s\", \"cap_V\"] }`",
        ),
        ("plain.npy", named(&["time_s", "cap_V"]), "3 columns with 2 names"),
        ("several.h5", Hints::default(), "write `group` as one of `/a`, `/b`"),
        ("newest.h5", Hints::default(), "laid out by version 5 of the format"),
        ("several.h5", group("/c"), "`/c`, which is not in the file"),
        ("matrix.npz", Hints::default(), "name a 2-D one by `group`"),
        ("stored.npz", group("nothing"), "`nothing`, which is not in the file"),
        ("matrix.mat", Hints::default(), "3 columns with 0 names"),
        ("matrix73.mat", group("/run"), "3 columns with 0 names"),
        ("segments.tdms", group("stage"), "write one of `rig`"),
        ("segments.tdms", named(&["cap_V", "left_V"]), "a name `left_V` for a file with names of its own"),
        ("i16.wav", named(&["left_1"]), "2 channels with 1 names"),
    ] {
        let found = refusal(open(&fixture(name), &hints));
        assert!(found.contains(words), "{name}: {found}");
    }
}

#[test]
fn names_and_contents_that_contradict_are_refused() {
    let bytes = |name: &str| Cursor::new(std::fs::read(fixture(name)).unwrap());
    let read = |name: &str, called: &str| open_reader(bytes(name), called, &Hints::default());
    let found = refusal(read("fields.npy", "run.csv"));
    assert!(
        found.contains("named as csv and begins as NPY")
            && found.contains("write `format = { kind = \"npy\" }`"),
        "{found}"
    );
    let found = refusal(read("reference.csv", "run.parquet"));
    assert!(found.contains("named as parquet and begins as text"), "{found}");
    // A name that promises nothing, and the format that the experiment states.
    assert_eq!(read("fields.npy", "run.dat").unwrap().description().format, "NPY");
    let hints = Hints { format: Some(Format::Npy), ..Hints::default() };
    assert_eq!(open_reader(bytes("fields.npy"), "run.csv", &hints).unwrap().description().format, "NPY");
    let hints = Hints { format: Some(Format::Mat), ..Hints::default() };
    assert_eq!(open_reader(bytes("struct73.mat"), "", &hints).unwrap().description().format, "MAT 7.3");
    // Text whose first name is the mark of Parquet.
    let text =
        open_reader(Cursor::new(b"PAR1,time_s\n1,2\n".to_vec()), "run.csv", &Hints::default()).unwrap();
    assert_eq!(text.description().format, "CSV");
    for (bytes, words) in [
        (&b"\x1f\x8b\x08\x00"[..], "unpack it first"),
        (b"TDSh\x0e\0\0\0", "name the `.tdms` file itself"),
        (b"\x00\x01\x02\x03", "begins with `\\x00\\x01\\x02\\x03`"),
    ] {
        let found = refusal(open_reader(Cursor::new(bytes.to_vec()), "run", &Hints::default()));
        assert!(found.contains(words), "{found}");
    }
}

#[test]
fn columns_that_do_not_belong_together_are_refused() {
    let mut table = open(&fixture("fields.npy"), &Hints::default()).unwrap();
    let error = table.want(&[Wanted::Number { column: column(&*table, "phase"), power: 0 }]).unwrap_err();
    assert!(error.to_string().contains("text where numbers belong, in column `phase`"), "{error}");
    let mut table = open(&fixture("snappy.parquet"), &Hints::default()).unwrap();
    let error = table.want(&[Wanted::Number { column: column(&*table, "phase"), power: 0 }]).unwrap_err();
    assert!(error.to_string().contains("text where numbers belong, in column `phase`"), "{error}");
}

/// A label may be a number.
#[test]
fn numbers_serve_as_labels() {
    for name in ["fields.npy", "none.parquet", "columns.h5", "variables.mat"] {
        let mut table = open(&fixture(name), &Hints::default()).unwrap();
        let wanted = [Wanted::Label { column: column(&*table, "count_1") }];
        let content = content(&mut *table, &wanted, 64).unwrap();
        assert_eq!(content.labels[0], reference()["count_1"], "{name}");
    }
}

/// Formats say how many rows they have; of text the lines are counted, the header among them.
#[test]
fn a_long_file_is_known_without_reading_it() {
    for (name, rows) in [
        ("fields.npy", 120),
        ("none.parquet", 120),
        ("columns.h5", 120),
        ("variables.mat", 120),
        ("segments.tdms", 120),
        ("reference.csv", 121),
    ] {
        let more_than = |most| has_more_rows(&fixture(name), &Hints::default(), most).unwrap();
        assert!(more_than(0) && more_than(rows - 1) && !more_than(rows), "{name}");
    }
    // A line may be longer than a look, and lines may be as short as can be.
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("lines.csv");
    std::fs::write(&path, format!("time_s,{}_V\n{}", "x".repeat(200_000), "\n".repeat(100_000))).unwrap();
    let more_than = |most| has_more_rows(&path, &Hints::default(), most).unwrap();
    assert!(more_than(100_000) && !more_than(100_001));
}
