//! A look over metadata (Apache Thrift, compact protocol) before the library reads it.
//!
//! The library believes lengths of lists before it has seen their elements, and passes over lists of flags without
//! reading a byte for each, so that a few bytes can keep it busy for hours. Here every element is seen to be there.

/// Structs within one another.
const DEPTH: usize = 24;
/// Elements of a list; more columns or groups of rows are not read.
const ELEMENTS: u64 = 65_536;

/// The length of the struct that the bytes begin with, or `None` where they are none, are cut, or claim too much.
pub(super) fn struct_length(bytes: &[u8]) -> Option<usize> {
    let mut reader = Reader { rest: bytes };
    reader.fields(DEPTH)?;
    Some(bytes.len() - reader.rest.len())
}

struct Reader<'a> {
    rest: &'a [u8],
}

impl Reader<'_> {
    fn byte(&mut self) -> Option<u8> {
        let (first, rest) = self.rest.split_first()?;
        self.rest = rest;
        Some(*first)
    }

    fn skip(&mut self, count: u64) -> Option<()> {
        self.rest = self.rest.get(usize::try_from(count).ok()?..)?;
        Some(())
    }

    /// A number in groups of seven bits.
    fn number(&mut self) -> Option<u64> {
        let mut number = 0;
        for shift in (0..70).step_by(7) {
            let byte = self.byte()?;
            number |= u64::from(byte & 0x7f).checked_shl(shift)?;
            if byte & 0x80 == 0 {
                return Some(number);
            }
        }
        None
    }

    fn fields(&mut self, depth: usize) -> Option<()> {
        loop {
            let head = self.byte()?;
            if head == 0 {
                return Some(());
            }
            if head >> 4 == 0 {
                self.number()?;
            }
            match head & 15 {
                // A flag is in its type.
                1 | 2 => {}
                kind => self.value(kind, depth)?,
            }
        }
    }

    fn value(&mut self, kind: u8, depth: usize) -> Option<()> {
        let depth = depth.checked_sub(1)?;
        match kind {
            3 => self.skip(1),
            4..=6 => self.number().map(|_| ()),
            7 => self.skip(8),
            8 => {
                let length = self.number()?;
                self.skip(length)
            }
            9 | 10 => {
                let head = self.byte()?;
                let count = if head >> 4 == 15 { self.number()? } else { u64::from(head >> 4) };
                if count > ELEMENTS {
                    return None;
                }
                // Lists of flags are in no metadata that is read here; `value` knows none.
                (0..count).try_for_each(|_| self.value(head & 15, depth))
            }
            12 => self.fields(depth),
            // Maps are in no metadata of Parquet.
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::struct_length;

    #[test]
    fn what_is_there_is_passed_over() {
        // Field 1: the number 300; field 2: a text; field 3: a list of two structs; field 4: a flag.
        let bytes = [0x15, 0xd8, 0x04, 0x18, 2, b'a', b'b', 0x19, 0x2c, 0, 0x15, 2, 0, 0x11, 0, 99];
        assert_eq!(struct_length(&bytes), Some(15));
        for end in 0..15 {
            assert_eq!(struct_length(&bytes[..end]), None, "{end}");
        }
    }

    #[test]
    fn claims_are_refused() {
        // Two thousand million flags, as many numbers, a text of as many bytes, structs without end.
        assert_eq!(struct_length(&[0x19, 0xf1, 0xff, 0xff, 0xff, 0xff, 7, 0]), None);
        assert_eq!(struct_length(&[0x19, 0xf5, 0xff, 0xff, 0xff, 0xff, 7, 0]), None);
        assert_eq!(struct_length(&[0x19, 0x21, 0, 0, 0]), None);
        assert_eq!(struct_length(&[0x18, 0xff, 0xff, 0xff, 0xff, 7, 0]), None);
        assert_eq!(struct_length(&vec![0x1c; 1 << 16]), None);
    }
}
