//! Tables as Parquet, for programs that read millions of rows: numbers by the bytes of their places (byte-stream split), words by
//! dictionary, and all of it packed as Zstandard.
//!
//! The crate `parquet` has Zstandard by a library in C alone, which neither a browser nor a machine without a compiler for C has. So it
//! writes its pages as they are, and they are packed on their way by `ruzstd`, which unpacks those of others already.

use bytes::Bytes;
use parquet::basic::{Compression, Encoding, LogicalType, Repetition, Type as Physical, ZstdLevel};
use parquet::column::page::{CompressedPage, Page, PageWriteSpec, PageWriter};
use parquet::column::writer::{ColumnCloseResult, ColumnWriterImpl};
use parquet::data_type::{ByteArray, ByteArrayType, DoubleType};
use parquet::errors::ParquetError;
use parquet::file::properties::{WriterProperties, WriterPropertiesPtr};
use parquet::file::writer::{SerializedFileWriter, SerializedPageWriter, TrackedWrite};
use parquet::schema::types::{ColumnDescPtr, ColumnPath, Type};
use ruzstd::encoding::{CompressionLevel, compress_to_vec};
use std::io::{self, Write};
use std::sync::Arc;

/// A column by its name.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct ParquetColumn {
    pub(crate) name: String,
    pub(crate) kind: ParquetColumnKind,
}

/// What a column holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ParquetColumnKind {
    Numbers,
    Words,
}

/// The cells of a column in some rows; what is not there is null.
pub(crate) enum Cells<'a> {
    Numbers(Vec<Option<f64>>),
    Words(Vec<Option<&'a str>>),
}

/// A file of a table, written a group of rows after the other.
pub(crate) struct ParquetFile<W: Write + Send> {
    writer: SerializedFileWriter<W>,
    properties: WriterPropertiesPtr,
}

impl<W: Write + Send> ParquetFile<W> {
    /// A file with these columns and no row yet.
    pub(crate) fn begin(to: W, columns: &[ParquetColumn]) -> io::Result<Self> {
        let field = |ParquetColumn { name, kind }: &ParquetColumn| {
            let physical =
                if *kind == ParquetColumnKind::Numbers { Physical::DOUBLE } else { Physical::BYTE_ARRAY };
            Type::primitive_type_builder(name, physical)
                .with_repetition(Repetition::OPTIONAL)
                .with_logical_type((*kind == ParquetColumnKind::Words).then_some(LogicalType::String))
                .build()
                .map(Arc::new)
        };
        let fields: Result<Vec<_>, _> = columns.iter().map(field).collect();
        let schema = Type::group_type_builder("table").with_fields(fields.map_err(io::Error::other)?);
        let schema = Arc::new(schema.build().map_err(io::Error::other)?);
        // The writer's version is no part of the results.
        let mut properties = WriterProperties::builder()
            .set_compression(Compression::UNCOMPRESSED)
            .set_created_by(concat!("kalmems ", env!("CARGO_PKG_VERSION")).to_owned());
        for ParquetColumn { name, .. } in
            columns.iter().filter(|column| column.kind == ParquetColumnKind::Numbers)
        {
            let path = ColumnPath::new(vec![name.clone()]);
            properties = properties
                .set_column_dictionary_enabled(path.clone(), false)
                .set_column_encoding(path, Encoding::BYTE_STREAM_SPLIT);
        }
        let properties = Arc::new(properties.build());
        let writer = SerializedFileWriter::new(to, schema, properties.clone());
        Ok(Self { writer: writer.map_err(io::Error::other)?, properties })
    }

    /// Writes some rows, given by their columns in the order of the file.
    pub(crate) fn rows<'a>(&mut self, columns: impl IntoIterator<Item = Cells<'a>>) -> io::Result<()> {
        self.group(columns).map_err(io::Error::other)
    }

    fn group<'a>(&mut self, columns: impl IntoIterator<Item = Cells<'a>>) -> Result<(), ParquetError> {
        let described = self.writer.schema_descr().columns().to_vec();
        let mut group = self.writer.next_row_group()?;
        for (description, cells) in described.into_iter().zip(columns) {
            let (bytes, closed) = chunk(&description, &self.properties, &cells)?;
            group.append_column(&bytes, closed)?;
        }
        group.close().map(|_| ())
    }

    /// Writes what stands behind the rows.
    pub(crate) fn finish(self) -> io::Result<W> {
        self.writer.into_inner().map_err(io::Error::other)
    }
}

