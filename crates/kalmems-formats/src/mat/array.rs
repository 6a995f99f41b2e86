//! The arrays of a MAT file (MathWorks, MAT-File Format, version 5), as far as their headers.

use crate::element::{Element, ElementKind};
use crate::records::utf16;
use crate::stream::StretchReader;
use crate::{Result, limits, refuse_if};

pub(super) const FORMAT: &str = "MAT 5";
/// An array.
pub(super) const MATRIX: u32 = 14;
/// An array that is packed.
pub(super) const COMPRESSED: u32 = 15;
/// Structs within one another.
const DEPTH: usize = 8;

/// An array's name and what it holds.
pub(super) struct MatVariable {
    pub(super) name: String,
    pub(super) value: MatValue,
}

/// What an array holds.
pub(super) enum MatValue {
    /// Numbers, column after column, from a place of the stream on.
    Numbers { place: u64, element: Element, rows: u64, columns: u64 },
    /// Texts, one a row.
    Texts(Vec<Vec<u8>>),
    /// A struct's fields.
    Fields(Vec<MatVariable>),
    /// An object of a class, whose parts are not documented: a table, a string.
    Object(String),
    /// Anything else.
    Other(&'static str),
}

/// The elements of a stream, one after the other.
pub(super) struct Elements {
    pub(super) stream: StretchReader,
    pub(super) big_endian: bool,
}

/// What stands before an element's bytes.
struct Tag {
    kind: u32,
    bytes: u64,
    /// The bytes, where they are in the tag.
    within: Option<[u8; 4]>,
}

/// What bounds the memory that texts and names take, over the whole file.
pub(super) struct MemoryBudget {
    pub(super) text_bytes: u64,
    pub(super) arrays: u64,
}

impl MemoryBudget {
    fn take(&mut self, bytes: u64) -> Result<()> {
        limits::at_most(FORMAT, "the length of texts", bytes, self.text_bytes)?;
        self.text_bytes -= bytes;
        Ok(())
    }
}

impl Elements {
    /// Numbers of 32 bits.
    fn words(&self, bytes: &[u8]) -> Vec<u32> {
        let word =
            |b: &[u8; 4]| if self.big_endian { u32::from_be_bytes(*b) } else { u32::from_le_bytes(*b) };
        bytes.as_chunks().0.iter().map(word).collect()
    }

    fn tag(&mut self) -> Result<Tag> {
        let raw = self.stream.next_bytes(8)?;
        let words = self.words(&raw);
        let (word, second) = (words[0], words[1]);
        if word >> 16 == 0 {
            return Ok(Tag { kind: word, bytes: u64::from(second), within: None });
        }
        let bytes = u64::from(word >> 16);
        refuse_if(bytes > 4, || {
            self.stream.damaged(format!("a small element of {bytes} bytes"), "at most 4")
        })?;
        Ok(Tag { kind: word & 0xffff, bytes, within: Some([raw[4], raw[5], raw[6], raw[7]]) })
    }

    /// A short element's kind and bytes.
    fn short(&mut self, what: &str, limit: usize) -> Result<(u32, Vec<u8>)> {
        let tag = self.tag()?;
        limits::at_most(FORMAT, &format!("the length of {what}"), tag.bytes, limit)?;
        #[allow(clippy::cast_possible_truncation)] // bounded by the line above
        let count = tag.bytes as usize;
        if let Some(within) = tag.within {
            return Ok((tag.kind, within[..count].to_vec()));
        }
        let bytes = self.stream.next_bytes(count)?;
        self.stream.skip(padding(tag.bytes))?;
        Ok((tag.kind, bytes))
    }

    /// Reads the headers of an array, and passes over what it holds.
    pub(super) fn array(&mut self, budget: &mut MemoryBudget) -> Result<MatVariable> {
        self.nested(budget, DEPTH)
    }

