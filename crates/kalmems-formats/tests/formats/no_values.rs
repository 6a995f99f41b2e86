//! Numbers and words that stand for no value, in every format that can hold them.

use super::{content, fixture};
use kalmems_formats::{Block, CellFinding, Hints, WantedColumn, open, open_reader, read_csv};
use std::io::Cursor;

#[test]
fn words_and_numbers_of_instruments_that_measured_nothing_are_counted_in_a_text() {
    let cells = [
        ("1.5", None),
        ("9.90000000E+37", Some(true)),
        ("-9.9E37", Some(true)),
        ("9.91E37", Some(false)),
        ("199.999E+99", Some(true)),
        ("1e308", Some(true)),
        ("-9999.99E+99", Some(true)),
        ("77777.7E+99", Some(false)),
        ("OL", Some(true)),
        ("OVLD", Some(true)),
        ("---", Some(false)),
        ("9.8E37", None),
    ];
    let mut text = "time_s,cap_mV\n".to_owned();
    for (row, (cell, _)) in cells.iter().enumerate() {
        text.push_str(&format!("{row},{cell}\n"));
    }
    for power in [0, -3] {
        let mut table = read_csv(Cursor::new(text.clone().into_bytes()), &Hints::default()).unwrap();
        table.want(&[WantedColumn::Number { column: 1, power }]).unwrap();
        let mut block = Block::with_capacity(100);
        table.read(&mut block).unwrap();
        let expected: Vec<(u64, CellFinding)> = cells
            .iter()
            .enumerate()
            .filter_map(|(row, (cell, overload))| {
                let of = if (*overload)? { CellFinding::Overload } else { CellFinding::Nan };
                Some((row as u64 + 2, of((*cell).to_owned())))
            })
            .collect();
        let found: Vec<(u64, CellFinding)> =
            block.faults.iter().map(|fault| (fault.line, fault.fault.clone())).collect();
        assert_eq!(found, expected, "10^{power}");
        for ((_, overload), number) in cells.iter().zip(&block.numbers[0]) {
            assert_eq!(number.is_nan(), overload.is_some());
        }
    }
}

#[test]
fn the_same_numbers_are_counted_in_binary_formats() {
    let mut npy = b"\x93NUMPY\x01\x00".to_vec();
    let mut header = b"{'descr': '<f4', 'fortran_order': False, 'shape': (3, 1), }".to_vec();
    header.resize(117, b' ');
    header.push(b'\n');
    npy.extend(u16::try_from(header.len()).unwrap().to_le_bytes());
    npy.extend(header);
    npy.extend([1.0_f32, 9.9e37, -9.9e37].into_iter().flat_map(f32::to_le_bytes));
    let hints = Hints { columns: Some(vec!["cap_V".to_owned()]), ..Hints::default() };
    let mut table = open_reader(Cursor::new(npy), "a.npy", &hints).unwrap();
    let found = content(&mut *table, &[WantedColumn::Number { column: 0, power: 0 }], 8).unwrap();
    assert!(found.numbers[0][0] == 1.0 && found.numbers[0][1..].iter().all(|number| number.is_nan()));
    assert!(found.faults.iter().all(|(_, _, fault)| matches!(fault, CellFinding::Overload(_))));
    assert_eq!(found.faults.len(), 2);
    for name in ["no_values.parquet", "no_values.h5", "no_values.mat", "no_values.tdms"] {
        let mut table = open(&fixture(name), &Hints::default()).unwrap();
        for wanted in ["double_V", "single_V", "int_V"] {
            let column = super::column(&*table, wanted);
            table = open(&fixture(name), &Hints::default()).unwrap();
            let found = content(&mut *table, &[WantedColumn::Number { column, power: -3 }], 5).unwrap();
            let rows: Vec<u64> = found.faults.iter().map(|(row, ..)| *row).collect();
            assert_eq!(rows, [4, 8], "{name} {wanted}");
            assert!(found.faults.iter().all(|(_, _, fault)| matches!(fault, CellFinding::Overload(_))));
            table = open(&fixture(name), &Hints::default()).unwrap();
        }
    }
}

/// What stands in the place of a recording, and files of instruments in formats of their own, are named with what to do.
#[test]
fn files_that_are_no_recording_are_named_with_what_to_export() {
    let said = |bytes: &[u8], name: &str| {
        open_reader(Cursor::new(bytes.to_vec()), name, &Hints::default()).err().unwrap().to_string()
    };
    let lfs = b"version https://git-lfs.github.com/spec/v1\noid sha256:0123\nsize 12\n";
    for name in ["run.csv", "run.npz", "run"] {
        assert!(said(lfs, name).contains("`git lfs pull`"), "{}", said(lfs, name));
    }
    for (bytes, name, words) in [
        (&b"\x0f\x0f:WFM#003\0\0\0"[..], "a.wfm", "Tektronix `.wfm`"),
        (b":WFMPRE:BYT_NR 2;BIT_NR 16;", "a.isf", "Tektronix `.isf`"),
        (b"#9000123456WAVEDESC\0\0", "a.trc", "LeCroy `.trc`"),
        (b"AG10\x01\x00\x00", "a.bin", "Keysight `.bin`"),
        (b"RG01\0\0", "a.bin", "Rigol `.bin`"),
        (b"\x02\0\0\0\x01\0\0", "a.bin", "numbers without a header"),
        (b"\x02\0\0\0\x01\0\0", "a.set", "settings of an oscilloscope"),
    ] {
        assert!(said(bytes, name).contains(words), "{name}: {}", said(bytes, name));
    }
}
