//! The same recording from every format: `fixtures/make.py` wrote it with each format's reference tool, and as a text
//! that the standard library parses here. Every number is compared bit by bit.

mod clocks;
mod damage;
mod hostile;
mod no_values;
mod times;

use kalmems_formats::{
    Block, CellFinding, Format, FormatError, Hints, Table, WantedColumn, has_more_rows, open, open_reader,
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
    faults: Vec<(u64, Option<usize>, CellFinding)>,
}

fn content(table: &mut dyn Table, wanted: &[WantedColumn], capacity: usize) -> Result<Content, FormatError> {
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
        let wanted: Vec<WantedColumn> = columns
            .iter()
            .map(|column_name| match *column_name {
                "phase" | "words" | "letters" | "code" => {
                    WantedColumn::Label { column: column(&*table, column_name) }
                }
                _ => WantedColumn::Number { column: column(&*table, column_name), power },
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

/// An array of version 1 with a header, and its elements.
fn npy_array(descr: &[u8], shape: &str, elements: &[u8]) -> Vec<u8> {
    let rest = format!(", 'fortran_order': False, 'shape': {shape}, }}\n");
    let header = [b"{'descr': ", descr, rest.as_bytes()].concat();
    let length = u16::try_from(header.len()).unwrap().to_le_bytes();
    [b"\x93NUMPY\x01\x00", &length[..], &header, elements].concat()
}

/// A title beside the name of a field, the long integers of Python 2, a name in Latin-1, and numbers of 12 bytes, which are left
/// out.
#[test]
fn headers_of_older_and_other_writers_are_read() {
    let numbers = [0.25_f64, -1.5];
    let plain = numbers.map(f64::to_le_bytes).concat();
    let beside: Vec<u8> = numbers.iter().flat_map(|x| [&[0; 12][..], &x.to_le_bytes()].concat()).collect();
    for (descr, shape, elements, name) in [
        (&b"[(('capacitance', 'cap_V'), '<f8')]"[..], "(2,)", &plain, "cap_V"),
        (b"[('cap_V', '<f8')]", "(2L,)", &plain, "cap_V"),
        (b"[('cap_\xb5V', '<f8')]", "(2,)", &plain, "cap_\u{b5}V"),
        (b"[('wide', '<f12'), ('cap_V', '<f8')]", "(2,)", &beside, "cap_V"),
    ] {
        let bytes = Cursor::new(npy_array(descr, shape, elements));
        let mut table = open_reader(bytes, "", &Hints::default()).unwrap();
        let wanted = [WantedColumn::Number { column: column(&*table, name), power: 0 }];
        let found = content(&mut *table, &wanted, 50).unwrap().numbers;
        assert_eq!(found, [numbers], "{}", descr.escape_ascii());
    }
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
    let wanted = [WantedColumn::Number { column: 1, power: 0 }, WantedColumn::Number { column: 0, power: 0 }];
    let content = content(&mut *table, &wanted, 50).unwrap();
    let lines: Vec<u64> = (0..120).filter(|k| k % 7 == 2).map(|k| k + 1).collect();
    assert_eq!(
        content.faults,
        lines.iter().map(|line| (*line, Some(1), CellFinding::Missing)).collect::<Vec<_>>()
    );
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
    // As HDF5 2.0 lays out chunks, and sixty groups within one another.
    compare("newest.h5", &Hints::default(), &["cap_V"]);
    compare("deep.h5", &Hints::default(), &["time_s"]);
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
    let wanted = [WantedColumn::Number { column: 0, power: 0 }, WantedColumn::Number { column: 1, power: 0 }];
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
    let wanted = [WantedColumn::Number { column: column(&*table, "cap_V"), power: 0 }];
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
    let wanted: Vec<WantedColumn> = (0..10).map(|column| WantedColumn::Number { column, power: 0 }).collect();
    let expected = content(&mut *table, &wanted, 120).unwrap().numbers;
    for (place, name) in ["u8", "i16", "i32", "f32", "f64"].iter().enumerate() {
        let mut table = open(&fixture(&format!("{name}.wav")), &Hints::default()).unwrap();
        assert!(table.description().recognised.contains("time_s = k/(48000 Hz)"));
        let wanted: Vec<WantedColumn> =
            (0..3).map(|column| WantedColumn::Number { column, power: 0 }).collect();
        let found = content(&mut *table, &wanted, 50).unwrap().numbers;
        assert_eq!(found[0], (0..120).map(|k| f64::from(k) / 48_000.0).collect::<Vec<f64>>());
        assert_eq!(found[1..], expected[2 * place..2 * place + 2], "{name}");
    }
    for name in ["i24", "rf64", "bw64"] {
        let mut table = open(&fixture(&format!("{name}.wav")), &named(&["cap_V", "drive_V"])).unwrap();
        let wanted =
            ["cap_V", "drive_V"].map(|name| WantedColumn::Number { column: column(&*table, name), power: 0 });
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
            "write their names, such as `format = { kind = \"npy\", columns = [\"time_s\", \"ch1_V\", \"ch2_V\"] }`",
        ),
        ("plain.npy", named(&["time_s", "cap_V"]), "3 columns with 2 names"),
        ("several.h5", Hints::default(), "write `group` as one of `/a`, `/b`"),
        ("several.h5", group("/c"), "`/c`, which is not in the file"),
        ("matrix.npz", Hints::default(), "name a 2-D one by `group`"),
        ("stored.npz", group("nothing"), "`nothing`, which is not in the file"),
        ("matrix.mat", Hints::default(), "3 columns without names"),
        ("matrix73.mat", group("/run"), "3 columns without names"),
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
    let error =
        table.want(&[WantedColumn::Number { column: column(&*table, "phase"), power: 0 }]).unwrap_err();
    assert!(error.to_string().contains("text where numbers belong, in column `phase`"), "{error}");
    let mut table = open(&fixture("snappy.parquet"), &Hints::default()).unwrap();
    let error =
        table.want(&[WantedColumn::Number { column: column(&*table, "phase"), power: 0 }]).unwrap_err();
    assert!(error.to_string().contains("text where numbers belong, in column `phase`"), "{error}");
}

/// A label may be a number.
#[test]
fn numbers_serve_as_labels() {
    for name in ["fields.npy", "none.parquet", "columns.h5", "variables.mat"] {
        let mut table = open(&fixture(name), &Hints::default()).unwrap();
        let wanted = [WantedColumn::Label { column: column(&*table, "count_1") }];
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

/// What a file says of its columns by itself: names with units, texts, and what is said of them.
fn described(name: &str) -> (Vec<String>, Vec<String>, String) {
    let table = open(&fixture(name), &Hints::default()).unwrap_or_else(|error| panic!("{name}: {error}"));
    let description = table.description();
    let names = |text: bool| {
        description.columns.iter().filter(|c| c.text == text).map(|c| c.name.clone()).collect::<Vec<_>>()
    };
    (names(false), names(true), description.recognised.clone())
}

#[test]
fn units_of_hdf5_are_found_under_any_common_spelling() {
    let (names, _, _) = described("units.h5");
    for (number, name) in names[..2].iter().enumerate() {
        assert_eq!(*name, ["all[:,0]_V", "all[:,1]_V"][number]);
    }
    for (number, name) in names[2..9].iter().enumerate() {
        assert_eq!(*name, format!("c{number}_V"));
    }
    assert_eq!(names[9], "c7");
    assert_eq!(names[10..], ["t_s", "u_V", "v_V"]);
}

/// The values themselves are compared in `differential.rs`.
#[test]
fn stored_scales_and_missing_values_are_said() {
    for (name, words) in [
        ("differential/netcdf_earliest.h5", "= 0.00025·x + -0.75 of the stored x"),
        ("differential/netcdf_earliest.h5", "has no value where -32768 is stored"),
        ("differential/many_attributes_latest.h5", "`x` = 0.125·x + 0 of the stored x"),
        (
            "differential/scale_chain.tdms",
            "`x` = 0.0003·x + 0.02, then a polynomial of degree 2, then -7.5·x + 1 of the stored x",
        ),
        ("differential/scale_table.tdms", "`x` = a table of 5 points, held at its ends of the stored x"),
        ("differential/scale_of_group.tdms", "`x` = 0.5·x + 2 of the stored x"),
    ] {
        let (_, _, recognised) = described(name);
        assert!(recognised.contains(words), "{name}: {recognised}");
    }
}

#[test]
fn columns_that_are_left_out_are_named_with_what_to_do() {
    for (name, words) in [
        ("refused.h5", "`gone` (a link to `/rig/cap`, which is not in the file)"),
        ("refused.h5", "`complex` (complex numbers)"),
        ("refused.h5", "`cube` (3 axes)"),
        (
            "refused.h5",
            "`far` (a link to `/cap` in the file `other.h5`, which is not next to this one: put it there)",
        ),
        ("refused.h5", "`image` (20 rows and 90 columns: write `group = \"/image\"` and `columns`)"),
        ("refused.h5", "`rate` (a single value)"),
        ("refused.h5", "`raw` (`/raw`, whose values are in files that are no HDF5, is not read"),
        ("table73.mat", "`T` (a table of MATLAB: save it with `S = table2struct(T, ToScalar=true)"),
        ("differential/links_latest.h5", "`broken` (a link to `/nowhere`, which is not in the file)"),
        ("differential/mat5_lengths.mat", "`rate` (1 × 1)"),
    ] {
        let (_, _, recognised) = described(name);
        assert!(recognised.contains(words), "{name}: {recognised}");
        assert!(!recognised.contains("damaged"), "{name}: {recognised}");
    }
    for (path, words) in [
        ("/rounded", "`/rounded`, packed by scale-offset, is not read; pack it with gzip"),
        ("/virtual", "`/virtual`, a virtual dataset whose values are in other datasets, is not read"),
        ("/circle", "`/circle`, a link that leads to itself, or through more than 16 others, is not read"),
        ("/gone", "`/gone`, a link to `/rig/cap`, which is not in the file, is not read"),
        ("/words", "`/words`, which holds text and no table of numbers, is not read"),
    ] {
        let found = refusal(open(&fixture("refused.h5"), &group(path)));
        assert!(found.contains(words), "{path}: {found}");
    }
}

#[test]
fn columns_of_text_are_recognised_before_they_are_read() {
    for (name, texts) in [
        ("refused.h5", &["words"][..]),
        ("columns.h5", &["phase", "words"]),
        ("none.parquet", &["phase"]),
        ("segments.tdms", &["phase"]),
        ("variables.mat", &["phase", "letters"]),
        ("fields.npy", &["phase", "code"]),
        ("stored.npz", &["phase"]),
    ] {
        let (numbers, found, _) = described(name);
        assert_eq!(found, texts, "{name}");
        assert!(!numbers.is_empty(), "{name}");
    }
}

#[test]
fn columns_of_one_length_belong_together() {
    let table = open(&fixture("differential/mat5_lengths.mat"), &Hints::default()).unwrap();
    let rows: Vec<Option<u64>> = table.description().columns.iter().map(|column| column.rows).collect();
    assert_eq!(rows, [Some(200), Some(200), Some(20)]);
    let recognised = &table.description().recognised;
    assert!(recognised.contains("(200 rows: `t`, `u`; 20 rows: `slow`)"), "{recognised}");
    assert_eq!(table.description().rows, None);
}

#[test]
fn names_for_a_file_with_names_of_its_own_are_answered_with_what_to_write() {
    let found = refusal(open(&fixture("differential/mat5_lengths.mat"), &named(&["time_s", "drive_V"])));
    assert!(found.contains("names of its own (`t`, `u`, `slow`)"), "{found}");
    assert!(
        found.contains("`{ column = \"Ucap\", unit = \"V\" }`") && !found.contains("leave `columns` out")
    );
}