    fn nested(&mut self, budget: &mut MemoryBudget, depth: usize) -> Result<MatVariable> {
        let tag = self.tag()?;
        refuse_if(tag.kind != MATRIX || tag.within.is_some(), || {
            self.stream.damaged(format!("an element of type {}", tag.kind), "an array (14)")
        })?;
        if depth == DEPTH {
            limits::plausible_unpacked(FORMAT, "a variable", tag.bytes, self.stream.packed())?;
        }
        let end = self.stream.position() + tag.bytes;
        if tag.bytes == 0 {
            return Ok(MatVariable { name: String::new(), value: MatValue::Other("empty") });
        }
        limits::at_most(FORMAT, "the number of arrays", 1, budget.arrays)?;
        budget.arrays -= 1;
        let variable = self.body(budget, depth)?;
        match end.checked_sub(self.stream.position()) {
            // What a variable holds is unpacked when it is read.
            Some(_) if depth == DEPTH => {}
            Some(rest) => self.stream.skip(rest)?,
            None => {
                return Err(self
                    .stream
                    .damaged("parts beyond the end of their array", "parts that end in it"));
            }
        }
        Ok(variable)
    }

    fn body(&mut self, budget: &mut MemoryBudget, depth: usize) -> Result<MatVariable> {
        let (_, flags) = self.short("an array's flags", 16)?;
        let [word, _, ..] = self.words(&flags)[..] else {
            return Err(self.stream.damaged(format!("flags of {} bytes", flags.len()), "8"));
        };
        let (class, complex) = (word & 0xff, word & 0x800 != 0);
        if class == 17 {
            // Its name, the kind of objects that it is one of, and its class.
            let mut words = [const { String::new() }; 3];
            for word in &mut words {
                let (_, letters) = self.short("the name of an object", limits::TEXT_BYTES)?;
                *word = String::from_utf8_lossy(&letters).into_owned();
            }
            let [name, _, class] = words;
            return Ok(MatVariable { name, value: MatValue::Object(class) });
        }
        let (_, dimensions) = self.short("an array's dimensions", 8 * 32)?;
        let lengths: Vec<u64> = self.words(&dimensions).into_iter().map(u64::from).collect();
        let (_, name) = self.short("an array's name", limits::TEXT_BYTES)?;
        let name = String::from_utf8_lossy(&name).into_owned();
        let other = |what| MatValue::Other(what);
        let [rows, columns] = lengths[..] else {
            return Ok(MatVariable { name, value: other("more than two axes") });
        };
        // Both are of 32 bits.
        let count = rows * columns;
        let value = match class {
            _ if complex => other("complex numbers"),
            1 => self.cells(budget, count, depth)?,
            2 if count == 1 && depth > 0 => MatValue::Fields(self.fields(budget, depth)?),
            2 => other("an array of structs, or one within many others"),
            4 => self.characters(budget, rows, columns)?,
            6..=15 => self.numbers(rows, columns, count, depth)?,
            3 => other("an object"),
            5 => other("a sparse matrix"),
            16 => other("a function"),
            _ => return Err(self.stream.damaged(format!("an array of class {class}"), "1 to 17")),
        };
        Ok(MatVariable { name, value })
    }

    fn numbers(&mut self, rows: u64, columns: u64, count: u64, depth: usize) -> Result<MatValue> {
        let tag = self.tag()?;
        let (kind, bytes) = match tag.kind {
            1 => (ElementKind::Signed, 1),
            2 => (ElementKind::Unsigned, 1),
            3 => (ElementKind::Signed, 2),
            4 => (ElementKind::Unsigned, 2),
            5 => (ElementKind::Signed, 4),
            6 => (ElementKind::Unsigned, 4),
            7 => (ElementKind::Float, 4),
            9 => (ElementKind::Float, 8),
            12 => (ElementKind::Signed, 8),
            13 => (ElementKind::Unsigned, 8),
            kind => {
                return Err(self.stream.damaged(format!("numbers of type {kind}"), "1 to 7, 9, 12 or 13"));
            }
        };
        let element = Element { kind, bytes, big_endian: self.big_endian };
        refuse_if(count.checked_mul(bytes as u64) != Some(tag.bytes), || {
            let expected = format!("{bytes} for each of {rows} × {columns}");
            self.stream.damaged(format!("{} bytes of numbers", tag.bytes), expected)
        })?;
        // A single number may be within the tag.
        let place = if tag.within.is_some() { self.stream.position() - 4 } else { self.stream.position() };
        if tag.within.is_none() && depth < DEPTH {
            self.stream.skip(tag.bytes)?;
        }
        Ok(MatValue::Numbers { place, element, rows, columns })
    }

