//! Texts in the dialects that instruments write.

use kalmems_formats::{
    Block, CellFinding, CsvHints, FormatError, Hints, Table, TableEvidence, TimeUnit, WantedColumn, open_csv,
    read_csv,
};
use std::fmt::Write as _;
use std::io::Cursor;
use std::path::Path;

/// All that a table gives, a small block at a time.
fn whole(mut table: Box<dyn Table>, capacity: usize) -> Result<Block, FormatError> {
    // Those that stand beside each other.
    let columns = table.description().columns.iter().enumerate().filter(|(_, column)| column.group == 0);
    let wanted: Vec<WantedColumn> =
        columns.map(|(column, _)| WantedColumn::Number { column, power: 0 }).collect();
    table.want(&wanted)?;
    let mut all = Block::default();
    all.clear(wanted.len(), 0);
    let mut block = Block::with_capacity(capacity);
    loop {
        table.read(&mut block)?;
        if block.is_end() {
            assert!(table.digest().is_some());
            return Ok(all);
        }
        assert!(block.rows <= capacity);
        for (row, line) in &block.lines {
            if all.line_of(all.rows + row) != Some(*line) {
                all.lines.push((all.rows + row, *line));
            }
        }
        for mut fault in block.faults.drain(..) {
            fault.row += all.rows;
            all.faults.push(fault);
        }
        all.rows += block.rows;
        for (column, numbers) in all.numbers.iter_mut().zip(&block.numbers) {
            column.extend(numbers);
        }
    }
}

fn text(text: &str, hints: &CsvHints) -> Result<Box<dyn Table>, FormatError> {
    read_csv(Cursor::new(text.as_bytes().to_vec()), &Hints { csv: hints.clone(), ..Hints::default() })
}

fn names(table: &dyn Table) -> Vec<&str> {
    table.description().columns.iter().map(|column| column.name.as_str()).collect()
}

