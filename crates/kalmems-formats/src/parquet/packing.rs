//! How the bytes of a page are packed.

use super::{FORMAT, PAGE_BYTES, damaged};
use crate::{FormatError, Result};
use flate2::read::MultiGzDecoder;
use parquet::basic::Compression;
use ruzstd::decoding::FrameDecoder;
use std::io::Read;

/// How the bytes of a page are packed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum PagePacking {
    Plain,
    Snappy,
    Gzip,
    /// One block; of older writers in frames of Hadoop.
    Lz4,
    Zstd,
}

impl PagePacking {
    /// What a column says.
    pub fn of(said: Compression) -> Result<Self> {
        let name = match said {
            Compression::UNCOMPRESSED => return Ok(Self::Plain),
            Compression::SNAPPY => return Ok(Self::Snappy),
            Compression::GZIP(_) => return Ok(Self::Gzip),
            Compression::LZ4 | Compression::LZ4_RAW => return Ok(Self::Lz4),
            Compression::ZSTD(_) => return Ok(Self::Zstd),
            Compression::BROTLI(_) => "Brotli",
            Compression::LZO => "LZO",
        };
        let remedy = "pack it by Snappy, gzip, LZ4 or Zstandard, or not at all";
        Err(FormatError::unsupported(FORMAT, format!("a column packed by {name}"), remedy))
    }

    /// Appends what is packed, `count` bytes, neither more nor less.
    pub fn unpack(self, packed: &[u8], count: usize, out: &mut Vec<u8>) -> Result<()> {
        let start = out.len();
        out.resize(start + count, 0);
        let room = &mut out[start..];
        let is_whole = match self {
            Self::Plain => packed.get(..count).is_some_and(|all| {
                room.copy_from_slice(all);
                packed.len() == count
            }),
            Self::Snappy => {
                snap::raw::decompress_len(packed).is_ok_and(|claimed| claimed == count)
                    && snap::raw::Decoder::new().decompress(packed, room).is_ok_and(|done| done == count)
            }
            Self::Gzip => {
                let mut stream = MultiGzDecoder::new(packed);
                stream.read_exact(room).is_ok() && stream.read(&mut [0]).is_ok_and(|more| more == 0)
            }
            Self::Lz4 => hadoop(packed, room).is_some() || block(packed, room).is_some(),
            Self::Zstd => {
                let mut decoder = FrameDecoder::new();
                decoder.set_max_window_size(PAGE_BYTES);
                let done = decoder.decode_all(packed, room).is_ok_and(|done| done == count);
                let sum = decoder.get_checksum_from_data();
                done && sum.is_none_or(|sum| decoder.get_calculated_checksum() == Some(sum))
            }
        };
        if is_whole {
            return Ok(());
        }
        let found = format!("{} bytes packed by {self:?} that do not unpack to {count}", packed.len());
        Err(damaged("a page", found))
    }
}

/// One block of LZ4 that fills the room.
fn block(packed: &[u8], room: &mut [u8]) -> Option<()> {
    let done = lz4_flex::block::decompress_into(packed, room).ok()?;
    (done == room.len()).then_some(())
}

/// Blocks of LZ4 behind their lengths unpacked and packed, which fill the room.
fn hadoop(mut packed: &[u8], mut room: &mut [u8]) -> Option<()> {
    while let Some((lengths, rest)) = packed.split_first_chunk::<8>() {
        let [a, b, c, d, e, f, g, h] = *lengths;
        let (unpacked_bytes, packed_bytes) =
            (u32::from_be_bytes([a, b, c, d]) as usize, u32::from_be_bytes([e, f, g, h]) as usize);
        let (this, others) = rest.split_at_checked(packed_bytes)?;
        let (here, behind) = std::mem::take(&mut room).split_at_mut_checked(unpacked_bytes)?;
        block(this, here)?;
        (packed, room) = (others, behind);
    }
    (packed.is_empty() && room.is_empty()).then_some(())
}

#[cfg(test)]
mod tests {
    use super::PagePacking;

