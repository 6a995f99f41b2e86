//! The pages of a column in a group of rows, one after the other and unpacked.

use super::packing::PagePacking;
use super::{FORMAT, damaged, layout, thrift};
use crate::limits;
use crate::source::SharedFile;
use crate::{Result, refuse_if};
use bytes::Bytes;
use flate2::Crc;
use parquet::basic::Encoding;
use parquet::column::page::{Page, PageMetadata, PageReader};
use parquet::errors::ParquetError;
use parquet::file::metadata::ColumnChunkMetaData;
use std::ops::Range;
use std::sync::Arc;

/// Bytes that a page may unpack to. Writers make pages of one.
pub(super) const PAGE_BYTES: u64 = 16 << 20;
/// Values of a dictionary. Writers stop at a megabyte.
const DICTIONARY: u64 = 1 << 20;
/// Bytes of the header of a page, and of one with long texts in its statistics.
const HEADER: usize = 1024;
const LONG_HEADER: usize = 1 << 20;

/// Where the pages of a column are; `None` where that is no place.
pub(super) fn place(chunk: &ColumnChunkMetaData) -> Option<Range<u64>> {
    let data = chunk.data_page_offset();
    let start = u64::try_from(chunk.dictionary_page_offset().map_or(data, |start| start.min(data))).ok()?;
    let length = u64::try_from(chunk.compressed_size()).ok()?;
    Some(start..start.checked_add(length)?)
}

/// Which checksum the pages of a column have, as far as the first of them shows it.
pub(super) fn protection(source: &Arc<SharedFile>, chunk: &ColumnChunkMetaData) -> Option<&'static str> {
    let pages = ColumnPages::of(source, chunk).ok()?;
    let has_sum =
        pages.packing == PagePacking::Gzip || pages.header().is_ok_and(|header| header.sum.is_some());
    has_sum.then_some("CRC-32")
}

/// The pages of a column in a group of rows.
pub(super) struct ColumnPages {
    source: Arc<SharedFile>,
    packing: PagePacking,
    /// Those that are left.
    left: Range<u64>,
}

impl ColumnPages {
    pub fn of(source: &Arc<SharedFile>, chunk: &ColumnChunkMetaData) -> Result<Self> {
        let left = place(chunk).unwrap_or_default();
        Ok(Self { source: Arc::clone(source), packing: PagePacking::of(chunk.compression())?, left })
    }

    /// The next page that is read, and no index.
    fn following(&mut self) -> Result<Option<Page>> {
        while !self.left.is_empty() {
            let start = self.left.start;
            let header = self.header()?;
            self.left.start += header.bytes;
            refuse_if(header.packed > self.left.end.saturating_sub(self.left.start), || {
                damaged(&format!("byte {start}"), "a page longer than its column".to_owned())
            })?;
            let body = self.left.start;
            self.left.start += header.packed;
            let read = || header.checked(self.source.bytes(FORMAT, body, header.packed)?, start);
            if let Some(page) = header.page(read, self.packing, start)? {
                return Ok(Some(page));
            }
        }
        Ok(None)
    }

    fn header(&self) -> Result<ClaimedPageHeader> {
        let start = self.left.start;
        let left = usize::try_from(self.left.end - start).unwrap_or(usize::MAX);
        for most in [HEADER, LONG_HEADER] {
            let mut head = vec![0; most.min(left)];
            let count = self.source.read_some(start, &mut head)?;
            if let Some(header) = ClaimedPageHeader::of(&head[..count]) {
                header.refuse_too_large(start)?;
                return Ok(header);
            }
            if count < most {
                break;
            }
        }
        Err(damaged(&format!("byte {start}"), "no header of a page".to_owned()))
    }
}

impl Iterator for ColumnPages {
    type Item = Result<Page, ParquetError>;

    fn next(&mut self) -> Option<Self::Item> {
        self.get_next_page().transpose()
    }
}

impl PageReader for ColumnPages {
    fn get_next_page(&mut self) -> Result<Option<Page>, ParquetError> {
        self.following().map_err(|error| ParquetError::External(Box::new(error)))
    }

    // Asked for where rows are passed over, which is never done here.
    fn peek_next_page(&mut self) -> Result<Option<PageMetadata>, ParquetError> {
        Err(ParquetError::NYI("pages are read one after the other".to_owned()))
    }

    fn skip_next_page(&mut self) -> Result<(), ParquetError> {
        self.get_next_page().map(drop)
    }
}

/// What the header of a page claims.
#[derive(Debug, Default, PartialEq)]
struct ClaimedPageHeader {
    /// Its own length.
    bytes: u64,
    kind: i64,
    unpacked: u64,
    packed: u64,
    /// The checksum of its bytes as they are packed, where there is one.
    sum: Option<u32>,
    values: u64,
    encoding: i64,
    /// Of a page of the first kind the encodings of its levels, definition and repetition.
    levels: [i64; 2],
    /// Of a page of the second kind values that are missing, rows, and the bytes of both levels, which are not packed.
    missing: u64,
    rows: u64,
    level_bytes: [u64; 2],
    is_plain: bool,
}

