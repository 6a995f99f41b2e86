//! The results as Parquet, for programs that read millions of rows.

use super::table::{Table, number};
use parquet::basic::{Compression, LogicalType, Repetition, Type as Physical};
use parquet::data_type::{ByteArray, ByteArrayType, DoubleType};
use parquet::errors::ParquetError;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::types::Type;
use std::io::{self, Write};
use std::sync::Arc;

/// One row group; figures are doubles and words are text, and a cell without anything is null.
pub(super) fn write(table: &Table, w: &mut dyn Write) -> io::Result<()> {
    let mut bytes = Vec::new();
    fill(table, &mut bytes).map_err(io::Error::other)?;
    w.write_all(&bytes)
}

fn fill(table: &Table, bytes: &mut Vec<u8>) -> Result<(), ParquetError> {
    let numbers: Vec<bool> = (0..table.columns.len()).map(|column| table.is_number(column)).collect();
    let field = |(name, is_number): (&String, &bool)| {
        let physical = if *is_number { Physical::DOUBLE } else { Physical::BYTE_ARRAY };
        Type::primitive_type_builder(name, physical)
            .with_repetition(Repetition::OPTIONAL)
            .with_logical_type((!is_number).then_some(LogicalType::String))
            .build()
            .map(Arc::new)
    };
    let fields: Result<Vec<_>, _> = table.columns.iter().zip(&numbers).map(field).collect();
    let schema = Arc::new(Type::group_type_builder("study").with_fields(fields?).build()?);
    // The writer's version is no part of the results.
    let properties = WriterProperties::builder()
        .set_compression(Compression::UNCOMPRESSED)
        .set_created_by(concat!("kalmems ", env!("CARGO_PKG_VERSION")).to_owned());
    let mut writer = SerializedFileWriter::new(bytes, schema, Arc::new(properties.build()))?;
    let mut group = writer.next_row_group()?;
    for (column, is_number) in numbers.iter().enumerate() {
        let cells = || table.rows.iter().map(|line| line.cells[column].as_str());
        let present: Vec<i16> = cells().map(|cell| i16::from(!cell.is_empty())).collect();
        let there = cells().filter(|cell| !cell.is_empty());
        let Some(mut chunk) = group.next_column()? else { break };
        if *is_number {
            let values: Vec<f64> = there.filter_map(number).collect();
            chunk.typed::<DoubleType>().write_batch(&values, Some(&present), None)?;
        } else {
            let values: Vec<ByteArray> = there.map(ByteArray::from).collect();
            chunk.typed::<ByteArrayType>().write_batch(&values, Some(&present), None)?;
        }
        chunk.close()?;
    }
    group.close()?;
    writer.close().map(|_| ())
}

#[cfg(test)]
mod tests {
    use super::super::table::Line;
    use super::*;
    use parquet::file::reader::{FileReader, SerializedFileReader};
    use parquet::record::RowAccessor;

    /// The reader of the same crate; what it reads is what the table has.
    #[test]
    fn reads_back() {
        let cells = [["0", "consistent", ""], ["1", "", "0.1"], ["2", "LOST", "-1e-300"]];
        let table = Table {
            columns: ["point", "verdict", "errors.angle.rmse_deg"].map(str::to_owned).to_vec(),
            rows: cells.map(|cells| Line { run: 0, cells: cells.map(str::to_owned).to_vec() }).to_vec(),
            before: 1,
        };
        let mut bytes = Vec::new();
        write(&table, &mut bytes).unwrap();
        let reader = SerializedFileReader::new(bytes::Bytes::from(bytes)).unwrap();
        let rows: Vec<_> = reader.get_row_iter(None).unwrap().map(Result::unwrap).collect();
        assert_eq!(rows.len(), 3);
        for (row, cells) in rows.iter().zip(cells) {
            assert_eq!(Some(row.get_double(0).unwrap()), number(cells[0]));
            assert_eq!(row.get_string(1).map_or("", String::as_str), cells[1]);
            assert_eq!(row.get_double(2).ok(), number(cells[2]));
        }
    }
}