    fn fields(&mut self, budget: &mut MemoryBudget, depth: usize) -> Result<Vec<MatVariable>> {
        let (_, length) = self.short("a length", 4)?;
        let length = self.words(&length).first().map_or(0, |length| *length as usize);
        let (_, names) = self.short("the names of fields", limits::TEXT_BYTES * 256)?;
        refuse_if(length == 0 || length > limits::TEXT_BYTES || names.len() % length != 0, || {
            self.stream
                .damaged(format!("names of {length} bytes in {}", names.len()), "names of one length above 0")
        })?;
        budget.take(names.len() as u64)?;
        let mut fields = Vec::new();
        for name in names.chunks_exact(length) {
            let mut field = self.nested(budget, depth - 1)?;
            let end = name.iter().position(|byte| *byte == 0).unwrap_or(length);
            field.name = String::from_utf8_lossy(&name[..end]).into_owned();
            fields.push(field);
        }
        Ok(fields)
    }

    /// Cells that are texts.
    fn cells(&mut self, budget: &mut MemoryBudget, count: u64, depth: usize) -> Result<MatValue> {
        if depth == 0 || count > budget.arrays {
            return Ok(MatValue::Other("many cells"));
        }
        let mut texts = Vec::new();
        for _ in 0..count {
            match self.nested(budget, 0)?.value {
                MatValue::Texts(mut rows) if rows.len() <= 1 => texts.push(rows.pop().unwrap_or_default()),
                MatValue::Other("empty") => texts.push(Vec::new()),
                _ => return Ok(MatValue::Other("cells that are no texts")),
            }
        }
        Ok(MatValue::Texts(texts))
    }

    /// A matrix of characters, column after column: a text a row.
    fn characters(&mut self, budget: &mut MemoryBudget, rows: u64, columns: u64) -> Result<MatValue> {
        let (kind, bytes) = self.short("texts", usize::try_from(budget.text_bytes).unwrap_or(usize::MAX))?;
        // What a text takes beside its bytes.
        budget.take(bytes.len() as u64 + rows.saturating_mul(64))?;
        let letters: Vec<char> = match kind {
            1 | 2 | 16 => String::from_utf8_lossy(&bytes).chars().collect(),
            4 | 17 => utf16(&bytes, self.big_endian).chars().collect(),
            _ => return Ok(MatValue::Other("characters of another code")),
        };
        refuse_if(letters.len() as u64 != rows * columns, || {
            self.stream.damaged(format!("{} characters", letters.len()), format!("{rows} × {columns}"))
        })?;
        #[allow(clippy::cast_possible_truncation)] // the budget holds it
        let rows = rows as usize;
        // Nothing in a row is an empty text.
        Ok(MatValue::Texts(if rows == 0 { vec![Vec::new()] } else { texts(&letters, rows) }))
    }
}

/// The rows of a matrix of characters, which stand column after column.
pub(super) fn texts(letters: &[char], rows: usize) -> Vec<Vec<u8>> {
    let text = |row: usize| letters.iter().skip(row).step_by(rows).collect::<String>().into_bytes();
    (0..rows).map(text).collect()
}

/// Elements begin at multiples of eight bytes.
fn padding(bytes: u64) -> u64 {
    bytes.wrapping_neg() % 8
}