#[test]
#[allow(clippy::too_many_lines)] // a list
fn dialects_of_instruments() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/csv");
    let expected: &[(&str, &str, &str, &[&[f64]])] = &[
        (
            "rigol.csv",
            "written by a Rigol oscilloscope, separated by commas, units in line 2, `time_s` from -0.0003 on in \
             steps of 1e-7, as the header says",
            "time_s CH1_V CH2_V",
            &[&[-3e-4, 0.12, -0.04], &[-3e-4 + 1e-7, 0.16, -0.04], &[-3e-4 + 2e-7, 0.12, 0.0]],
        ),
        (
            "rigol_new.csv",
            "separated by commas, units in the names",
            "Time_s CH1_V CH2_V",
            &[&[-5e-6, 0.12, 0.0], &[-4.998e-6, 0.16, 4e-3]],
        ),
        (
            "keysight_infiniivision.csv",
            "written by a Keysight oscilloscope, separated by commas, units in line 2",
            "time_s channel_1_V channel_2_V",
            &[&[-4.99e-3, 0.1206, -2.5e-3], &[-4.98e-3, 0.1608, -2.5e-3]],
        ),
        (
            "siglent.csv",
            "written by a Siglent oscilloscope, separated by commas, names in line 6, units in line 6",
            "time_s CH1_V CH2_V",
            &[&[-7e-5, -0.194, 0.04], &[-6.999e-5, -0.192, 0.04]],
        ),
        (
            "siglent_source.csv",
            "written by a Siglent oscilloscope, separated by commas, names in line 12, units in line 12",
            "time_s CH2_V",
            &[&[-7e-6, 0.032], &[-6.998e-6, 0.064]],
        ),
        (
            "tektronix_mso.csv",
            "written by a Tektronix oscilloscope, separated by commas, names in line 15, units in the lines before",
            "TIME_s CH1_V CH3_mV",
            &[&[-2e-5, 0.08, 1.2], &[-1.9996e-5, 0.1, 1.3]],
        ),
        (
            "tektronix_tds.csv",
            "written by a Tektronix TDS oscilloscope, separated by commas, settings next to the first rows",
            "time_s CH2_V",
            &[&[-5e-4, 0.008], &[-4.996e-4, 0.016], &[-4.992e-4, 0.008], &[-4.988e-4, 0.0]],
        ),
        (
            "lecroy.csv",
            "written by a LeCroy oscilloscope, separated by commas, names in line 5, times in seconds, no unit of \
             the amplitudes",
            "Time_s Ampl",
            &[&[-5e-8, 0.0125], &[-4.99e-8, 0.015]],
        ),
        (
            "picoscope.csv",
            "separated by commas, units in line 2",
            "Time_ms Channel A_V Channel B_mV",
            &[&[-0.00512, 0.123_456_8, -3.21], &[-0.00508, 0.124, f64::NAN]],
        ),
        (
            "picoscope_decimal_comma.csv",
            "separated by semicolons, decimal commas, units in line 2",
            "Zeit_us Kanal A_V Kanal B_mV",
            &[&[-5.12, 0.123_456_8, -3.21], &[-5.08, 0.124, -3.22]],
        ),
        (
            "rohde_schwarz.csv",
            "separated by commas, units in the names",
            "time_s C1_V C2_V",
            &[&[-6e-3, 0.12, 4e-3], &[-5.9988e-3, 0.16, 4e-3]],
        ),
        (
            "labview_no_x.lvm",
            "written by LabVIEW, separated by tabs, names in line 23, units in the header, `time_s` from 0.5 on in \
             steps of 0.001, as the header says",
            "time_s Voltage_V Current_A",
            &[&[0.5, 0.012_451, 1.5e-3], &[0.501, 0.0125, 1.6e-3], &[0.502, 0.012_451, 1.5e-3]],
        ),
        (
            "labview_one_x.lvm",
            "written by LabVIEW, separated by tabs, names in line 23, units in the header",
            "time_s Voltage_V Current_A",
            &[&[0.0, 0.012_451, 1.5e-3], &[0.001, 0.0125, 1.6e-3]],
        ),
        (
            "labview_decimal_comma.lvm",
            "written by LabVIEW, separated by tabs, decimal commas, names in line 23, units in the header",
            "time_s Voltage_V Current_A",
            &[&[0.0, 0.012_451, 1.5e-3], &[0.001, 0.0125, 1.6e-3]],
        ),
        (
            "semicolons.csv",
            "separated by semicolons, decimal commas",
            "time_ms drive_V cap_pF",
            &[&[0.0, 1.5, 5.71], &[0.5, -15.0, 5.72]],
        ),
        ("tabs_and_trailing.txt", "separated by tabs", "time_s cap_V", &[&[0.0, 1.5], &[0.1, 1.6]]),
        (
            "units_line.csv",
            "separated by commas, units in line 2",
            "time_s drive_V cap_pF",
            &[&[0.0, 1.0, 5.71], &[1.0, 2.0, 5.72]],
        ),
        (
            "brackets.csv",
            "separated by semicolons, units in the names",
            "Time_us CH1_V CH2_mV note",
            &[&[0.1, 1.5, 2.0, f64::NAN], &[0.2, 1.6, 3.0, f64::NAN]],
        ),
        (
            "savetxt.txt",
            "separated by blanks, names in a comment",
            "time_s cap_V",
            &[&[0.0, 1.5], &[1e-3, 1.6], &[2e-3, -1.5]],
        ),
        (
            "savetxt_title.txt",
            "separated by blanks, names in line 2, names and units in comments, units in line 3",
            "time_ms cap_pF",
            &[&[0.0, 5.71], &[0.5, 5.72]],
        ),
        (
            "blanks_aligned.txt",
            "separated by blanks, units in the names",
            "Time_s Ucap_V",
            &[&[0.0, 1.5], &[1e-3, -1.6]],
        ),
        (
            "blanks_decimal_comma.txt",
            "separated by blanks, decimal commas",
            "time_s cap_V",
            &[&[1e-3, 1.5], &[2e-3, 1.6]],
        ),
        (
            "excel_sep.csv",
            "separated by semicolons, decimal commas, names in line 2",
            "time_s cap_V",
            &[&[1e-3, 1.5], &[2e-3, 1.6]],
        ),
        (
            "utf16_le.csv",
            "UTF-16, separated by tabs, decimal commas, units in the names",
            "Time_us Ucap_V",
            &[&[0.5, -1.5], &[1.0, 1.6]],
        ),
        ("utf16_be.csv", "UTF-16, separated by semicolons", "time_s cap_V", &[&[0.0, 1.5], &[1.0, 1.6]]),
        (
            "iso_times.csv",
            "separated by commas, units in the names",
            "time Ucap_V state",
            &[&[f64::NAN, 1.5, f64::NAN], &[f64::NAN, 1.6, f64::NAN]],
        ),
        (
            "moku_logger.csv",
            "written by a Moku, separated by commas, names in line 7, names in a comment, units in the names",
            "Time_s Input 1_V Input 2_V",
            &[&[0.0, 1.625e-2, -3.25e-3], &[0.01, 1.65e-2, -2.75e-3]],
        ),
        (
            "labone_demod.csv",
            "written by LabOne (Zurich Instruments), separated by semicolons, no units, times in ticks of the device's \
             clock",
            "chunk timestamp x y freq_Hz phase dio trigger auxin0 auxin1",
            &[&[0.0, 1_210_000.0, 1.25e-5, -2.5e-6, 31350.0, 0.5, 0.0, 0.0, 0.25, 0.0]],
        ),
        (
            "labone_plotter.csv",
            "written by LabOne (Zurich Instruments), separated by semicolons, no units, times in ticks of the device's \
             clock",
            "timestamp value",
            &[&[1_210_000.0, 1.25e-5], &[1_210_512.0, 1.5e-5]],
        ),
        (
            "yokogawa_dlm.csv",
            "written by a Yokogawa oscilloscope, separated by commas, names in line 5, units in the preamble, \
             `time_s` from -1.6e-6 on in steps of 8e-7, as the header says",
            "time_s CH1_V CH2_V",
            &[&[-1.6e-6, 1.25, -0.25], &[-1.6e-6 + 8e-7, 1.5, -0.225], &[0.0, 1.75, -0.2]],
        ),
        (
            "rigol_clock_in_names.csv",
            "separated by commas, units in the names",
            "Time_s CH1_V CH2_V",
            &[&[-1e-3, 1.25, 0.25], &[-9.98e-4, 1.5, 0.225]],
        ),
        (
            "rigol_without_times.csv",
            "separated by commas, units in the names, `time_s` from -0.001 on in steps of 2e-6, as the header says",
            "time_s CH1_V CH2_V",
            &[&[-1e-3, 1.25, 0.25], &[-1e-3 + 2e-6, 1.5, 0.225]],
        ),
        (
            "keysight_infiniium.csv",
            "written by a Keysight Infiniium oscilloscope, separated by commas, units in the preamble",
            "time_s Channel 1_V",
            &[&[-1e-6, 1.25], &[-5e-7, 1.5], &[0.0, 1.75]],
        ),
        (
            "keysight_infiniium_segments.csv",
            "written by a Keysight Infiniium oscilloscope, separated by commas, units in the preamble",
            "time_s Channel 1_V time of Channel 1 2_s Channel 1 2_V",
            &[&[-1e-6, 1.25, -1e-6, 2.25], &[-5e-7, 1.5, -5e-7, 2.5]],
        ),
        (
            "lecroy_channels.csv",
            "written by a LeCroy oscilloscope, separated by commas, names in line 5, times in seconds, no unit of \
             the amplitudes",
            "Time_s Ampl1 Ampl2",
            &[&[-5e-6, -0.25, 0.5], &[-4e-6, -0.5, 0.75]],
        ),
        (
            "lecroy_segments.csv",
            "written by a LeCroy oscilloscope, separated by commas, names in line 6, times in seconds, no unit of \
             the amplitudes, segments of 2 rows, as line 2 says",
            "Time_s Ampl segment",
            &[&[-5e-8, 1.0, 1.0], &[-4e-8, 2.0, 1.0], &[-5e-8, 3.0, 2.0], &[-4e-8, 4.0, 2.0]],
        ),
        (
            "tektronix_mso58.csv",
            "written by a Tektronix oscilloscope, separated by commas, names in line 20, units in the lines before",
            "TIME_s CH1_V CH2_A",
            &[&[-2e-5, 0.08, 1.25], &[-1.999_984e-5, 0.1, 1.5]],
        ),
        (
            "labview_records.lvm",
            "written by LabVIEW, separated by tabs, names in line 23, units in the header, `time_s` from 0.0 on in \
             steps of 0.001, as the header says",
            "time_s Voltage_V Acceleration_g segment",
            &[
                &[0.0, 1.25, 0.5, 1.0],
                &[0.001, 1.5, 0.25, 1.0],
                &[0.25, 2.25, 1.5, 2.0],
                &[0.251, 2.5, 1.25, 2.0],
                &[0.252, 2.75, 1.0, 2.0],
            ],
        ),
        (
            "labview_times_of_each.lvm",
            "written by LabVIEW, separated by tabs, names in line 20, units in the header",
            "time_s Voltage_V time of Force_s Force_N",
            &[&[0.0, 1.25], &[0.001, 1.5]],
        ),
        (
            "labview_remarks.lvm",
            "written by LabVIEW, separated by commas, names in line 21, units in the header",
            "time_s Voltage_V",
            &[&[0.0, 1.25], &[0.001, 1.5]],
        ),
        (
            "rigol_channels_alone.csv",
            "written by a Rigol oscilloscope, separated by commas, units in line 2, `time_s` from -0.0003 on in \
             steps of 1e-7, as the header says",
            "time_s CH2_V CH4_V",
            &[&[-3e-4, 1.92, -2.88e-3], &[-3e-4 + 1e-7, 1.96, -2.56e-3]],
        ),
        (
            "gw_instek.csv",
            "written by a GW Instek oscilloscope, separated by commas, names in line 3, units in the preamble",
            "time_s CH1_V",
            &[&[-3.245e-6, -0.038], &[-3.24475e-6, -0.04], &[-3.2445e-6, -0.036]],
        ),
        (
            "axon.atf",
            "written by pCLAMP (Axon), separated by tabs, names in line 7, units in the names",
            "Time_s Trace #1_pA Trace #1_mV",
            &[&[0.0, -10.498, -1.035_46], &[6.25e-5, -11.3525, -1.036_68]],
        ),
        (
            "labchart.txt",
            "written by LabChart (ADInstruments), separated by tabs, names in line 9, times in seconds, no units of the \
             channels",
            "time_s Drive Mirror",
            &[&[0.5, 3.202_508, -42.388_33], &[0.51, 3.202_531, -42.376_96]],
        ),
        (
            "shimmer.csv",
            "separated by tabs, names in line 2, units in line 3",
            "S_Timestamp_Unix_CAL_ms S_Accel_LN_X_CAL_m_per_s2 S_Gyro_X_CAL_deg_per_s S_Mag_X_CAL",
            &[
                &[1.629e12, -1.789_62, -565.305, 0.526_23],
                &[1.629_000_000_002e12, -2.201_46, -564.41, 0.509_74],
            ],
        ),
        (
            "ec_lab.mpt",
            "separated by tabs, decimal commas, names in line 6, units in the names",
            "mode time_s Ewe_V <I>_mA",
            &[&[2.0, 20.65, 3.424_187_2, 9.693_702e-3], &[2.0, 21.15, 3.424_213_9, 1.058_848e-2]],
        ),
    ];
    for (file, recognised, columns, rows) in expected {
        let table = open_csv(&folder.join(file), &Hints::default()).unwrap();
        assert_eq!(table.description().recognised, *recognised, "{file}");
        assert_eq!(names(table.as_ref()).join(" "), *columns, "{file}");
        let block = whole(table, 1000).unwrap();
        for (index, row) in rows.iter().enumerate() {
            let found: Vec<u64> = block.numbers.iter().map(|column| column[index].to_bits()).collect();
            let row: Vec<u64> = row.iter().map(|number| number.to_bits()).collect();
            assert_eq!(found, row, "{file} row {index}");
        }
        let columns: Vec<_> = block
            .faults
            .iter()
            .filter(|f| !matches!(f.fault, CellFinding::Text(_) | CellFinding::Infinite(_)))
            .collect();
        assert!(columns.is_empty(), "{file}: {columns:?}");
        assert_eq!(block.rows, block.numbers[0].len());
    }
}

