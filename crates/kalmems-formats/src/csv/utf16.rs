//! UTF-16 as UTF-8, piece by piece.

/// Reads UTF-16 whose bytes come in pieces of any length. Half a pair becomes the sign for
/// what is no character; what is left of one at the end is dropped with the line that it cuts.
#[derive(Debug)]
pub(super) struct Utf16 {
    big_endian: bool,
    /// The first byte of a unit, and the first unit of a pair.
    byte: Option<u8>,
    high: Option<u16>,
}

impl Utf16 {
    /// The encoding that the mark at the beginning of a text says.
    pub(super) fn of_mark(beginning: &[u8]) -> Option<Self> {
        let big_endian = match beginning.first_chunk::<2>()? {
            [0xff, 0xfe] => false,
            [0xfe, 0xff] => true,
            _ => return None,
        };
        Some(Self { big_endian, byte: None, high: None })
    }

    /// Appends what some bytes say; at most three bytes for two.
    pub(super) fn decode(&mut self, bytes: &[u8], out: &mut Vec<u8>) {
        for byte in bytes {
            let Some(first) = self.byte.take() else {
                self.byte = Some(*byte);
                continue;
            };
            let pair = [first, *byte];
            let unit = if self.big_endian { u16::from_be_bytes(pair) } else { u16::from_le_bytes(pair) };
            match (self.high.take(), unit) {
                (Some(high), 0xdc00..0xe000) => {
                    let pair = char::decode_utf16([high, unit]).next();
                    push(pair.and_then(Result::ok).unwrap_or(char::REPLACEMENT_CHARACTER), out);
                }
                (high, _) => {
                    // Half a pair alone.
                    if high.is_some() {
                        push(char::REPLACEMENT_CHARACTER, out);
                    }
                    match unit {
                        0xd800..0xdc00 => self.high = Some(unit),
                        _ => push(char::from_u32(unit.into()).unwrap_or(char::REPLACEMENT_CHARACTER), out),
                    }
                }
            }
        }
    }
}

fn push(character: char, out: &mut Vec<u8>) {
    out.extend_from_slice(character.encode_utf8(&mut [0; 4]).as_bytes());
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
