//! Reads a parsed TOML document into types, and says exactly where and why it cannot.
//!
//! The deserializer of the `toml` crate reports faults as text without the way to the key. This one keeps
//! them typed, with key and place, and visits keys in the order of the file, so that the first fault in the
//! file is the one reported.

use super::device::DEVICE;
use super::error::shown;
use super::key::KeyStep;
use super::schema::remedy;
use super::source::Source;
use super::uncertainty::CORRELATION;
use super::{ConfigError, ConfigFault, Key};
use schemars::JsonSchema;
use serde::de::DeserializeOwned;
use serde::de::value::StrDeserializer;
use serde::de::{
    DeserializeSeed, Deserializer, EnumAccess, Expected, IntoDeserializer, MapAccess, SeqAccess, Unexpected,
    VariantAccess, Visitor,
};
use std::fmt;
use std::ops::Range;
use std::slice;
use toml::Spanned;
use toml::de::{DeString, DeTable, DeValue};

/// A fault, and what is known of its place so far.
#[derive(Debug)]
pub(super) struct ReadFailure {
    pub fault: ConfigFault,
    pub key: Key,
    /// The byte of the text; `None` where the whole file is meant.
    pub byte: Option<usize>,
}

impl ReadFailure {
    /// What to write instead is filled in by whoever knows the schema.
    pub fn new(fault: ConfigFault) -> Self {
        Self { fault, key: Key::default(), byte: None }
    }

    /// The innermost place counts: one that is set already stays.
    fn at(mut self, span: Range<usize>) -> Self {
        self.byte.get_or_insert(span.start);
        self
    }

    fn under(mut self, name: &str) -> Self {
        self.key.prepend(KeyStep::Name(name.to_owned()));
        self
    }

    fn under_index(mut self, index: usize) -> Self {
        self.key.prepend(KeyStep::Index(index));
        self
    }
}

impl fmt::Display for ReadFailure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.key, self.fault)
    }
}

impl std::error::Error for ReadFailure {}

impl serde::de::Error for ReadFailure {
    fn custom<T: fmt::Display>(why: T) -> Self {
        Self::new(ConfigFault::Value { why: why.to_string() })
    }

    fn invalid_type(found: Unexpected<'_>, expected: &dyn Expected) -> Self {
        let found = match found {
            Unexpected::Bool(b) => format!("`{b}`"),
            Unexpected::Signed(n) => format!("the number `{n}`"),
            Unexpected::Unsigned(n) => format!("the number `{n}`"),
            Unexpected::Float(n) => format!("the number `{n:?}`"),
            Unexpected::Str(s) => format!("the text `{}`", shown(s)),
            Unexpected::Seq => "a list".to_owned(),
            Unexpected::Map => "a table".to_owned(),
            other => other.to_string(),
        };
        Self::new(ConfigFault::Type {
            found,
            expected: in_words(&expected.to_string()),
            remedy: String::new(),
        })
    }

    fn invalid_value(found: Unexpected<'_>, expected: &dyn Expected) -> Self {
        Self::invalid_type(found, expected)
    }

    fn invalid_length(length: usize, expected: &dyn Expected) -> Self {
        let found = format!("a list of {length}");
        Self::new(ConfigFault::Type {
            found,
            expected: in_words(&expected.to_string()),
            remedy: String::new(),
        })
    }

    fn unknown_field(field: &str, expected: &'static [&'static str]) -> Self {
        Self::new(ConfigFault::unknown_key(field, expected.iter().copied()))
    }

    fn unknown_variant(variant: &str, expected: &'static [&'static str]) -> Self {
        Self::new(ConfigFault::unknown_word(variant, expected.iter().copied()))
    }

    fn missing_field(field: &'static str) -> Self {
        Self::new(ConfigFault::MissingKey { remedy: String::new() }).under(field)
    }
}

/// What is expected, in the words of this program where the library has its own.
fn in_words(expected: &str) -> String {
    let list = |length: &str| format!("a list of {length} in square brackets");
    let words = match expected {
        "u8" | "u16" | "u32" | "u64" | "u128" | "usize" => "a whole number of 0 or more, without quotes",
        "i8" | "i16" | "i32" | "i64" | "i128" | "isize" => "a whole number, without quotes",
        "f32" | "f64" => "a number, without quotes",
        "a boolean" => "`true` or `false`, without quotes",
        "a string" | "a character" => "text in quotes",
        "a sequence" => "a list in square brackets",
        "a map" => "a table",
        _ if expected.starts_with("a nonzero u") => "a whole number of 1 or more, without quotes",
        _ if expected.starts_with("struct ") => "a table",
        _ => {
            let of_length = ["an array of length ", "a tuple of size ", "tuple of "]
                .iter()
                .find_map(|start| expected.strip_prefix(start));
            return of_length.map_or_else(|| expected.to_owned(), list);
        }
    };
    words.to_owned()
}