#[test]
fn what_has_two_readings_is_refused_with_what_to_write() {
    let mut report = String::new();
    for (name, file) in [
        ("two separators", "time_s;cap_V,x\n0;1,5\n1;2,5\n"),
        ("two decimal marks", "time_s;cap_V\n0;1,5\n1;2.5\n"),
        (
            "waveforms with times of their own",
            "Revision:,1,1\nType:,raw,raw\nPoints:,2,2\nXInc:,1e-6,1e-6\nXOrg:,0,5e-7\nData:\n0.5,0.25\n0.5,0.125\n",
        ),
        ("LabOne sweep", "chunk;timestamp;size;fieldname;v1;v2\n0;0;2;frequency;100;10\n0;0;2;realz;20;30\n"),
        ("words above blanks", "time cap left\n0 1\n1 2\n"),
        ("NUL", "time_s,cap_V\n0,1\n\0\0\n"),
        ("line ends of an old Macintosh", "time_s,cap_V\r0,1\r1,2\r"),
        ("LabVIEW without end", "LabVIEW Measurement\t\nSeparator\tTab\n1\t2\n"),
    ] {
        let error = read_csv(Cursor::new(file.as_bytes()), &Hints::default()).err().unwrap();
        writeln!(report, "{name}: {error}").unwrap();
    }
    let expected = "\
two separators: the names in line 1 could be separated by commas or semicolons; expected the settings to say \
which: `format = { kind = \"csv\", separator = \",\" }` in the table that names the file
two decimal marks: `2.5` in line 3 and `1,5` in line 2; expected one decimal mark, which the settings can say: \
`format = { kind = \"csv\", decimal = \",\" }` in the table that names the file
waveforms with times of their own: CSV: a file of a Keysight Infiniium oscilloscope with times of its own for each waveform (`XOrg`, \
`XInc`; `Channel 2`: it starts 5e-7 s after `Channel 1`: 0.5 samples, no whole number) is not read; save those with the same times in a file of their own, or with pairs of time and value
LabOne sweep: CSV: a LabOne file with a line for each field, such as sweeps are saved in, is not read; save samples \
(`chunk;timestamp;x;y;…`), or as HDF5
words above blanks: 3 words in line 1 above rows of 2 numbers between blanks; expected a name for each column, in the \
file or in the settings: `format = { kind = \"csv\", columns = [\"time_s\", \"ch1_V\"] }` in the table that names the file
NUL: a byte that is no text, 17 bytes from line 1 on; expected text
line ends of an old Macintosh: lines that end with a carriage return alone; expected lines that end with a line feed: \
convert the file, such as with `tr '\\r' '\\n'`
LabVIEW without end: damaged LabVIEW measurement at header: no end; expected `***End_of_Header***` twice, once for the \
file and once for the channels
";
    assert_eq!(report, expected);
}

