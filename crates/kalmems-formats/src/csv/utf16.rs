//! UTF-16 as UTF-8, piece by piece.

use crate::records::utf16;

/// Reads UTF-16 whose bytes come in pieces of any length. Half a pair becomes the sign for
/// what is no character; what is left of one at the end is dropped with the line that it cuts.
#[derive(Debug)]
pub(super) struct Utf16 {
    big_endian: bool,
    /// Bytes that wait for others: half of a unit, and the first unit of a pair.
    rest: Vec<u8>,
}

impl Utf16 {
    /// The encoding that the mark at the beginning of a text says.
    pub(super) fn of_mark(beginning: &[u8]) -> Option<Self> {
        let big_endian = match beginning.first_chunk::<2>()? {
            [0xff, 0xfe] => false,
            [0xfe, 0xff] => true,
            _ => return None,
        };
        Some(Self { big_endian, rest: Vec::new() })
    }

    /// Appends what some bytes say; at most three bytes for two, and for those that waited.
    pub(super) fn decode(&mut self, bytes: &[u8], out: &mut Vec<u8>) {
        self.rest.extend_from_slice(bytes);
        let units = self.rest.as_chunks::<2>().0;
        // The first unit of a pair waits for the second.
        let waits = units.last().is_some_and(|unit| unit[usize::from(!self.big_endian)] & 0xfc == 0xd8);
        let whole = 2 * (units.len() - usize::from(waits));
        out.extend_from_slice(utf16(&self.rest[..whole], self.big_endian).as_bytes());
        self.rest.drain(..whole);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_is_the_same_however_its_bytes_come() {
        let text = "time_s\tΔU µV 𝄞\r\n−1,5";
        for big_endian in [false, true] {
            let bytes = |unit: u16| if big_endian { unit.to_be_bytes() } else { unit.to_le_bytes() };
            let wide: Vec<u8> = std::iter::once(0xfeff).chain(text.encode_utf16()).flat_map(bytes).collect();
            for size in 1..8 {
                let mut decoder = Utf16::of_mark(&wide).unwrap();
                let mut found = Vec::new();
                wide[2..].chunks(size).for_each(|piece| decoder.decode(piece, &mut found));
                assert_eq!(String::from_utf8(found).unwrap(), text);
            }
        }
        assert!(Utf16::of_mark(b"ti").is_none() && Utf16::of_mark(b"\xff").is_none());
    }

    #[test]
    fn half_pairs_are_no_characters() {
        let mut decoder = Utf16::of_mark(b"\xfe\xff").unwrap();
        let mut found = Vec::new();
        decoder.decode(
            &[0xdc, 0x00, 0xd8, 0x00, 0x00, 0x61, 0xd8, 0x00, 0xd8, 0x00, 0xdc, 0x00, 0x00],
            &mut found,
        );
        assert_eq!(String::from_utf8(found).unwrap(), "\u{fffd}\u{fffd}a\u{fffd}\u{10000}");
    }
}