/// Reads a file into a type, and says of a fault where it is and what to write.
pub fn read_source<T: DeserializeOwned + JsonSchema>(source: &Source) -> Result<T, ConfigError> {
    let document = source.document()?;
    let read = read::<T>(document.get_ref());
    drop(document);
    read.map_err(|ReadFailure { mut fault, key, byte }| {
        if let ConfigFault::MissingKey { remedy: what } | ConfigFault::Type { remedy: what, .. } = &mut fault
        {
            *what = remedy::<T>(&key, &key);
        }
        source.error(key, byte, fault)
    })
}

/// Reads the table at `place` of a file into a type; otherwise as [`read_source`].
pub(super) fn read_below<T: DeserializeOwned + JsonSchema>(
    source: &Source,
    place: &Key,
) -> Result<T, ConfigError> {
    let document = source.document()?;
    let missing = || {
        source
            .error_at(place.clone(), ConfigFault::MissingKey { remedy: format!("add the table `[{place}]`") })
    };
    let mut table = document.get_ref();
    let mut value = None;
    for step in place.steps() {
        let KeyStep::Name(name) = step else { return Err(missing()) };
        let found: &Spanned<DeValue<'_>> = table.get(name.as_str()).ok_or_else(missing)?;
        value = Some(found);
        if let Some(inner) = found.get_ref().as_table() {
            table = inner;
        }
    }
    let value = value.ok_or_else(missing)?;
    T::deserialize(ValueReader { value }).map_err(|failure| {
        let ReadFailure { mut fault, key, byte } = failure.at(value.span());
        let full = place.steps().iter().rev().cloned().fold(key.clone(), |mut full, step| {
            full.prepend(step);
            full
        });
        if let ConfigFault::MissingKey { remedy: what } | ConfigFault::Type { remedy: what, .. } = &mut fault
        {
            *what = remedy::<T>(&key, &full);
        }
        source.error(full, byte, fault)
    })
}

/// Reads the document.
fn read<T: DeserializeOwned>(document: &DeTable<'_>) -> Result<T, ReadFailure> {
    T::deserialize(TableReader { table: document })
}

/// The document itself: a table without a place of its own.
struct TableReader<'a> {
    table: &'a DeTable<'a>,
}

impl<'de> Deserializer<'de> for TableReader<'_> {
    type Error = ReadFailure;

    fn deserialize_any<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, ReadFailure> {
        visitor.visit_map(TableEntries::of(self.table))
    }

    serde::forward_to_deserialize_any! {
        bool i8 i16 i32 i64 i128 u8 u16 u32 u64 u128 f32 f64 char str string bytes byte_buf option unit
        unit_struct newtype_struct seq tuple tuple_struct map struct enum identifier ignored_any
    }
}

/// A number of the document.
enum DocumentNumber {
    Whole(i64),
    Real(f64),
}

/// One value of the document.
#[derive(Clone, Copy)]
struct ValueReader<'a> {
    value: &'a Spanned<DeValue<'a>>,
}

impl ValueReader<'_> {
    fn refuse<T>(self, expected: impl Into<String>) -> Result<T, ReadFailure> {
        Err(self.refusal(expected.into()))
    }

    /// Compiled once, and not for each type that is read.
    fn refusal(self, expected: String) -> ReadFailure {
        let found = match self.value.get_ref() {
            DeValue::String(s) => format!("the text `{}`", shown(s)),
            DeValue::Integer(n) => format!("the number `{}`", shown(n.as_str())),
            DeValue::Float(n) => format!("the number `{}`", shown(n.as_str())),
            DeValue::Boolean(b) => format!("`{b}`"),
            DeValue::Datetime(_) => "a date".to_owned(),
            DeValue::Array(_) => "a list".to_owned(),
            DeValue::Table(_) => "a table".to_owned(),
        };
        let fault = ConfigFault::Type { found, expected, remedy: String::new() };
        ReadFailure::new(fault).at(self.value.span())
    }

    /// With the place, where it went wrong.
    fn placed<T>(self, result: Result<T, ReadFailure>) -> Result<T, ReadFailure> {
        result.map_err(|failure| failure.at(self.value.span()))
    }

    /// Compiled once, too.
    fn number(self) -> Result<DocumentNumber, ReadFailure> {
        let number = match self.value.get_ref() {
            DeValue::Integer(n) => i64::from_str_radix(n.as_str(), n.radix()).ok().map(DocumentNumber::Whole),
            DeValue::Float(n) => n.as_str().parse().ok().map(DocumentNumber::Real),
            _ => None,
        };
        number.ok_or_else(|| {
            ReadFailure::new(ConfigFault::Value {
                why: "the number is too large; write it with an exponent".into(),
            })
        })
    }
}