/// The pages of some cells of a column, and what a file says of them.
fn chunk(
    description: &ColumnDescPtr,
    properties: &WriterPropertiesPtr,
    cells: &Cells,
) -> Result<(Bytes, ColumnCloseResult), ParquetError> {
    let mut packed = TrackedWrite::new(Vec::new());
    let pages = Box::new(PackedPages(SerializedPageWriter::new(&mut packed)));
    let (description, properties) = (description.clone(), properties.clone());
    // The crate's own choice among all types would bring the writers of all of them into every program.
    let mut closed = match (description.physical_type(), cells) {
        (Physical::DOUBLE, Cells::Numbers(cells)) => {
            let values: Vec<f64> = cells.iter().flatten().copied().collect();
            let mut writer = ColumnWriterImpl::<DoubleType>::new(description, properties, pages);
            writer.write_batch(&values, Some(&present(cells)), None)?;
            writer.close()?
        }
        (Physical::BYTE_ARRAY, Cells::Words(cells)) => {
            let values: Vec<ByteArray> = cells.iter().flatten().map(|word| ByteArray::from(*word)).collect();
            let mut writer = ColumnWriterImpl::<ByteArrayType>::new(description, properties, pages);
            writer.write_batch(&values, Some(&present(cells)), None)?;
            writer.close()?
        }
        _ => return Err(ParquetError::General(format!("`{}` has other cells", description.name()))),
    };
    let codec = Compression::ZSTD(ZstdLevel::default());
    closed.metadata = closed.metadata.into_builder().set_compression_codec(codec.into()).build()?;
    let bytes = packed.into_inner()?;
    Ok((bytes.into(), closed))
}

fn present<T>(cells: &[Option<T>]) -> Vec<i16> {
    cells.iter().map(|cell| i16::from(cell.is_some())).collect()
}

/// Packs pages on their way.
struct PackedPages<'a>(SerializedPageWriter<'a, Vec<u8>>);

impl PageWriter for PackedPages<'_> {
    fn write_page(&mut self, page: CompressedPage) -> Result<PageWriteSpec, ParquetError> {
        let size = page.uncompressed_size();
        let mut page = page.compressed_page().clone();
        match &mut page {
            Page::DataPage { buf, .. } | Page::DictionaryPage { buf, .. } => {
                *buf = compress_to_vec(&buf[..], CompressionLevel::Fastest).into();
            }
            // Of a later form, which is not asked for.
            Page::DataPageV2 { .. } => return Err(ParquetError::General("a page of version 2".to_owned())),
        }
        self.0.write_page(CompressedPage::new(page, size))
    }

    fn close(&mut self) -> Result<(), ParquetError> {
        self.0.close()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use parquet::basic::CompressionCodec;
    use parquet::file::reader::{FileReader, SerializedFileReader};

    /// The crate's own reader finds the rows, the packing and the encoding; the numbers are read back where a file of trajectories is a recording.
    #[test]
    fn a_file_says_how_its_columns_are_packed() {
        let column = |name: &str, kind| ParquetColumn { name: name.to_owned(), kind };
        let columns =
            [column("angle.deg", ParquetColumnKind::Numbers), column("verdict", ParquetColumnKind::Words)];
        let mut file = ParquetFile::begin(Vec::new(), &columns).unwrap();
        let numbers: Vec<Option<f64>> =
            (0..70_000).map(|k| (k % 7 != 3).then(|| f64::from(k) * 0.5)).collect();
        let words: Vec<Option<&str>> = (0..70_000).map(|k| (k % 2 == 0).then_some("passes")).collect();
        for _ in 0..2 {
            file.rows([Cells::Numbers(numbers.clone()), Cells::Words(words.clone())]).unwrap();
        }
        let bytes = file.finish().unwrap();
        assert!(bytes.len() < 70_000 * 8, "{}", bytes.len());
        let read = SerializedFileReader::new(Bytes::from(bytes)).unwrap();
        assert_eq!(read.metadata().file_metadata().num_rows(), 140_000);
        for group in read.metadata().row_groups() {
            let angle = group.column(0);
            assert_eq!(angle.column_path().parts(), ["angle.deg"]);
            assert_eq!(angle.compression_codec(), CompressionCodec::ZSTD);
            assert!(angle.encodings().any(|one| one == Encoding::BYTE_STREAM_SPLIT));
        }
    }
}