impl ClaimedPageHeader {
    /// That of bytes that begin with one; `None` where they do not, or where it counts something below zero.
    fn of(head: &[u8]) -> Option<Self> {
        let (mut header, mut sound) = (Self::default(), true);
        let length = thrift::length_of_struct(head, layout::PAGE, &mut |place, number| {
            let mut count = |field: &mut u64| match u64::try_from(number) {
                Ok(number) => *field = number,
                Err(_) => sound = false,
            };
            match place {
                [1] => header.kind = number,
                [2] => count(&mut header.unpacked),
                [3] => count(&mut header.packed),
                [4] => match i32::try_from(number) {
                    Ok(sum) => header.sum = Some(sum.cast_unsigned()),
                    Err(_) => sound = false,
                },
                [5 | 7 | 8, 1] => count(&mut header.values),
                [5 | 7, 2] | [8, 4] => header.encoding = number,
                [5, 3] => header.levels[0] = number,
                [5, 4] => header.levels[1] = number,
                [8, 2] => count(&mut header.missing),
                [8, 3] => count(&mut header.rows),
                [8, 5] => count(&mut header.level_bytes[0]),
                [8, 6] => count(&mut header.level_bytes[1]),
                [8, 7] => header.is_plain = number == 0,
                _ => {}
            }
        })?;
        header.bytes = length as u64;
        sound.then_some(header)
    }

    fn refuse_too_large(&self, start: u64) -> Result<()> {
        let bytes = self.unpacked.max(self.packed);
        limits::at_most(FORMAT, &format!("the bytes of the page at byte {start}"), bytes, PAGE_BYTES)?;
        if self.kind == 2 {
            let what = format!("the values of the dictionary at byte {start}");
            limits::at_most(FORMAT, &what, self.values, DICTIONARY)?;
        }
        Ok(())
    }

    /// The bytes of the page, compared with their checksum.
    fn checked(&self, bytes: Vec<u8>, start: u64) -> Result<Vec<u8>> {
        let Some(expected) = self.sum else { return Ok(bytes) };
        let mut crc = Crc::new();
        crc.update(&bytes);
        if crc.sum() == expected {
            return Ok(bytes);
        }
        let found = format!("a checksum of {:08x} over its bytes, and {expected:08x} stored", crc.sum());
        Err(damaged(&format!("the page at byte {start}"), found))
    }

    /// The page with what `read` gives; `None` of an index, which is not read.
    fn page(
        &self,
        read: impl Fn() -> Result<Vec<u8>>,
        packing: PagePacking,
        start: u64,
    ) -> Result<Option<Page>> {
        let wrong = |what: &str| damaged(&format!("the page at byte {start}"), what.to_owned());
        let small =
            |number: u64| u32::try_from(number).map_err(|_| wrong("more than 4294967295 of something"));
        let encoded = |number: i64| {
            let known = Encoding::VARIANTS.iter().find(|known| i64::from(**known as i32) == number);
            known.copied().ok_or_else(|| wrong("an encoding that there is not"))
        };
        let [definition, repetition] = self.level_bytes;
        // Only those of the second kind are not packed.
        let levels = definition.saturating_add(repetition);
        refuse_if(levels > self.unpacked.min(self.packed), || wrong("levels longer than the page"))?;
        #[allow(clippy::cast_possible_truncation)] // 16 MiB at most, and no longer than the page
        let (unpacked, levels) = (self.unpacked as usize, levels as usize);
        let whole = || -> Result<Bytes> {
            let packed = read()?;
            if packing == PagePacking::Plain || self.is_plain {
                return Ok(packed.into());
            }
            let mut out = packed[..levels].to_vec();
            // A page without a value may be packed to anything.
            if unpacked > levels {
                packing.unpack(&packed[levels..], unpacked - levels, &mut out)?;
            }
            Ok(out.into())
        };
        let (num_values, encoding) = (small(self.values)?, || encoded(self.encoding));
        Ok(Some(match self.kind {
            0 => Page::DataPage {
                num_values,
                encoding: encoding()?,
                def_level_encoding: encoded(self.levels[0])?,
                rep_level_encoding: encoded(self.levels[1])?,
                statistics: None,
                buf: whole()?,
            },
            1 => return Ok(None),
            2 => Page::DictionaryPage { num_values, encoding: encoding()?, is_sorted: false, buf: whole()? },
            3 => Page::DataPageV2 {
                buf: whole()?,
                num_values,
                encoding: encoding()?,
                num_nulls: small(self.missing)?,
                num_rows: small(self.rows)?,
                def_levels_byte_len: small(definition)?,
                rep_levels_byte_len: small(repetition)?,
                is_compressed: false,
                statistics: None,
            },
            _ => return Err(wrong("a page of a kind that there is not")),
        }))
    }
}

#[cfg(test)]
mod tests {
    use super::ClaimedPageHeader;

    #[test]
    fn a_dictionary_that_claims_too_much_is_refused() {
        // A dictionary page of 300 bytes in 200 with 1 048 576 values, and with one more.
        let header = |values: [u8; 4]| {
            let mut header = vec![0x15, 4, 0x15, 0xd8, 4, 0x15, 0x90, 3, 0x4c, 0x15];
            header.extend(values);
            header.extend([0x15, 0, 0, 0]);
            ClaimedPageHeader::of(&header).unwrap()
        };
        let page = header([0x80, 0x80, 0x80, 1]);
        assert_eq!((page.unpacked, page.packed, page.values, page.bytes), (300, 200, 1 << 20, 18));
        assert!(page.refuse_too_large(0).is_ok());
        let said = header([0x82, 0x80, 0x80, 1]).refuse_too_large(7).unwrap_err().to_string();
        assert!(said.contains("the values of the dictionary at byte 7"), "{said}");
        // Below zero.
        assert!(ClaimedPageHeader::of(&[0x15, 4, 0x15, 1, 0x15, 2, 0]).is_none());
    }
}
