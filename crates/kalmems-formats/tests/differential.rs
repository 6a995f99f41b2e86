//! Files that other programs wrote, and what the same programs read from them: `tools/differential.py` makes two hundred of
//! them, 60 of which are damaged. A few are kept beside the tests, those of them that are damaged with the words of their refusal in place
//! of the columns, and all are read where `KALMEMS_DIFFERENTIAL_FILES` names their folder.

use kalmems_formats::{Block, CellFinding, Hints, Table, WantedColumn, open};
use std::path::{Path, PathBuf};

/// What a file must say, and what an experiment must say of it.
#[derive(Default)]
struct Expected {
    /// How the file was damaged, where it was.
    fault: Option<String>,
    /// What the refusal says, of a file that is not read.
    refused: Option<String>,
    hints: Hints,
    columns: Vec<(String, Vec<String>)>,
}

impl Expected {
    fn read(path: &Path) -> Self {
        let text = std::fs::read_to_string(path).unwrap();
        let mut expected = Self::default();
        for line in text.lines() {
            let mut cells = line.split('\t').map(str::to_owned);
            match cells.next().as_deref() {
                Some("fault") => expected.fault = cells.next(),
                Some("refused") => expected.refused = cells.next(),
                Some("group") => expected.hints.group = cells.next(),
                Some("first_row_line") => {
                    expected.hints.csv.first_row_line = cells.next().and_then(|line| line.parse().ok());
                }
                Some("columns") => expected.hints.columns = Some(cells.collect()),
                Some("column") => {
                    let name = cells.next().unwrap();
                    expected.columns.push((name, cells.collect()));
                }
                other => panic!("{}: {other:?}", path.display()),
            }
        }
        expected
    }
}

/// All cells of a column as the reference has them.
fn cells(table: &mut dyn Table, column: usize, text: bool) -> Result<Vec<String>, String> {
    let wanted =
        if text { WantedColumn::Label { column } } else { WantedColumn::Number { column, power: 0 } };
    table.want(&[wanted]).map_err(|error| error.to_string())?;
    let mut block = Block::with_capacity(61);
    let mut cells = Vec::new();
    loop {
        table.read(&mut block).map_err(|error| error.to_string())?;
        if block.is_end() {
            return Ok(cells);
        }
        let first = cells.len();
        if let [numbers] = &block.numbers[..] {
            cells.extend(numbers.iter().map(|number| format!("{:016x}", number.to_bits())));
        }
        if let [labels] = &block.labels[..] {
            let mut runs = labels.iter().peekable();
            let mut label = String::new();
            for row in 0..block.rows {
                if let Some((_, text)) = runs.next_if(|(start, _)| *start == row) {
                    label =
                        format!("'{}", String::from_utf8(text.clone()).map_err(|error| error.to_string())?);
                }
                cells.push(label.clone());
            }
        }
        // Of cells; a blank line at the end is none.
        for fault in block.faults.iter().filter(|fault| fault.column.is_some()) {
            let cell = &mut cells[first + fault.row];
            match &fault.fault {
                CellFinding::Missing => "missing".clone_into(cell),
                CellFinding::Nan(text) if text != "NaN" => {
                    let number: f64 = text.parse().map_err(|_| text.clone())?;
                    *cell = format!("{:016x}", number.to_bits());
                }
                CellFinding::Nan(_) => "nan".clone_into(cell),
                // A number of the list that stands for none: the tools read it as it is.
                CellFinding::Infinite(text) | CellFinding::Overload(text) => {
                    let number: f64 = text.parse().map_err(|_| text.clone())?;
                    *cell = format!("{:016x}", number.to_bits());
                }
                other => return Err(format!("{other:?}")),
            }
        }
    }
}

