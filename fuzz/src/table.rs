//! Bytes as a file of a format.

use kalmems_formats::{Block, Format, Hints, Table, TimeUnit, WantedColumn, open_reader};
use std::io::Cursor;

/// Opens and reads the bytes, as they are and with the hints that a format without names needs.
pub fn read(format: Format, data: &[u8]) {
    let open = |hints: &Hints| open_reader(Cursor::new(data.to_vec()), "", hints);
    let plain = Hints { format: Some(format), ..Hints::default() };
    let table = open(&plain).or_else(|_| {
        // As the fixtures need them.
        let columns = ["time_s", "drive_V", "cap_V"].map(str::to_owned).to_vec();
        open(&Hints { group: None, columns: Some(columns), ..plain.clone() })
            .or_else(|_| open(&Hints { group: Some("run".to_owned()), columns: None, ..plain.clone() }))
    });
    if let Ok(table) = table {
        drain(table);
    }
}

fn drain(mut table: Box<dyn Table>) {
    let count = table.description().columns.len().min(16);
    let mut wanted = Vec::new();
    for column in 0..count {
        // The first is the time, as in most files.
        let number = match column {
            0 => WantedColumn::Time { column, unit: TimeUnit::decimal(-9), origin: None },
            _ => WantedColumn::Number { column, power: if column % 2 == 0 { 0 } else { -3 } },
        };
        if table.want(&[number]).is_ok() {
            wanted.push(number);
        }
        if column % 4 == 3 || wanted.is_empty() {
            wanted.push(WantedColumn::Label { column });
        }
    }
    // All, or those that are of one length with the first.
    if table.want(&wanted).is_err() && table.want(&wanted[..wanted.len().min(1)]).is_err() {
        return;
    }
    let mut block = Block::with_capacity(256);
    for _ in 0..64 {
        if table.read(&mut block).is_err() || block.is_end() {
            return;
        }
        let _ = table.progress();
    }
}