#[test]
fn hints_decide() {
    let hints = CsvHints { separator: Some(';'), decimal: Some('.'), ..CsvHints::default() };
    let block = whole(text("time_s;cap_V,x\n0;1.5\n1;2.5\n", &hints).unwrap(), 9).unwrap();
    assert_eq!(block.numbers, [[0.0, 1.0], [1.5, 2.5]]);

    let hints = CsvHints { header_line: Some(4), ..CsvHints::default() };
    let table = text(include_str!("fixtures/csv/unknown_preamble.csv"), &hints).unwrap();
    assert_eq!(names(table.as_ref()), ["Time_s", "CH1_V"]);
    assert_eq!(whole(table, 9).unwrap().numbers, [[0.1, 0.2, 0.3], [1.5, 1.6, 1.5]]);

    let hints = CsvHints {
        header_line: Some(2),
        units_line: Some(1),
        first_row_line: Some(4),
        decimal: Some(','),
        ..CsvHints::default()
    };
    let table = text("ms;kV\nt;u\nignored;\n1,5;2\n", &hints).unwrap();
    assert_eq!(names(table.as_ref()), ["t_ms", "u_kV"]);
    assert_eq!(whole(table, 9).unwrap().numbers, [[1.5], [2.0]]);

    let named = |columns: &[&str]| Hints {
        columns: Some(columns.iter().map(|&name| name.to_owned()).collect()),
        ..Hints::default()
    };
    let open =
        |file: &str, columns: &[&str]| read_csv(Cursor::new(file.as_bytes().to_vec()), &named(columns));
    let table = open("0\t1,5\n1\t2,5\n", &["time_s", "cap_V"]);
    assert!(table.is_err(), "tabs or commas");
    let table = open("0;1.5\n1;2.5\n", &["time_s", "cap_V"]).unwrap();
    assert_eq!(names(table.as_ref()), ["time_s", "cap_V"]);
    assert_eq!(whole(table, 9).unwrap().numbers, [[0.0, 1.0], [1.5, 2.5]]);
    // A first row that begins with a date is one as well.
    for date in ["2014-05-07 16:29:30.020", "16:29:30.020"] {
        let table = open(&format!("{date},1.5\n{date},2.5\n"), &["time", "cap_V"]).unwrap();
        assert_eq!(whole(table, 9).unwrap().numbers[1], [1.5, 2.5], "{date}");
        let table = open(&format!("{date},left,1.5\n{date},left,2.5\n"), &["time", "side", "cap_V"]).unwrap();
        assert_eq!(whole(table, 9).unwrap().numbers[2], [1.5, 2.5], "{date}");
    }
    // So is one with a separator behind its last cell.
    let table = open("0\t1.5\t\n1\t2.5\t\n", &["time_s", "cap_V"]).unwrap();
    assert_eq!(whole(table, 9).unwrap().numbers, [[0.0, 1.0], [1.5, 2.5]]);
    let table = open("a,b\n1,2.5\n", &["time_s", "cap_V"]).unwrap();
    assert_eq!(whole(table, 9).unwrap().numbers, [[1.0], [2.5]]);
    let error = open("a,b\n1,2.5\n", &["time_s"]).err().unwrap().to_string();
    assert_eq!(
        error,
        "2 columns: `a`, `b`; expected as many as `columns` in the settings names, which are 1"
    );
}

/// The file of two records that LabVIEW writes with a header each.
const RECORDS: &str = include_str!("fixtures/csv/labview_records.lvm");

#[test]
fn records_of_a_file_have_labels_and_clocks_of_their_own_however_few_columns_are_read() {
    // Only the first channel is read, so that the rest of a header could pass for a row.
    for capacity in 1..8 {
        let mut table = text(RECORDS, &CsvHints::default()).unwrap();
        let number = |column| WantedColumn::Number { column, power: 0 };
        table.want(&[number(0), number(1), WantedColumn::Label { column: 3 }]).unwrap();
        let mut block = Block::with_capacity(capacity);
        let (mut rows, mut labels) = (Vec::new(), Vec::new());
        loop {
            table.read(&mut block).unwrap();
            if block.is_end() {
                break;
            }
            assert!(block.faults.is_empty(), "{:?}", block.faults);
            rows.extend(block.numbers[0].iter().copied().zip(block.numbers[1].iter().copied()));
            for (index, (start, label)) in block.labels[0].iter().enumerate() {
                let end = block.labels[0].get(index + 1).map_or(block.rows, |(next, _)| *next);
                labels.extend((*start..end).map(|_| String::from_utf8(label.clone()).unwrap()));
            }
        }
        let expected = [(0.0, 1.25), (0.001, 1.5), (0.25, 2.25), (0.251, 2.5), (0.252, 2.75)];
        assert_eq!(rows, expected, "{capacity}");
        assert_eq!(labels, ["1", "1", "2", "2", "2"]);
    }
    let other =
        RECORDS.replacen("Voltage\tAcceleration", "Voltage\tForce", 2).replacen("Force", "Acceleration", 1);
    let error = whole(text(&other, &CsvHints::default()).unwrap(), 100).unwrap_err().to_string();
    assert_eq!(
        error,
        "LabVIEW measurement: a file of records with different channels is not read; write each in a file of its own"
    );
    let cut = RECORDS.rsplit_once("***").unwrap().0;
    let error = whole(text(cut, &CsvHints::default()).unwrap(), 100).unwrap_err();
    assert!(matches!(error, FormatError::Damaged { .. }), "{error}");
}

/// A file may end without a line end, and a cut one ends so: the row counts, and it is told.
#[test]
fn a_last_line_without_an_end_is_a_row_and_is_reported() {
    for (file, rows, line) in [
        ("t_s,v_V\n0,1.5\n1,1", 2, Some(3)),
        ("t_s,v_V\n0,1.5\n1,1\n", 2, None),
        ("t_s v_V\n0 1.5\n1 1", 2, Some(3)),
        ("t_s,v_V\n0,1.5\n1", 1, Some(3)),
        ("t_s,v_V\n0,1.5\n  ", 1, None),
        ("t_s,v_V", 0, None),
    ] {
        for capacity in 1..4 {
            let block = whole(text(file, &CsvHints::default()).unwrap(), capacity).unwrap();
            let told = block.faults.iter().find(|fault| fault.fault == CellFinding::NoLineEnd);
            assert_eq!((block.rows, told.map(|fault| fault.line)), (rows, line), "{file:?}");
        }
    }
}

/// What `numpy.savetxt` writes with other delimiters and comments, and what spreadsheets say first.
#[test]
fn names_stand_in_comments_or_above_however_they_are_separated() {
    for (file, columns) in [
        ("# time_s,cap_V\n0 1\n1 2\n", "time_s cap_V"),
        ("#time_s;cap_V\n0;1\n1;2\n", "time_s cap_V"),
        ("% time (s) cap [V]\n0\t1\n1\t2\n", "time_s cap_V"),
        ("## t / s   U left / V\n0 1\n1 2\n", "t_s U left_V"),
        ("# made by hand\ntime_s,cap_V\n0,1\n", "time_s cap_V"),
        ("# made by\ntime_s cap_V\n0 1\n", "time_s cap_V"),
        ("# cap_V\n1\n2\n", "cap_V"),
        ("#time_s\tcap_V\n0\t1\n", "time_s cap_V"),
        ("\"sep=,\"\n# x\ntime_s,cap_V\n0,1\n", "time_s cap_V"),
        ("sep=\t\ntime_s\tcap_V\n0\t1\n", "time_s cap_V"),
        ("\"time s\" \"cap_V\"\n0 1\n1 2\n", "time s cap_V"),
        ("time\tcap_V\n0   1\n1   2\n", "time cap_V"),
        ("Time, s;Ucap / V\n0;1\n", "Time_s Ucap_V"),
        // Nothing says that these are names.
        ("# by hand\n0,1\n", "0 1"),
        ("0 1\n1 2\n", "0 1"),
    ] {
        let table = text(file, &CsvHints::default()).unwrap();
        assert_eq!(names(table.as_ref()).join(" "), columns, "{file:?}");
    }
    let hints = CsvHints { separator: Some(' '), ..CsvHints::default() };
    let table = text("a  b\n left 1\n", &hints).unwrap();
    assert_eq!(names(table.as_ref()), ["a", "b"]);
}

