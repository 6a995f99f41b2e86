//! What the values of a column are, and as which bytes they are handed on.

use crate::element::{Element, ElementKind};
use crate::records::StoredCell;
use crate::time::{TimeCode, TimeForm};
use crate::{TimeKind, TimeUnit, refuse_if};
use parquet::basic::{ConvertedType, LogicalType, Type};
use parquet::column::reader::{ColumnReader, ColumnReaderImpl};
use parquet::data_type::{ByteArray, DataType};
use parquet::errors::ParquetError;
use parquet::schema::types::ColumnDescriptor;

/// Bytes of the largest whole number that is read.
const BYTES: i32 = 16;

/// What a column holds, nothing of texts, which have several lengths, and the power of ten that its numbers are to be multiplied by; or why it
/// is left out.
pub(super) fn stored(descriptor: &ColumnDescriptor) -> Result<(Option<StoredCell>, i32), &'static str> {
    refuse_if(descriptor.max_rep_level() > 0, || "a list in each row")?;
    let (physical, logical) = (descriptor.physical_type(), descriptor.logical_type_ref());
    let number = |kind, bytes| Ok((Some(StoredCell::Number(Element::little(kind, bytes))), 0));
    let decimal = match (logical, descriptor.converted_type()) {
        (Some(LogicalType::Float16), _) => {
            let fits = physical == Type::FIXED_LEN_BYTE_ARRAY && descriptor.type_length() == 2;
            return if fits { number(ElementKind::Float, 2) } else { Err("bytes of a fixed length") };
        }
        (Some(LogicalType::Decimal(decimal)), _) => Some(decimal.scale),
        (None, ConvertedType::DECIMAL) => Some(descriptor.type_scale()),
        _ => None,
    };
    if let Some(scale) = decimal.map(i32::saturating_neg) {
        let bytes = match physical {
            _ if !(-400..=400).contains(&scale) => return Err("decimal numbers of more than 38 digits"),
            Type::INT32 => 4,
            Type::INT64 => 8,
            Type::FIXED_LEN_BYTE_ARRAY if (1..=BYTES).contains(&descriptor.type_length()) => 16,
            _ => return Err("decimal numbers of more than 38 digits"),
        };
        return Ok((Some(StoredCell::Number(Element::little(ElementKind::Signed, bytes))), scale));
    }
    if let Some(code) = time(descriptor) {
        return Ok((Some(StoredCell::Time(code)), 0));
    }
    match physical {
        Type::BOOLEAN => number(ElementKind::Unsigned, 1),
        Type::FLOAT => number(ElementKind::Float, 4),
        Type::DOUBLE => number(ElementKind::Float, 8),
        Type::INT32 | Type::INT64 => {
            let whole = if physical == Type::INT32 { 4 } else { 8 };
            match descriptor.converted_type() {
                _ if !matches!(logical, Some(LogicalType::Integer { .. }) | None) => {
                    Err("dates or times of day")
                }
                // Where ends of it may say that there is no number.
                ConvertedType::INT_16 => number(ElementKind::Signed, 2),
                ConvertedType::UINT_16 => number(ElementKind::Unsigned, 2),
                ConvertedType::UINT_8 | ConvertedType::UINT_32 | ConvertedType::UINT_64 => {
                    number(ElementKind::Unsigned, whole)
                }
                ConvertedType::NONE
                | ConvertedType::INT_8
                | ConvertedType::INT_32
                | ConvertedType::INT_64 => number(ElementKind::Signed, whole),
                _ if logical.is_some() => number(ElementKind::Signed, whole),
                _ => Err("dates or times of day"),
            }
        }
        Type::BYTE_ARRAY => match logical {
            Some(LogicalType::String | LogicalType::Enum) | None => Ok((None, 0)),
            _ => Err("bytes with a meaning of their own"),
        },
        Type::INT96 => Err("dates"),
        Type::FIXED_LEN_BYTE_ARRAY => Err("bytes of a fixed length"),
    }
}

/// The dates and times of a day that are integers.
fn time(descriptor: &ColumnDescriptor) -> Option<TimeCode> {
    use parquet::basic::TimeUnit as Unit;
    let power = |unit: Unit| match unit {
        Unit::MILLIS => -3,
        Unit::MICROS => -6,
        Unit::NANOS => -9,
    };
    let (unit, kind) = match (descriptor.logical_type_ref(), descriptor.converted_type()) {
        (Some(LogicalType::Timestamp(time)), _) => (TimeUnit::decimal(power(time.unit)), TimeKind::Calendar),
        (Some(LogicalType::Time(time)), _) => (TimeUnit::decimal(power(time.unit)), TimeKind::Elapsed),
        (Some(LogicalType::Date), _) | (None, ConvertedType::DATE) => {
            (TimeUnit::seconds(86_400), TimeKind::Calendar)
        }
        (None, ConvertedType::TIMESTAMP_MILLIS) => (TimeUnit::decimal(-3), TimeKind::Calendar),
        (None, ConvertedType::TIMESTAMP_MICROS) => (TimeUnit::decimal(-6), TimeKind::Calendar),
        (None, ConvertedType::TIME_MILLIS) => (TimeUnit::decimal(-3), TimeKind::Elapsed),
        (None, ConvertedType::TIME_MICROS) => (TimeUnit::decimal(-6), TimeKind::Elapsed),
        _ => return None,
    };
    let bytes = match descriptor.physical_type() {
        Type::INT32 => 4,
        Type::INT64 => 8,
        _ => return None,
    };
    let form = TimeForm::Integer(Element::little(ElementKind::Signed, bytes));
    Some(TimeCode { form, unit, kind })
}