/// What is wrong with a file; nothing where every column is the reference's, bit by bit.
fn differences(path: &Path) -> Result<(), String> {
    let expected = Expected::read(path);
    let file = path.with_extension("");
    let open = || open(&file, &expected.hints).map_err(|error| error.to_string());
    if let Some(refused) = &expected.refused {
        let read = open().and_then(|mut table| {
            // Pages and chunks are read with their columns alone.
            let texts: Vec<bool> = table.description().columns.iter().map(|column| column.text).collect();
            let recognised = table.description().recognised.clone();
            for (column, text) in texts.into_iter().enumerate() {
                cells(&mut *table, column, text)?;
                table = open()?;
            }
            Ok(recognised)
        });
        return match read {
            Err(error) if error.contains(refused) => Ok(()),
            Err(error) => Err(error),
            Ok(recognised) => Err(format!("it is read: {recognised}")),
        };
    }
    for (name, values) in &expected.columns {
        let mut table = match open() {
            Err(_) if expected.fault.is_some() => return Ok(()),
            opened => opened?,
        };
        let columns = &table.description().columns;
        // The rest of a name may be its unit.
        let is_named = |known: &str| match name.strip_suffix('*') {
            Some(beginning) => known.starts_with(beginning),
            None => known == name,
        };
        let Some(column) = columns.iter().position(|column| is_named(&column.name)) else {
            // A name that was damaged is another one, which nobody asked for.
            if expected.fault.is_some() {
                continue;
            }
            let names: Vec<&str> = columns.iter().map(|column| column.name.as_str()).collect();
            return Err(format!("no column `{name}` in {names:?}; {}", table.description().recognised));
        };
        let text = values.iter().any(|value| value.starts_with('\''));
        if columns[column].text != text {
            return Err(format!("`{name}` is taken for {}", if text { "numbers" } else { "text" }));
        }
        let found = match cells(&mut *table, column, text) {
            Err(_) if expected.fault.is_some() => return Ok(()),
            found => found.map_err(|error| format!("`{name}`: {error}"))?,
        };
        if found.len() != values.len() {
            return Err(format!("`{name}` of {} rows instead of {}", found.len(), values.len()));
        }
        for (row, (found, value)) in found.iter().zip(values).enumerate() {
            if found != value {
                return Err(format!("`{name}` in row {row}: {found} instead of {value}"));
            }
        }
    }
    Ok(())
}

/// Compares all files of a folder; how many there are.
fn compare(folder: &Path) -> usize {
    let mut files: Vec<PathBuf> = std::fs::read_dir(folder)
        .unwrap_or_else(|error| panic!("{}: {error}", folder.display()))
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.extension().is_some_and(|ending| ending == "expected"))
        .collect();
    files.sort();
    let mut faults = Vec::new();
    for path in &files {
        if let Err(fault) = differences(path) {
            faults.push(format!("{}: {fault}", path.file_stem().unwrap_or_default().display()));
        }
    }
    assert!(faults.is_empty(), "{} of {} files differ:\n{}", faults.len(), files.len(), faults.join("\n"));
    files.len()
}

#[test]
fn files_of_other_programs_are_read_bit_by_bit() {
    let kept = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/differential");
    assert_eq!(compare(&kept), 33);
}

/// What instruments wrote, taken out of public repositories.
#[test]
#[ignore = "slow: needs files that tools/public_exports.py takes out of clones, in KALMEMS_EXPORT_FILES"]
fn slow_files_of_instruments_are_read_bit_by_bit() {
    let folder = std::env::var_os("KALMEMS_EXPORT_FILES").expect("KALMEMS_EXPORT_FILES names a folder");
    assert!(compare(&PathBuf::from(folder)) >= 120);
}

#[test]
#[ignore = "slow: needs files that tools/differential.py writes, in KALMEMS_DIFFERENTIAL_FILES"]
fn slow_all_files_of_other_programs_are_read_bit_by_bit() {
    let folder =
        std::env::var_os("KALMEMS_DIFFERENTIAL_FILES").expect("KALMEMS_DIFFERENTIAL_FILES names a folder");
    assert!(compare(&PathBuf::from(folder)) >= 200);
}
