//! A row taken apart into its cells, quotes and all: the slow way, for what the quick one does not read.

/// In place of a separator: cells with blanks and tabs between them, as many as there may be.
pub(super) const BLANKS: u8 = b' ';

/// The cells of a row.
#[derive(Default)]
pub(super) struct Split {
    /// The bytes of all cells, without quotes.
    bytes: Vec<u8>,
    /// Where each cell ends.
    ends: Vec<usize>,
}

/// How much of a text a row takes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct RowExtent {
    /// Bytes, its line end included.
    pub(super) bytes: usize,
    /// Line ends inside quotes.
    pub(super) inside: u64,
}

impl Split {
    /// Takes the row apart that `text` begins with, which holds the end of a line. `None` where a quote is open at the end of
    /// the text and `last` does not say that no more comes.
    ///
    /// A quote opens a quoted stretch at the beginning of a cell alone; twice inside, it is a quote.
    pub(super) fn row(&mut self, text: &[u8], separator: u8, last: bool) -> Option<RowExtent> {
        self.bytes.clear();
        self.ends.clear();
        if separator == BLANKS {
            return self.row_of_blanks(text, last);
        }
        let mut place = 0;
        let mut inside = 0;
        loop {
            if text.get(place) == Some(&b'"') {
                place = self.quoted(text, place + 1, &mut inside, last)?;
            }
            let rest = text.get(place..).unwrap_or_default();
            let length = memchr::memchr2(separator, b'\n', rest);
            self.bytes.extend_from_slice(rest.get(..length.unwrap_or(rest.len())).unwrap_or_default());
            self.ends.push(self.bytes.len());
            let Some(length) = length else { return Some(RowExtent { bytes: text.len(), inside }) };
            place += length + 1;
            if rest.get(length) == Some(&b'\n') {
                return Some(RowExtent { bytes: place, inside });
            }
        }
    }

    /// The same with blanks between the cells; those at the beginning and the end of a line mean nothing.
    fn row_of_blanks(&mut self, text: &[u8], last: bool) -> Option<RowExtent> {
        let is_blank = |byte: &u8| matches!(byte, b' ' | b'\t' | b'\r');
        let mut place = 0;
        let mut inside = 0;
        loop {
            place += text.get(place..).unwrap_or_default().iter().take_while(|byte| is_blank(byte)).count();
            match text.get(place) {
                None | Some(b'\n') => {
                    if self.ends.is_empty() {
                        self.ends.push(0);
                    }
                    return Some(RowExtent { bytes: text.len().min(place + 1), inside });
                }
                Some(b'"') => place = self.quoted(text, place + 1, &mut inside, last)?,
                Some(_) => {}
            }
            let rest = text.get(place..).unwrap_or_default();
            let length = rest.iter().position(|byte| is_blank(byte) || *byte == b'\n').unwrap_or(rest.len());
            self.bytes.extend_from_slice(rest.get(..length).unwrap_or_default());
            self.ends.push(self.bytes.len());
            place += length;
        }
    }

    /// Copies what is quoted from `place` on; the place behind the closing quote.
    fn quoted(&mut self, text: &[u8], mut place: usize, inside: &mut u64, last: bool) -> Option<usize> {
        loop {
            let rest = text.get(place..).unwrap_or_default();
            let length = match memchr::memchr(b'"', rest) {
                Some(length) => length,
                None if last => rest.len(),
                None => return None,
            };
            let stretch = rest.get(..length).unwrap_or_default();
            *inside += memchr::memchr_iter(b'\n', stretch).count() as u64;
            self.bytes.extend_from_slice(stretch);
            place += length + 1;
            if text.get(place) != Some(&b'"') {
                return Some(place.min(text.len()));
            }
            self.bytes.push(b'"');
            place += 1;
        }
    }

    /// How many cells there are.
    pub(super) fn len(&self) -> usize {
        self.ends.len()
    }

    /// A cell, without spaces around it; empty where there is none.
    pub(super) fn cell(&self, index: usize) -> &[u8] {
        let start = index.checked_sub(1).and_then(|before| self.ends.get(before)).copied().unwrap_or(0);
        let end = self.ends.get(index).copied().unwrap_or(start);
        self.bytes.get(start..end).unwrap_or_default().trim_ascii()
    }

    /// Whether the row is a line with nothing in it.
    pub(super) fn is_blank(&self) -> bool {
        self.len() == 1 && self.cell(0).is_empty()
    }

    /// All cells.
    pub(super) fn iter(&self) -> impl Iterator<Item = &[u8]> {
        (0..self.len()).map(|index| self.cell(index))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn split(text: &str) -> Option<(Vec<String>, RowExtent)> {
        let mut split = Split::default();
        let extent = split.row(text.as_bytes(), b',', false)?;
        Some((split.iter().map(|cell| String::from_utf8_lossy(cell).into_owned()).collect(), extent))
    }

    #[test]
    fn rows_with_and_without_quotes() {
        for (text, cells, bytes, inside) in [
            ("a,b\nc", &["a", "b"][..], 4, 0),
            (" a , \r\n", &["a", ""], 7, 0),
            ("\n", &[""], 1, 0),
            ("\"a,b\",c\n", &["a,b", "c"], 8, 0),
            ("\"a\"\"b\"\n", &["a\"b"], 7, 0),
            ("\"a\nb\n\",c\n", &["a\nb", "c"], 9, 2),
            ("\"a\"b,c\n", &["ab", "c"], 7, 0),
            ("a\"b,c\n", &["a\"b", "c"], 6, 0),
            ("\"\"\n", &[""], 3, 0),
        ] {
            let cells = cells.iter().map(|&cell| cell.to_owned()).collect();
            assert_eq!(split(text), Some((cells, RowExtent { bytes, inside })), "{text:?}");
        }
    }

    #[test]
    fn rows_with_blanks_between_the_cells() {
        for (text, cells, bytes) in [
            ("  1.5 \t 2\r\nx", &["1.5", "2"][..], 11),
            ("a b", &["a", "b"], 3),
            ("\t\n", &[""], 2),
            ("\"time s\" \"b\"\n", &["time s", "b"], 13),
        ] {
            let mut split = Split::default();
            let extent = split.row(text.as_bytes(), BLANKS, false).unwrap();
            let found: Vec<_> = split.iter().map(|cell| std::str::from_utf8(cell).unwrap()).collect();
            assert_eq!((found.as_slice(), extent), (cells, RowExtent { bytes, inside: 0 }), "{text:?}");
        }
        assert_eq!(Split::default().row(b"a \"b\n", BLANKS, false), None);
    }

    #[test]
    fn an_open_quote_waits_for_its_end() {
        assert_eq!(split("\"a\nb,c\n"), None);
        let mut split = Split::default();
        assert_eq!(split.row(b"x,\"a\nb\n", b',', true), Some(RowExtent { bytes: 7, inside: 2 }));
        assert_eq!((split.len(), split.cell(1)), (2, &b"a\nb"[..]));
    }
}