/// The lines of rows and what is wrong with them are the same, however few rows a block has.
#[test]
fn blocks_of_any_size_tell_the_same() {
    let odd = "# c\na,b\n1,2\n\n\n3\n4,5,6\n\n7,x\n\"8\",\" 9\n\"\n10,\n,nan\n1e999,2\n\n";
    let one = "a\n1\n\n\n2\n\n";
    let blanks = "a b\n1 2\n\n3\n 4\t5 \n6 x\n\"7\" 8\n9 10";
    for file in [odd, one, blanks, RECORDS, "a,b\n1,2", "a,b\r\n1,2\r\n\r\n3,4\r\n"] {
        let expected = whole(text(file, &CsvHints::default()).unwrap(), 100).unwrap();
        for capacity in 1..5 {
            let found = whole(text(file, &CsvHints::default()).unwrap(), capacity).unwrap();
            assert_eq!(format!("{found:?}"), format!("{expected:?}"), "{file:?}");
        }
    }
    let block = whole(text(odd, &CsvHints::default()).unwrap(), 100).unwrap();
    assert_eq!(block.rows, 6);
    assert_eq!(block.lines, [(0, 3), (1, 9), (3, 12)]);
    let faults: Vec<_> = block.faults.iter().map(|f| (f.line, f.column, f.fault.clone())).collect();
    assert_eq!(
        faults,
        [
            (4, None, CellFinding::BlankLines { count: 3 }),
            (6, None, CellFinding::CellCount { found: 1, expected: 2, rows: 2 }),
            (9, Some(1), CellFinding::Text("x".to_owned())),
            (12, Some(1), CellFinding::Missing),
            (13, Some(0), CellFinding::Missing),
            (13, Some(1), CellFinding::Nan("nan".to_owned())),
            (14, Some(0), CellFinding::Infinite("1e999".to_owned())),
        ]
    );
    let block = whole(text(one, &CsvHints::default()).unwrap(), 100).unwrap();
    assert_eq!((block.rows, block.faults.len()), (4, 2));
}

/// Files that mean harm end in an error or in faults, in bounded memory.
#[test]
fn hostile_texts() {
    struct Endless(Vec<u8>, usize, usize);
    impl std::io::Read for Endless {
        fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
            if self.2 == 0 {
                return Ok(0);
            }
            self.2 -= 1;
            for byte in buffer.iter_mut() {
                *byte = self.0[self.1 % self.0.len()];
                self.1 += 1;
            }
            Ok(buffer.len())
        }
    }
    let open = |pattern: &[u8]| {
        let table = read_csv(Endless(pattern.to_vec(), 0, 60), &Hints::default())?;
        whole_faults(table)
    };
    assert!(matches!(open(b"x"), Err(FormatError::TooLarge { .. })));
    assert!(matches!(open(b"x,"), Err(FormatError::TooLarge { .. })));
    assert!(matches!(open(b"\0"), Err(FormatError::TooLarge { .. } | FormatError::NotRecognised { .. })));
    let header = format!("{}\n", "a,".repeat(1_000_000));
    assert!(matches!(text(&header, &CsvHints::default()).err(), Some(FormatError::TooLarge { .. })));
    // A quote that never closes, after sound rows.
    let mut open_quote = b"a,b\n1,2\n3,\"".to_vec();
    open_quote.extend(std::iter::repeat_n(b'\n', 10 << 20));
    let table = read_csv(Cursor::new(open_quote), &Hints::default()).unwrap();
    assert!(matches!(whole_faults(table), Err(FormatError::TooLarge { .. })));
    // Rows that are none, and blank lines between, are told in few faults, a last line without an end in another.
    let rows = std::io::Read::chain(Cursor::new(b"a,b\n"), Endless(b"1\n\n,,,\n".to_vec(), 0, 60));
    let (rows, faults) = whole_faults(read_csv(rows, &Hints::default()).unwrap()).unwrap();
    assert!(rows <= 1 && faults <= 3, "{rows} {faults}");
}

/// Every fixture, cut anywhere and with bytes altered, is read or refused.
#[test]
fn cut_and_altered_texts_are_read_or_refused() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/csv");
    let mut files: Vec<_> = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    files.sort();
    assert!(files.len() > 30);
    let mut readable = 0;
    let mut read = |bytes: Vec<u8>| {
        let table = read_csv(Cursor::new(bytes), &Hints::default());
        readable += usize::from(
            table.is_ok_and(|table| table.description().columns.is_empty() || whole(table, 7).is_ok()),
        );
    };
    for (number, file) in files.iter().enumerate() {
        let bytes = std::fs::read(file).unwrap();
        for place in (number % 5..bytes.len()).step_by(5) {
            read(bytes[..place].to_vec());
            let mut altered = bytes.clone();
            altered[place] = b"\t;,\n0\"\x80-"[place / 5 % 8];
            read(altered);
        }
    }
    assert!(readable > 1000, "{readable}");
}

fn whole_faults(mut table: Box<dyn Table>) -> Result<(usize, usize), FormatError> {
    table.want(&[WantedColumn::Number { column: 0, power: 0 }])?;
    let mut block = Block::with_capacity(1000);
    let (mut rows, mut faults) = (0, 0);
    loop {
        table.read(&mut block)?;
        if block.is_end() {
            return Ok((rows, faults));
        }
        rows += block.rows;
        faults += block.faults.iter().filter(|fault| fault.column.is_none()).count();
    }
}

