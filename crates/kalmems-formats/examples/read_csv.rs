//! Reads all columns of a CSV file as numbers and prints how many rows there are, and a sum that depends on every number.

use kalmems_formats::{Block, FormatError, Hints, WantedColumn, open_csv};
use std::path::Path;

fn main() -> Result<(), FormatError> {
    let path = std::env::args().nth(1).unwrap_or_default();
    let mut table = open_csv(Path::new(&path), &Hints::default())?;
    let columns = table.description().columns.len();
    let wanted: Vec<WantedColumn> =
        (0..columns).map(|column| WantedColumn::Number { column, power: 0 }).collect();
    table.want(&wanted)?;
    let mut block = Block::with_capacity(8192);
    let (mut rows, mut sum) = (0, 0.0);
    loop {
        table.read(&mut block)?;
        if block.is_end() {
            break;
        }
        rows += block.rows;
        sum += block.numbers.iter().flatten().sum::<f64>();
    }
    println!("{rows} rows, sum {sum:.6e}");
    Ok(())
}
