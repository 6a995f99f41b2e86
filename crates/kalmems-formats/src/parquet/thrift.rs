//! A look over metadata (Apache Thrift, compact protocol) before the library reads them, and all that is read of the headers of
//! pages, which it never sees.
//!
//! The library believes lengths of lists before it has seen their elements, and passes over lists of flags without
//! reading a byte for each, so that a few bytes can keep it busy for hours. Here every element is seen to be there, and
//! every field of which anything is known to be of its type.

/// Structs within one another.
const DEPTH: usize = 24;
/// Elements of a list; more columns or groups of rows are not read.
const ELEMENTS: u64 = 65_536;

/// What a field holds.
#[derive(Clone, Copy, Debug)]
pub(super) enum ThriftKind {
    /// One bit, in the type of the field.
    Flag,
    /// A byte.
    Byte,
    /// A whole number of any size, in groups of seven bits.
    Number,
    /// Eight bytes.
    Double,
    /// Bytes or a text.
    Bytes,
    /// Elements of one kind.
    List(&'static Self),
    /// Fields in the order of their numbers, from 1 on; others may follow.
    Struct(&'static [Self]),
    /// Nothing is known of it.
    Unknown,
}

/// How long the struct is that the bytes begin with, if it is one of these fields, each of its type, with all that it claims
/// to hold. `each` hears the numbers with the places that lead to them, a flag as 0 or 1.
pub(super) fn length_of_struct(
    bytes: &[u8],
    fields: &'static [ThriftKind],
    each: &mut dyn FnMut(&[i64], i64),
) -> Option<usize> {
    let mut reader = ThriftReader { rest: bytes, place: Vec::new(), each };
    reader.fields(fields, DEPTH)?;
    Some(bytes.len() - reader.rest.len())
}

struct ThriftReader<'a> {
    rest: &'a [u8],
    place: Vec<i64>,
    each: &'a mut dyn FnMut(&[i64], i64),
}

impl ThriftReader<'_> {
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
    fn unsigned(&mut self) -> Option<u64> {
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

    /// The same with the sign in the last bit.
    fn signed(&mut self) -> Option<i64> {
        let number = self.unsigned()?;
        Some((number >> 1).cast_signed() ^ -(number & 1).cast_signed())
    }

    fn fields(&mut self, fields: &'static [ThriftKind], depth: usize) -> Option<()> {
        let mut last = 0_i64;
        loop {
            let head = self.byte()?;
            if head == 0 {
                return Some(());
            }
            let number =
                if head >> 4 == 0 { self.signed()? } else { last.checked_add(i64::from(head >> 4))? };
            last = i64::from(i16::try_from(number).ok()?);
            let known = usize::try_from(last - 1).ok().and_then(|place| fields.get(place)).copied();
            let kind = known.filter(|kind| !matches!(kind, ThriftKind::Unknown));
            self.place.push(last);
            match (head & 15, kind) {
                (flag @ (1 | 2), None | Some(ThriftKind::Flag)) => {
                    (self.each)(&self.place, i64::from(flag == 1));
                }
                (code, kind) => self.value(code, kind, depth)?,
            }
            self.place.pop();
        }
    }

    /// A value of the type that the file gives it, which must be that which is known of it.
    fn value(&mut self, code: u8, kind: Option<ThriftKind>, depth: usize) -> Option<()> {
        let depth = depth.checked_sub(1)?;
        match (code, kind) {
            (3, None | Some(ThriftKind::Byte)) => self.skip(1),
            (4..=6, None | Some(ThriftKind::Number)) => {
                let number = self.signed()?;
                (self.each)(&self.place, number);
                Some(())
            }
            (7, None | Some(ThriftKind::Double)) => self.skip(8),
            (8, None | Some(ThriftKind::Bytes)) => {
                let length = self.unsigned()?;
                self.skip(length)
            }
            (9 | 10, None | Some(ThriftKind::List(_))) => {
                let head = self.byte()?;
                let count = if head >> 4 == 15 { self.unsigned()? } else { u64::from(head >> 4) };
                if count > ELEMENTS {
                    return None;
                }
                let element = if let Some(ThriftKind::List(element)) = kind { Some(*element) } else { None };
                // Lists of flags are in no metadata that is read here; there is no such value.
                (0..count).try_for_each(|_| self.value(head & 15, element, depth))
            }
            (12, None) => self.fields(&[], depth),
            (12, Some(ThriftKind::Struct(fields))) => self.fields(fields, depth),
            // Maps are in no metadata of Parquet.
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::ThriftKind::{Bytes, Flag, List, Number, Struct};
    use super::{ThriftKind, length_of_struct};

    const FIELDS: &[ThriftKind] = &[Number, Bytes, List(&Struct(&[Number])), Flag];

    /// The numbers in a struct, or `None` where there is none.
    fn numbers(bytes: &[u8], fields: &'static [ThriftKind]) -> Option<Vec<(Vec<i64>, i64)>> {
        let mut found = Vec::new();
        let length =
            length_of_struct(bytes, fields, &mut |place, number| found.push((place.to_vec(), number)));
        length.map(|_| found)
    }

    #[test]
    fn what_is_there_is_passed_over() {
        // Field 1: the number 300; field 2: a text; field 3: a list of two structs; field 4: a flag.
        let bytes = [0x15, 0xd8, 0x04, 0x18, 2, b'a', b'b', 0x19, 0x2c, 0, 0x15, 2, 0, 0x11, 0, 99];
        let expected = vec![(vec![1], 300), (vec![3, 1], 1), (vec![4], 1)];
        assert_eq!(numbers(&bytes, FIELDS), Some(expected.clone()));
        // Nothing need be known of it.
        assert_eq!(numbers(&bytes, &[]), Some(expected));
        for end in 0..15 {
            assert_eq!(numbers(&bytes[..end], FIELDS), None, "{end}");
        }
    }

    #[test]
    fn claims_are_refused() {
        // Two thousand million flags, as many numbers, a text of as many bytes, structs without end.
        assert_eq!(numbers(&[0x19, 0xf1, 0xff, 0xff, 0xff, 0xff, 7, 0], &[]), None);
        assert_eq!(numbers(&[0x19, 0xf5, 0xff, 0xff, 0xff, 0xff, 7, 0], &[]), None);
        assert_eq!(numbers(&[0x19, 0x21, 0, 0, 0], &[]), None);
        assert_eq!(numbers(&[0x18, 0xff, 0xff, 0xff, 0xff, 7, 0], &[]), None);
        assert_eq!(numbers(&vec![0x1c; 1 << 16], &[]), None);
    }

    #[test]
    fn another_type_than_is_known_is_refused() {
        // A text, a list of numbers and a flag where a number, a list of structs and a text belong.
        for bytes in [&[0x18, 1, b'a', 0][..], &[0x39, 0x15, 2, 0], &[0x21, 0]] {
            assert!(numbers(bytes, &[]).is_some() && numbers(bytes, FIELDS).is_none(), "{bytes:?}");
        }
        // A number below zero in a field that is given by its own number.
        assert_eq!(numbers(&[0x05, 2, 3, 0], FIELDS), Some(vec![(vec![1], -2)]));
    }
}