impl<'de> Deserializer<'de> for ValueReader<'_> {
    type Error = ReadFailure;

    fn deserialize_any<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, ReadFailure> {
        let result = match self.value.get_ref() {
            DeValue::String(s) => visitor.visit_str(s),
            DeValue::Integer(_) | DeValue::Float(_) => match self.number() {
                Ok(DocumentNumber::Whole(n)) => visitor.visit_i64(n),
                Ok(DocumentNumber::Real(n)) => visitor.visit_f64(n),
                Err(failure) => Err(failure),
            },
            DeValue::Boolean(b) => visitor.visit_bool(*b),
            DeValue::Datetime(_) => {
                let found = Unexpected::Other("a date");
                Err(serde::de::Error::invalid_type(found, &visitor))
            }
            DeValue::Array(array) => visitor.visit_seq(Items { items: array.iter(), index: 0 }),
            DeValue::Table(table) => visitor.visit_map(TableEntries::of(table)),
        };
        self.placed(result)
    }

    // Each asks its visitor for one thing alone: what else a visitor can take is then not compiled.

    fn deserialize_bool<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, ReadFailure> {
        match self.value.get_ref() {
            DeValue::Boolean(b) => self.placed(visitor.visit_bool(*b)),
            _ => self.refuse("`true` or `false`, without quotes"),
        }
    }

    fn deserialize_f64<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, ReadFailure> {
        if !(self.value.get_ref().is_float() || self.value.get_ref().is_integer()) {
            return self.refuse("a number, without quotes");
        }
        match self.number().map_err(|failure| failure.at(self.value.span()))? {
            DocumentNumber::Whole(n) => self.placed(visitor.visit_i64(n)),
            DocumentNumber::Real(n) => self.placed(visitor.visit_f64(n)),
        }
    }

    fn deserialize_str<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, ReadFailure> {
        match self.value.get_ref() {
            DeValue::String(s) => self.placed(visitor.visit_str(s)),
            _ => self.refuse("text in quotes"),
        }
    }

    fn deserialize_string<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, ReadFailure> {
        self.deserialize_str(visitor)
    }

    fn deserialize_seq<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, ReadFailure> {
        match self.value.get_ref() {
            DeValue::Array(array) => self.placed(visitor.visit_seq(Items { items: array.iter(), index: 0 })),
            DeValue::Table(_) => self.refuse("a list of tables"),
            _ => self.refuse("a list in square brackets"),
        }
    }

    fn deserialize_map<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, ReadFailure> {
        match self.value.get_ref() {
            DeValue::Table(table) => self.placed(visitor.visit_map(TableEntries::of(table))),
            _ => self.refuse("a table"),
        }
    }

    fn deserialize_struct<V: Visitor<'de>>(
        self,
        _name: &'static str,
        fields: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, ReadFailure> {
        match self.value.get_ref() {
            DeValue::Table(table) => self.placed(visitor.visit_map(TableEntries::of(table))),
            _ => self.refuse(format!("a table with keys from: {}", fields.join(", "))),
        }
    }

    fn deserialize_option<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, ReadFailure> {
        visitor.visit_some(self)
    }

    fn deserialize_newtype_struct<V: Visitor<'de>>(
        self,
        _name: &'static str,
        visitor: V,
    ) -> Result<V::Value, ReadFailure> {
        visitor.visit_newtype_struct(self)
    }

    /// A word, or a table with exactly one entry that names the variant; of a device's table, beside its correlations.
    fn deserialize_enum<V: Visitor<'de>>(
        self,
        name: &'static str,
        variants: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, ReadFailure> {
        let choice = match self.value.get_ref() {
            DeValue::String(word) => Choice { word, span: self.value.span(), content: None, reader: self },
            DeValue::Table(table) => {
                let mut entries = TableEntries::of(table).entries;
                entries.retain(|(key, _)| name != DEVICE || key.get_ref() != CORRELATION);
                let [(key, content)] = entries.as_slice() else {
                    let found = entries.iter().map(|(key, _)| shown(key.get_ref())).collect();
                    let known = variants.iter().map(|v| (*v).to_owned()).collect();
                    return Err(ReadFailure::new(ConfigFault::OneOf { found, known }).at(self.value.span()));
                };
                Choice { word: key.get_ref(), span: key.span(), content: Some(*content), reader: self }
            }
            _ => return self.refuse(format!("one of the words: {}", variants.join(", "))),
        };
        visitor.visit_enum(choice)
    }

    serde::forward_to_deserialize_any! {
        i8 i16 i32 i64 i128 u8 u16 u32 u64 u128 f32 char bytes byte_buf unit unit_struct tuple tuple_struct
        identifier ignored_any
    }
}

