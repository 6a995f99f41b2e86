//! The first lines of a text.

use crate::csv::split::Split;

/// The first lines of a text, without their ends.
pub(super) struct TextHead<'a> {
    lines: Vec<&'a [u8]>,
    /// Where each begins.
    starts: Vec<usize>,
    /// The number of the first.
    first_line: u64,
}

impl<'a> TextHead<'a> {
    pub(super) fn new(text: &'a [u8], first_line: u64, most: usize) -> Self {
        let mut head = Self { lines: Vec::new(), starts: vec![0], first_line };
        let mut start = 0;
        for end in memchr::memchr_iter(b'\n', text).take(most) {
            let line = text.get(start..end).unwrap_or_default();
            head.lines.push(line.strip_suffix(b"\r").unwrap_or(line));
            start = end + 1;
            head.starts.push(start);
        }
        head
    }

    /// How many lines there are.
    pub(super) fn len(&self) -> usize {
        self.lines.len()
    }

    /// A line; empty behind the last.
    pub(super) fn line(&self, index: usize) -> &'a [u8] {
        self.lines.get(index).copied().unwrap_or_default()
    }

    /// Its number in the file.
    pub(super) fn number(&self, index: usize) -> u64 {
        self.first_line + index as u64
    }

    /// How many bytes are before it.
    pub(super) fn bytes_before(&self, index: usize) -> usize {
        self.starts.get(index).or(self.starts.last()).copied().unwrap_or(0)
    }

    /// The cells of a line.
    pub(super) fn cells(&self, index: usize, separator: u8) -> Vec<String> {
        cells(self.line(index), separator)
    }

    /// The first line from one on with something in it.
    pub(super) fn filled(&self, from: usize) -> usize {
        (from..self.len()).find(|index| !self.line(*index).trim_ascii().is_empty()).unwrap_or(self.len())
    }

    /// The lines from one on that have something in them.
    pub(super) fn rows(&self, from: usize) -> impl Iterator<Item = usize> {
        (from..self.len()).filter(|index| !self.line(*index).trim_ascii().is_empty())
    }

    /// The first line whose first cell is this.
    pub(super) fn find(&self, first_cell: &str, separator: u8) -> Option<usize> {
        (0..self.len())
            .find(|index| self.cells(*index, separator).first().is_some_and(|cell| cell == first_cell))
    }

    /// What follows a key in a line of its own, such as `Sample Interval,4e-09`.
    pub(super) fn values(&self, key: &str, separator: u8) -> Option<Vec<String>> {
        let mut cells = self.cells(self.find(key, separator)?, separator);
        cells.remove(0);
        Some(cells)
    }
}

/// The cells of a line as text.
pub(super) fn cells(line: &[u8], separator: u8) -> Vec<String> {
    let mut split = Split::default();
    split.row(line, separator, true);
    split.iter().map(text).collect()
}

/// Text in UTF-8, or else in Latin-1, in which instruments write µ and °.
pub(super) fn text(bytes: &[u8]) -> String {
    match std::str::from_utf8(bytes) {
        Ok(text) => text.trim().to_owned(),
        Err(_) => bytes.iter().map(|byte| char::from(*byte)).collect::<String>().trim().to_owned(),
    }
}
