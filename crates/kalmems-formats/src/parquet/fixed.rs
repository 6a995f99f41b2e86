//! Numbers of Parquet that are no machine's: decimal ones, and floating-point numbers of 16 bits.

use super::{OutputColumn, RowsToRead, ValueKind};
use crate::decimal::Shift;
use crate::element;
use parquet::basic::{ConvertedType, LogicalType, Type};
use parquet::column::reader::ColumnReader;
use parquet::errors::ParquetError;
use parquet::schema::types::ColumnDescriptor;

/// Bytes of the largest whole number that is read.
const BYTES: i32 = 16;

/// What such a column holds; none where it is another.
pub(super) fn kind(descriptor: &ColumnDescriptor) -> Option<Result<ValueKind, &'static str>> {
    let (physical, logical) = (descriptor.physical_type(), descriptor.logical_type_ref());
    if matches!(logical, Some(LogicalType::Float16)) {
        let fits = physical == Type::FIXED_LEN_BYTE_ARRAY && descriptor.type_length() == 2;
        return Some(if fits { Ok(ValueKind::Half) } else { Err("bytes of a fixed length") });
    }
    let scale = match (logical, descriptor.converted_type()) {
        (Some(LogicalType::Decimal(decimal)), _) => decimal.scale,
        (None, ConvertedType::DECIMAL) => descriptor.type_scale(),
        _ => return None,
    };
    let fits = match physical {
        Type::INT32 | Type::INT64 => true,
        Type::FIXED_LEN_BYTE_ARRAY => (1..=BYTES).contains(&descriptor.type_length()),
        _ => false,
    };
    let known = fits && (-400..=400).contains(&scale);
    Some(if known { Ok(ValueKind::Decimal { scale }) } else { Err("decimal numbers of more than 38 digits") })
}

/// Reads the values of such a column.
pub(super) fn take(
    reader: &mut ColumnReader,
    records: &mut RowsToRead<'_>,
    out: OutputColumn<'_>,
    power: i32,
) -> Result<usize, ParquetError> {
    let scale = if let ValueKind::Decimal { scale } = records.leaf.kind { scale } else { 0 };
    let is_half = records.leaf.kind == ValueKind::Half;
    let mut shift = Shift::new(power.saturating_sub(scale));
    let mut number = |whole: i128| shift.integer(whole);
    let label = |whole: i128| element::shortest(Shift::new(-scale).integer(whole)).into_bytes();
    match reader {
        ColumnReader::Int32ColumnReader(r) => {
            records.read(r, out, |x| number(i128::from(*x)), |x| label(i128::from(*x)))
        }
        ColumnReader::Int64ColumnReader(r) => {
            records.read(r, out, |x| number(i128::from(*x)), |x| label(i128::from(*x)))
        }
        ColumnReader::FixedLenByteArrayColumnReader(r) if is_half => {
            let mut shift = Shift::new(power);
            let half = |bytes: &[u8]| match bytes {
                [low, high] => element::half(u16::from_le_bytes([*low, *high])),
                _ => f64::NAN,
            };
            records.read(
                r,
                out,
                |x| shift.float(half(x.data())),
                |x| element::shortest(half(x.data())).into_bytes(),
            )
        }
        ColumnReader::FixedLenByteArrayColumnReader(r) => {
            records.read(r, out, |x| number(whole(x.data())), |x| label(whole(x.data())))
        }
        _ => Err(ParquetError::General("values of another type than the column's".to_owned())),
    }
}

/// A whole number of two's complement, the highest byte first.
fn whole(bytes: &[u8]) -> i128 {
    let start = if bytes.first().is_some_and(|byte| byte & 0x80 != 0) { -1 } else { 0 };
    bytes.iter().take(16).fold(start, |number: i128, byte| number << 8 | i128::from(*byte))
}

#[cfg(test)]
mod tests {
    use super::whole;

    #[test]
    fn whole_numbers_keep_their_sign() {
        assert_eq!(whole(&[0xff, 0xfe]), -2);
        assert_eq!(whole(&[0, 0x80]), 128);
        assert_eq!(whole(&[0x80]), -128);
        assert_eq!(whole(&i128::MIN.to_be_bytes()), i128::MIN);
    }
}