/// What a reader may be shown of a text depends on whether it is a table of numbers.
#[test]
fn a_text_is_known_as_a_table_by_a_number_below_a_name() {
    for (text, expected) in [
        ("time_s,cap_V\n0,1\n", TableEvidence::Rows),
        ("a;b\nx;1,5\n", TableEvidence::Rows),
        // Numbers from the first line on are no names, but where they count the columns.
        ("label,0,1\na,5,6\n", TableEvidence::Rows),
        (",0,1\n0,5,6\n", TableEvidence::Rows),
        ("a=1,2,3\nb=4,5,6\n", TableEvidence::Nothing),
        ("[\"a\", 2, 3]\n[\"b\", 5, 6]\n", TableEvidence::Nothing),
        ("time_s,cap_V\n", TableEvidence::Nothing),
        ("time_s,cap_V\n0\n1\n", TableEvidence::Nothing),
        ("a,b\nc,d\n", TableEvidence::Nothing),
        ("detector_1\n0\n1\nlate\n", TableEvidence::Rows),
        ("dear all,\nwe are\n5\nand no\nmore\n", TableEvidence::Nothing),
        ("", TableEvidence::Nothing),
    ] {
        let table = read_csv(Cursor::new(text.as_bytes().to_vec()), &Hints::default()).unwrap();
        assert_eq!(table.description().evidence, expected, "{text:?}");
    }
    // Names of the settings are names.
    let columns = Some(vec!["time_s".to_owned(), "cap_V".to_owned()]);
    let hints = Hints { columns, ..Hints::default() };
    let table = read_csv(Cursor::new(b"0,1\n2,3\n".to_vec()), &hints).unwrap();
    assert_eq!(table.description().evidence, TableEvidence::Rows);
    // Names that nobody may be shown are counted.
    let named = |text: &'static str| {
        let one = Hints { columns: Some(vec!["x".to_owned()]), ..Hints::default() };
        read_csv(Cursor::new(text.as_bytes()), &one).err().unwrap().to_string()
    };
    assert!(named("a,b\nc,d\n").starts_with("2 columns; expected"), "{}", named("a,b\nc,d\n"));
    assert!(named("a,b\nc,1\n").starts_with("2 columns: `a`, `b`; expected"), "{}", named("a,b\nc,1\n"));
}

/// What loggers, spreadsheets and programs write before, between and in the rows: names and first row of each, and its number of rows.
#[test]
fn texts_of_loggers_and_spreadsheets_are_read() {
    let toa5 = "\"TOA5\",\"TILT1\",\"CR1000X\",\"00000\",\"Std.03\",\"CPU:tilt.CR1\",\"59064\",\"Fast\"\n\
        \"TIMESTAMP\",\"RECORD\",\"Accel_X\",\"PTemp\"\n\"TS\",\"RN\",\"m/s^2\",\"Deg C\"\n\"\",\"\",\"Smp\",\"Smp\"\n\
        \"2026-03-08 12:00:00\",0,0.5,21.5\n\"2026-03-08 12:00:00.05\",1,0.25,21.5\n";
    let gcdc = ";Title, http://www.example.com, X16\n;Start_time, 2026-11-02, 09:00:06\n;SampleRate, 400,Hz\n\
        ;Headers, time,Ax,Ay\n0.0000,1,-1\n0.0026,11,-6\n";
    let gcdc_title = &gcdc.replace("http://www.example.com", "http://www.gcdataconcepts.com");
    let nanonis = "Experiment\tbias spectroscopy\t\nDate\t02.11.2026\t\nX (m)\t1E-9\t\n\n[DATA]\nBias calc (V)\tCurrent (A)\n\
        0.1\t1E-12\n0.2\t2E-12\n";
    let xsens = "// Start Time: Unknown\n// Sample rate: 100.0Hz\nPacketCounter\tAcc_X\tGyr_X\n1\t0.5\t3\n2\t0.25\t4\n";
    let sigrok = "; CSV generated by libsigrok 0.5.2\n; Samplerate: 1 MHz\nA0 [V],A1 [V]\n0.5,1\n0.25,2\n";
    // More lines of settings than are looked at in a text without any.
    let long = format!(
        "Experiment\tsweep\t\n{}[DATA]\nBias (V)\tCurrent (A)\tLock [bwd] (V)\n1\t2\t3\n4\t5\t6\n",
        "Slope (m)\t1E-9\t\n".repeat(140)
    );
    let ultra_scope = "\"Number of Data points =\",2,\n\"Time Scale (s/DIV) =\",1E-7,\n\"Channel Data\",\"CH 1\",\"CH 2\"\n\
        \"Attenuation = \",10,1\n\"Pos (V) = \",0.2,-6\n\"Scale (V/DIV) = \",0.1,2\n\"Minimum (V) = \",-2.04,-0.24\n\"Inverted = \",\"NO\",\"NO\"\n\
        \"Time (s)\",\"Voltage (V)\",\"Voltage (V)\"\n0,1.72,9.92\n2E-9,-4.52,9.92\n";
    // The same of a program that is not in the table of instruments.
    let settings = "Points = ,2,\nAttenuation = ,10,1\nPos = ,0.2,-6\nScale = ,0.1,2\nLowest = ,-2,1\nTime (s),a (V),b (V)\n0,1,2\n1,3,4\n";
    let titled = "My logger 3000\nroom 12\nsettings;fast\nTime (s);CH1 (V)\n0,1;1,5\n0,2;1,6\n";
    for (file, columns, first, rows) in [
        (toa5, "TIMESTAMP RECORD Accel_X_m_per_s2 PTemp_degC", &[f64::NAN, 0.0, 0.5, 21.5][..], 2),
        (gcdc, "time Ax Ay", &[0.0, 1.0, -1.0], 2),
        (gcdc_title, "time_s Ax Ay", &[0.0, 1.0, -1.0], 2),
        (nanonis, "Bias calc_V Current_A", &[0.1, 1e-12], 2),
        (xsens, "time_s PacketCounter Acc_X_m_per_s2 Gyr_X_rad_per_s", &[0.0, 1.0, 0.5, 3.0], 2),
        (sigrok, "time_s A0_V A1_V", &[0.0, 0.5, 1.0], 2),
        // What states a clock is used, and what has times keeps them.
        ("Sample rate (kHz): 2\nstart;now;then\nx;y\n1;2\n3;4\n", "time_s x y", &[0.0, 1.0, 2.0], 2),
        ("# dt = 0.5 ms\nA,B\n1,2\n3,4\n", "time_s A B", &[0.0, 1.0, 2.0], 2),
        ("# dt = 0.5 ms\nclock,B\n1,2\n3,4\n", "clock B", &[1.0, 2.0], 2),
        ("# dt = 0.5 ms\nn_us,B\n1,2\n3,4\n", "n_us B", &[1.0, 2.0], 2),
        ("# dt = 0.5 furlong\nA,B\n1,2\n3,4\n", "A B", &[1.0, 2.0], 2),
        (titled, "Time_s CH1_V", &[0.1, 1.5], 2),
        (&long, "Bias_V Current_A Lock [bwd]_V", &[1.0, 2.0, 3.0], 2),
        (ultra_scope, "time_s CH 1_V CH 2_V", &[0.0, 1.72, 9.92], 2),
        (settings, "Time_s a_V b_V", &[0.0, 1.0, 2.0], 2),
        ("ax:0.5\tay:-2\nax:1.5\tay:3\n", "ax ay", &[0.5, -2.0], 2),
        ("ax:0.5,ay_V:-2\nax:1.5,ay_V:3\n", "ax ay_V", &[0.5, -2.0], 2),
        // Rows of empty cells behind the last row are a spreadsheet's, and within the rows they are samples that are missing.
        ("time_s,cap_V\n0,1\n1,2\n,\n,\n", "time_s cap_V", &[0.0, 1.0], 2),
        ("n,cap_V\n0,1\n,\n1,2\n", "n cap_V", &[0.0, 1.0], 3),
        ("time_s,cap_mV\n0,\"1,076.03\"\n1,\"12.5\"\n", "time_s cap_mV", &[0.0, 1076.03], 2),
        ("time_s;cap_mV\n0;1.234,50\n1;0,5\n2;1.234\n", "time_s cap_mV", &[0.0, 1234.5], 3),
        ("time_s;cap_mV\n0;1'234.50\n", "time_s cap_mV", &[0.0, 1234.5], 1),
    ] {
        let table = text(file, &CsvHints::default()).unwrap_or_else(|error| panic!("{file}: {error}"));
        assert_eq!(names(table.as_ref()).join(" "), columns, "{file}");
        let block = whole(table, 3).unwrap();
        assert_eq!(block.rows, rows, "{file}");
        for (column, number) in block.numbers.iter().zip(first) {
            assert_eq!(column[0].to_bits(), number.to_bits(), "{file}");
        }
    }
    // The second row comes one interval later.
    for (file, second) in [(xsens, 0.01), (sigrok, 1e-6), ("# fs_kHz: 4\nA,B\n1,2\n3,4\n", 0.25e-3)] {
        let block = whole(text(file, &CsvHints::default()).unwrap(), 3).unwrap();
        approx::assert_relative_eq!(block.numbers[0][1], second, max_relative = 1e-15);
    }
    // The line of the names may be said as well.
    let table = text(toa5, &CsvHints { header_line: Some(2), ..CsvHints::default() }).unwrap();
    assert_eq!(names(table.as_ref())[2..], ["Accel_X_m_per_s2", "PTemp_degC"]);
    // A comment that says when the file was made is no line of names.
    let table = text(
        "# Created at 2021-04-23 03:53:31\n143786 0.19 -0.19 0.01\n143787 0.2 -0.1 0.02\n",
        &CsvHints::default(),
    );
    assert_eq!(names(table.unwrap().as_ref())[0], "143786");
    // A group that may be a decimal is no number where nothing in its column tells.
    let block = whole(text("time_s,cap_V\n0,\"1,234\"\n", &CsvHints::default()).unwrap(), 3).unwrap();
    assert_eq!(block.faults[0].fault, CellFinding::Text("1,234".to_owned()));
}