    fn unpacked(packing: PagePacking, packed: &[u8], count: usize) -> Option<Vec<u8>> {
        let mut out = b"before".to_vec();
        packing.unpack(packed, count, &mut out).ok()?;
        assert!(out.starts_with(b"before"));
        Some(out.split_off(6))
    }

    #[test]
    fn blocks_of_hadoop_are_read_and_others() {
        let (first, second) =
            (b"aaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaab".as_slice(), b"cdcdcdcdcdcdcdcdcd".as_slice());
        let mut packed = Vec::new();
        for part in [first, second] {
            let block = lz4_flex::block::compress(part);
            packed.extend(u32::try_from(part.len()).unwrap().to_be_bytes());
            packed.extend(u32::try_from(block.len()).unwrap().to_be_bytes());
            packed.extend(block);
        }
        let both = [first, second].concat();
        assert_eq!(unpacked(PagePacking::Lz4, &packed, both.len()), Some(both.clone()));
        assert_eq!(
            unpacked(PagePacking::Lz4, &lz4_flex::block::compress(&both), both.len()),
            Some(both.clone())
        );
        for count in [0, 1, both.len() - 1, both.len() + 1] {
            assert_eq!(unpacked(PagePacking::Lz4, &packed, count), None);
        }
        assert_eq!(unpacked(PagePacking::Lz4, &packed[..packed.len() - 1], both.len()), None);
    }

    #[test]
    fn what_unpacks_to_another_length_is_refused() {
        let snappy = snap::raw::Encoder::new().compress_vec(&[7; 100]).unwrap();
        let mut gzip = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
        std::io::Write::write_all(&mut gzip, &[7; 100]).unwrap();
        let gzip = gzip.finish().unwrap();
        let lz4 = lz4_flex::block::compress(&[7; 100]);
        let zstd =
            ruzstd::encoding::compress_to_vec(&[7; 100][..], ruzstd::encoding::CompressionLevel::Fastest);
        for (packing, packed) in [
            (PagePacking::Plain, &[7; 100][..]),
            (PagePacking::Snappy, &snappy),
            (PagePacking::Gzip, &gzip),
            (PagePacking::Lz4, &lz4),
            (PagePacking::Zstd, &zstd),
        ] {
            assert_eq!(unpacked(packing, packed, 100), Some(vec![7; 100]), "{packing:?}");
            for count in [0, 99, 101, 1 << 20] {
                assert_eq!(unpacked(packing, packed, count), None, "{packing:?} {count}");
            }
            for end in 0..packed.len() {
                assert_eq!(unpacked(packing, &packed[..end], 100), None, "{packing:?} up to {end}");
            }
        }
    }

    /// A frame with a checksum, as the program `zstd` writes them, of bytes that cannot be packed.
    #[test]
    fn the_checksum_of_a_frame_of_zstandard_is_compared() {
        const FRAME: &[u8] = b"\
            \x28\xb5\x2f\xfd\x24\x30\x81\x01\x00\x00\x30\xaa\x6e\x7c\xd4\x76\x62\x98\x18\xe2\xf6\x54\xfc\xee\x2a\
            \xb0\x80\x9a\xfe\xac\xa4\xe6\x72\x48\x68\xd2\x86\x84\xcc\x5e\x3a\x60\xd0\x8a\x8e\xdc\x74\x56\x82\xf8\
            \xb8\xc2\x16\xb4\x9c\xce\x4a\x9f\x0d\xb3\xa5";
        let bytes: Vec<u8> =
            (0..48_u32).map(|k| u8::try_from((37 * k * k + 11 * k) % 256).unwrap()).collect();
        assert_eq!(unpacked(PagePacking::Zstd, FRAME, 48), Some(bytes.clone()));
        for (place, bit) in (0..FRAME.len()).flat_map(|place| (0..8).map(move |bit| (place, bit))) {
            let mut packed = FRAME.to_vec();
            packed[place] ^= 1 << bit;
            let found = unpacked(PagePacking::Zstd, &packed, 48);
            // Of the head of the frame some bits say nothing of its bytes.
            let may_be_read = place < 6 && found.as_ref() == Some(&bytes);
            assert!(found.is_none() || may_be_read, "bit {bit} of byte {place}");
        }
    }
}