/// What values are appended to.
pub(super) enum ReadValues<'a> {
    Records(&'a mut Vec<u8>),
    Texts(&'a mut Vec<Vec<u8>>),
}

/// Rows that are to be read.
pub(super) struct RowsToRead<'a> {
    pub(super) rows: usize,
    /// The level that says that a value is there; 0 where all are.
    pub(super) levels: i16,
    pub(super) missing: &'a mut Vec<bool>,
}

/// Reads values of whichever type; how many rows they are.
pub(super) fn take(
    reader: &mut ColumnReader,
    cell: Option<StoredCell>,
    rows: RowsToRead<'_>,
    out: &mut ReadValues<'_>,
) -> Result<usize, ParquetError> {
    let other = || ParquetError::General("values of another type than the column's".to_owned());
    let out = match out {
        ReadValues::Records(out) => out,
        ReadValues::Texts(out) => {
            let ColumnReader::ByteArrayColumnReader(reader) = reader else { return Err(other()) };
            return rows.read(reader, |text: Option<&ByteArray>| {
                out.push(text.map_or_else(Vec::new, |text| text.data().trim_ascii().to_vec()));
                Some(())
            });
        }
    };
    match (reader, cell.map_or(0, StoredCell::bytes)) {
        (ColumnReader::BoolColumnReader(r), 1) => rows.records(r, out, |x| Some([u8::from(*x)])),
        // Of one that is not of 16 bits the schema is wrong.
        (ColumnReader::Int32ColumnReader(r), 2) => rows.records(r, out, |x| {
            let is_signed =
                matches!(cell, Some(StoredCell::Number(Element { kind: ElementKind::Signed, .. })));
            let signed = i16::try_from(*x).ok().filter(|_| is_signed);
            let unsigned = || u16::try_from(*x).ok().filter(|_| !is_signed);
            signed.map(i16::to_le_bytes).or_else(|| unsigned().map(u16::to_le_bytes))
        }),
        (ColumnReader::Int32ColumnReader(r), 4) => rows.records(r, out, |x| Some(x.to_le_bytes())),
        (ColumnReader::Int64ColumnReader(r), 8) => rows.records(r, out, |x| Some(x.to_le_bytes())),
        (ColumnReader::FloatColumnReader(r), 4) => rows.records(r, out, |x| Some(x.to_le_bytes())),
        (ColumnReader::DoubleColumnReader(r), 8) => rows.records(r, out, |x| Some(x.to_le_bytes())),
        (ColumnReader::FixedLenByteArrayColumnReader(r), 2) => {
            rows.records(r, out, |x| x.data().first_chunk::<2>().copied())
        }
        (ColumnReader::FixedLenByteArrayColumnReader(r), 16) => {
            rows.records(r, out, |x| Some(whole(x.data()).to_le_bytes()))
        }
        _ => Err(other()),
    }
}

impl RowsToRead<'_> {
    /// Appends the bytes of each value, zeros where there is none.
    fn records<T: DataType, const N: usize>(
        self,
        reader: &mut ColumnReaderImpl<T>,
        out: &mut Vec<u8>,
        bytes: impl Fn(&T::T) -> Option<[u8; N]>,
    ) -> Result<usize, ParquetError> {
        self.read(reader, |value: Option<&T::T>| {
            out.extend_from_slice(&value.map_or(Some([0; N]), &bytes)?);
            Some(())
        })
    }

    /// Hands each value on, `None` where there is none.
    fn read<T: DataType>(
        self,
        reader: &mut ColumnReaderImpl<T>,
        mut each: impl FnMut(Option<&T::T>) -> Option<()>,
    ) -> Result<usize, ParquetError> {
        let (mut values, mut levels) = (Vec::<T::T>::new(), Vec::new());
        let is_nullable = self.levels > 0;
        let (rows, ..) =
            reader.read_records(self.rows, is_nullable.then_some(&mut levels), None, &mut values)?;
        let beyond = || ParquetError::General("a value beyond the type of its column".to_owned());
        let mut values = values.iter();
        for row in 0..rows {
            let is_there = !is_nullable || levels.get(row) == Some(&self.levels);
            let value = if is_there { values.next() } else { None };
            if is_nullable {
                self.missing.push(value.is_none());
            } else if value.is_none() {
                return Err(ParquetError::General("fewer values than rows".to_owned()));
            }
            each(value).ok_or_else(beyond)?;
        }
        Ok(rows)
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