/// The names that the settings give for rows between blanks count where the words above them are of another number.
#[test]
fn stated_names_replace_words_of_another_number() {
    let columns = Some(["time_s", "ch1_V"].map(str::to_owned).to_vec());
    let hints = Hints { columns, ..Hints::default() };
    let table = read_csv(Cursor::new("time cap left\n0 1\n1 2\n".as_bytes()), &hints).unwrap();
    assert_eq!(names(table.as_ref()), ["time_s", "ch1_V"]);
    let block = whole(table, 2).unwrap();
    assert_eq!(
        (block.numbers[0].as_slice(), block.numbers[1].as_slice()),
        (&[0.0, 1.0][..], &[1.0, 2.0][..])
    );
}

#[test]
fn lines_of_words_above_rows_that_may_all_be_names_are_refused_with_what_to_write() {
    let file = "a title of a file\nleft,right\nupper,lower\n1,2\n3,4\n";
    let said = text(file, &CsvHints::default()).err().unwrap().to_string();
    assert!(
        said.contains("lines 2 to 3 each hold as many words") && said.contains("header_line = 3"),
        "{said}"
    );
}

/// Waveforms that begin a whole number of samples later than others stand in the rows of their times.
#[test]
fn waveforms_that_begin_later_stand_in_the_rows_of_their_times() {
    let infiniium = "Revision:,1,1\nType:,raw,raw\nPoints:,4,4\nXInc:,1e-3,1e-3\nXOrg:,0.5,0.502\nData:\n\
                     1,10\n2,20\n3,---\n4,40\n";
    let yokogawa = "\"Header Size\",4\n\"TraceName\",\"Channel 1\",\"Channel 2\"\n\"HResolution\",1e-3,1e-3\n\
                    \"HOffset\",0.5,0.502\n,1,10\n,2,20\n,3,---\n,4,40\n";
    // The second channel begins 2 ms later: 5 ms by its date, less 3 ms by its own start.
    let labview = "LabVIEW Measurement\t\nSeparator\tTab\nDecimal_Separator\t.\nMulti_Headings\tNo\nX_Columns\tNo\n\
                   ***End_of_Header***\t\nChannels\t2\nDate\t2026/03/01\t2026/03/01\n\
                   Time\t23:59:59.998\t23:59:60.003\nX_Dimension\tTime\tTime\nX0\t0.5\t0.497\nDelta_X\t1e-3\t1e-3\n\
                   ***End_of_Header***\nX_Value\tChannel 1\tChannel 2\tComment\n\t1\t10\n\t2\t20\n\t3\t---\n\t4\t40\n";
    for (what, file) in [("Infiniium", infiniium), ("Yokogawa", yokogawa), ("LabVIEW", labview)] {
        for capacity in [1, 3, 100] {
            let table = text(file, &CsvHints::default()).unwrap_or_else(|error| panic!("{what}: {error}"));
            let said = table.description().recognised.clone();
            assert!(said.contains("begins 2 samples later"), "{said}");
            let block = whole(table, capacity).unwrap();
            assert_eq!(block.numbers[0], [0.5, 0.501, 0.502, 0.503, 0.504, 0.505], "{what}");
            let nan = f64::NAN;
            for (column, expected) in
                [(1, [1.0, 2.0, 3.0, 4.0, nan, nan]), (2, [nan, nan, 10.0, 20.0, nan, 40.0])]
            {
                let bits = |numbers: &[f64]| numbers.iter().map(|n| n.to_bits()).collect::<Vec<_>>();
                assert_eq!(
                    bits(&block.numbers[column]),
                    bits(&expected),
                    "{what}, {capacity} rows at a time"
                );
            }
            let faults: Vec<_> = block.faults.iter().map(|f| (f.row, f.column, f.fault.clone())).collect();
            let missing = |row, column| (row, Some(column), CellFinding::Missing);
            let nothing = (4, Some(2), CellFinding::Nan("---".to_owned()));
            assert_eq!(faults.len(), 5, "{what}: {faults:?}");
            for fault in [missing(0, 2), missing(1, 2), missing(4, 1), nothing, missing(5, 1)] {
                assert!(faults.contains(&fault), "{what}, {capacity} rows at a time: {faults:?}");
            }
        }
    }
    let records = labview.replace("Multi_Headings\tNo", "Multi_Headings\tYes");
    let error = text(&records, &CsvHints::default()).err().unwrap().to_string();
    assert!(error.contains("`Channel 2_") || error.contains("`Channel 2`"), "{error}");
    let far = infiniium.replace("0.502", "900");
    let error = text(&far, &CsvHints::default()).err().unwrap().to_string();
    assert!(error.contains("at most 65536 are held"), "{error}");
}