/// The entries of a table in the order of the file.
struct TableEntries<'a> {
    entries: Vec<(&'a Spanned<DeString<'a>>, &'a Spanned<DeValue<'a>>)>,
    next: usize,
}

impl<'a> TableEntries<'a> {
    fn of(table: &'a DeTable<'a>) -> Self {
        let mut entries: Vec<_> = table.iter().collect();
        entries.sort_by_key(|(key, _)| key.span().start);
        Self { entries, next: 0 }
    }
}

impl<'de> MapAccess<'de> for TableEntries<'_> {
    type Error = ReadFailure;

    fn next_key_seed<K: DeserializeSeed<'de>>(&mut self, seed: K) -> Result<Option<K::Value>, ReadFailure> {
        let Some((key, _)) = self.entries.get(self.next) else { return Ok(None) };
        let name: StrDeserializer<'_, ReadFailure> = key.get_ref().as_ref().into_deserializer();
        seed.deserialize(name).map(Some).map_err(|failure| failure.under(key.get_ref()).at(key.span()))
    }

    fn next_value_seed<T: DeserializeSeed<'de>>(&mut self, seed: T) -> Result<T::Value, ReadFailure> {
        let Some((key, value)) = self.entries.get(self.next) else {
            return Err(serde::de::Error::custom("no entry is left"));
        };
        self.next += 1;
        seed.deserialize(ValueReader { value })
            .map_err(|failure| failure.at(value.span()).under(key.get_ref()))
    }
}

/// The entries of a list.
struct Items<'a> {
    items: slice::Iter<'a, Spanned<DeValue<'a>>>,
    index: usize,
}

impl<'de> SeqAccess<'de> for Items<'_> {
    type Error = ReadFailure;

    fn next_element_seed<T: DeserializeSeed<'de>>(
        &mut self,
        seed: T,
    ) -> Result<Option<T::Value>, ReadFailure> {
        let Some(value) = self.items.next() else { return Ok(None) };
        let index = self.index;
        self.index += 1;
        seed.deserialize(ValueReader { value })
            .map(Some)
            .map_err(|failure| failure.at(value.span()).under_index(index))
    }
}

/// One of several words, with what stands under it where it is the name of a table.
struct Choice<'a> {
    word: &'a str,
    span: Range<usize>,
    content: Option<&'a Spanned<DeValue<'a>>>,
    reader: ValueReader<'a>,
}

impl<'de> EnumAccess<'de> for Choice<'_> {
    type Error = ReadFailure;
    type Variant = Self;

    fn variant_seed<T: DeserializeSeed<'de>>(self, seed: T) -> Result<(T::Value, Self), ReadFailure> {
        let name: StrDeserializer<'_, ReadFailure> = self.word.into_deserializer();
        match seed.deserialize(name) {
            Ok(variant) => Ok((variant, self)),
            Err(mut failure) => {
                // The name of a table is a key, not a word.
                if self.content.is_some() {
                    if let ConfigFault::UnknownWord { found, suggestion, known } = failure.fault {
                        failure.fault = ConfigFault::UnknownKey { found, suggestion, known };
                    }
                    failure = failure.under(self.word);
                }
                Err(failure.at(self.span))
            }
        }
    }
}

impl<'de> VariantAccess<'de> for Choice<'_> {
    type Error = ReadFailure;

    fn unit_variant(self) -> Result<(), ReadFailure> {
        match self.content {
            None => Ok(()),
            Some(_) => self.reader.refuse(format!("the word `\"{}\"` alone", self.word)),
        }
    }

    fn newtype_variant_seed<T: DeserializeSeed<'de>>(self, seed: T) -> Result<T::Value, ReadFailure> {
        match self.content {
            Some(value) => seed
                .deserialize(ValueReader { value })
                .map_err(|failure| failure.at(value.span()).under(self.word)),
            None => self.reader.refuse("a table, not its name alone"),
        }
    }

    fn tuple_variant<V: Visitor<'de>>(self, _len: usize, visitor: V) -> Result<V::Value, ReadFailure> {
        self.reader.deserialize_seq(visitor)
    }

    fn struct_variant<V: Visitor<'de>>(
        self,
        fields: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, ReadFailure> {
        match self.content {
            Some(value) => ValueReader { value }
                .deserialize_struct("", fields, visitor)
                .map_err(|failure| failure.under(self.word)),
            None => self.reader.refuse("a table, not its name alone"),
        }
    }
}