/// The rows of a LabVIEW file with a column of times for each of two channels.
fn times_of_each(rows: impl Iterator<Item = (f64, f64)>) -> String {
    let head = "LabVIEW Measurement\t\nSeparator\tTab\nDecimal_Separator\t.\nMulti_Headings\tNo\nX_Columns\tMulti\n\
                ***End_of_Header***\t\nChannels\t2\nY_Unit_Label\tV\t\tV\nX_Dimension\tTime\t\tTime\n***End_of_Header***\n\
                X_Value\tdrive\tX_Value\tcap\tComment\n";
    let row = |(row, (first, second)): (usize, (f64, f64))| {
        format!("{first:.6}\t{}\t{second:.6}\t{}\n", row + 1, 10 * (row + 1))
    };
    head.to_owned() + &rows.enumerate().map(row).collect::<String>()
}

const fn number(column: usize) -> WantedColumn {
    WantedColumn::Number { column, power: 0 }
}

/// Of two channels with times of their own the one that begins whole samples later stands in the rows of its times, whichever it is.
#[test]
fn waveforms_with_later_times_of_their_own_stand_in_the_rows_of_these() {
    let time = |k: u32| f64::from(k) * 1e-3 + 0.5;
    let nan = f64::NAN;
    let (early, late) = ([1.0, 2.0, 3.0, 4.0, nan, nan], [nan, nan, 1.0, 2.0, 3.0, 4.0]);
    let bits = |numbers: &[f64]| numbers.iter().map(|n| n.to_bits()).collect::<Vec<_>>();
    for (drive_later, cap_later) in [(0, 2), (2, 0), (0, 0)] {
        let file = times_of_each((0..4).map(|k| (time(k + drive_later), time(k + cap_later))));
        for (capacity, wanted) in [1, 3, 100].into_iter().flat_map(|c| [(c, vec![0, 1, 3]), (c, vec![1, 3])])
        {
            let mut table = text(&file, &CsvHints::default()).unwrap();
            assert!(table.description().columns.iter().all(|column| column.apart.is_none()));
            let wants: Vec<WantedColumn> = wanted
                .iter()
                .map(|column| match column {
                    0 => WantedColumn::Time { column: 0, unit: TimeUnit::SECOND, origin: None },
                    column => number(*column),
                })
                .collect();
            table.want(&wants).unwrap();
            let (mut columns, mut faults) = (vec![Vec::new(); wanted.len()], Vec::new());
            let (mut block, mut begin) = (Block::with_capacity(capacity), 0);
            loop {
                table.read(&mut block).unwrap();
                if block.is_end() {
                    break;
                }
                assert_eq!(block.numbers.len(), wanted.len());
                for (all, some) in columns.iter_mut().zip(&block.numbers) {
                    all.extend_from_slice(some);
                }
                faults.extend(block.faults.iter().map(|f| (begin + f.row, f.column, f.fault.clone())));
                begin += block.rows;
            }
            let rows = 4 + drive_later.max(cap_later);
            if wanted.len() == 3 {
                let times = columns.remove(0);
                assert_eq!(bits(&times), bits(&(0..rows).map(time).collect::<Vec<_>>()), "{capacity}");
            }
            let shifted = |later: u32| if later > 0 { late } else { early }[..rows as usize].to_vec();
            let cap: Vec<f64> = shifted(cap_later).iter().map(|number| 10.0 * number).collect();
            assert_eq!(bits(&columns[0]), bits(&shifted(drive_later)), "{capacity}");
            assert_eq!(bits(&columns[1]), bits(&cap), "{capacity}");
            let missing = |column| (column, CellFinding::Missing);
            let count = if rows == 6 { 2 } else { 0 };
            for column in [Some(1), Some(3)] {
                let own = faults.iter().filter(|(_, of, fault)| (*of, fault.clone()) == missing(column));
                assert_eq!(own.count(), count, "{capacity}: {faults:?}");
            }
            assert_eq!(faults.len(), 2 * count, "{faults:?}");
        }
    }
}

/// Where the times of two channels part behind the rows that are looked at first, the file is refused in the row where they do.
#[test]
fn a_waveform_whose_own_times_leave_those_of_the_rows_is_refused_there() {
    let drift = |k: u32| f64::from(k) * 1e-3 + if k < 300 { 0.002 } else { 0.003 };
    let file = times_of_each((0..400).map(|k| (f64::from(k) * 1e-3, drift(k))));
    let mut table = text(&file, &CsvHints::default()).unwrap();
    table.want(&[number(1), number(3)]).unwrap();
    let mut block = Block::with_capacity(64);
    let error = std::iter::repeat_with(|| table.read(&mut block)).take(20).find_map(Result::err).unwrap();
    let said = error.to_string();
    assert!(said.contains("column 3 with the time 0.303 in row 303, whose time is 0.302"), "{said}");
    // Alone each is read to its end.
    let mut table = text(&file, &CsvHints::default()).unwrap();
    table.want(&[number(1)]).unwrap();
    let rows = std::iter::repeat_with(|| table.read(&mut block).map(|()| block.rows).unwrap());
    assert_eq!(rows.take_while(|rows| *rows > 0).sum::<usize>(), 400);
}

/// A waveform that begins between the samples of another, or comes at another rate, is refused beside it by name.
#[test]
fn waveforms_with_other_times_of_their_own_are_refused_beside_each_other_by_name() {
    let time = |k: u32| f64::from(k) * 1e-3;
    let between = times_of_each((0..4).map(|k| (time(k), time(k) + 0.0033)));
    let other_rate = times_of_each((0..4).map(|k| (time(k), time(k) / 2.0 + 0.008)));
    for (file, why) in [
        (between, "it starts 0.0033 s after `drive_V`: 3.3 samples, no whole number"),
        (other_rate, "its samples do not come as those of `drive_V`"),
    ] {
        let mut table = text(&file, &CsvHints::default()).unwrap();
        assert_eq!(table.description().columns[3].apart.as_deref(), Some(why));
        let error = table.want(&[number(0), number(3)]).unwrap_err().to_string();
        assert!(error.contains("together with `time_s`") && error.contains(why), "{error}");
        table.want(&[number(2), number(3)]).unwrap();
        let mut block = Block::with_capacity(9);
        table.read(&mut block).unwrap();
        assert_eq!(block.numbers[1], [10.0, 20.0, 30.0, 40.0]);
    }
}
