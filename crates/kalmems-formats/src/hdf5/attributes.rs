//! The attributes of an object (HDF5 File Format Specification, section IV.A.2.m).

use super::FORMAT;
use super::datatype::{self, DatatypeKind as Type};
use super::file::{Hdf5File, MetadataCursor};
use super::header::{self, MessageKind, ObjectHeader};
use super::heap::{self, HeapTexts};
use crate::element::ExactNumber;
use crate::records::TextEncoding;
use crate::{FormatError, Result, limits, refuse_if};

/// Elements of an attribute; one with more is no unit, name or factor.
const ELEMENTS: u64 = 4096;

/// The value of an attribute.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum AttributeValue {
    Texts(Vec<String>),
    Numbers(Vec<ExactNumber>),
    /// Anything else, or too much.
    Other,
}

/// The attributes of an object, by their names.
#[derive(Default)]
pub(super) struct Attributes(Vec<(String, AttributeValue)>);

impl Attributes {
    pub(super) fn read(file: &Hdf5File, header: &ObjectHeader) -> Result<Self> {
        let mut all = Self::default();
        let mut read = |cursor: &mut MetadataCursor<'_>| {
            let what = "the number of attributes of an object";
            limits::push(FORMAT, what, &mut all.0, attribute(file, cursor)?)
        };
        header.each(file, MessageKind::Attribute, &mut read)?;
        let skip = |kind| if kind == 8 || kind == 9 { Some(0) } else { None };
        heap::each_dense(file, header, MessageKind::AttributeInfo, (2, &skip), &mut read)?;
        Ok(all)
    }

    pub(super) fn get(&self, name: &str) -> Option<&AttributeValue> {
        self.0.iter().find(|(known, _)| known == name).map(|(_, value)| value)
    }

    /// A single text.
    pub(super) fn text(&self, name: &str) -> Option<&str> {
        match self.texts(name)? {
            [only] => Some(only),
            _ => None,
        }
    }

    pub(super) fn texts(&self, name: &str) -> Option<&[String]> {
        match self.get(name)? {
            AttributeValue::Texts(texts) => Some(texts),
            _ => None,
        }
    }

    pub(super) fn numbers(&self, name: &str) -> &[ExactNumber] {
        match self.get(name) {
            Some(AttributeValue::Numbers(numbers)) => numbers,
            _ => &[],
        }
    }

    /// Those that are single numbers.
    pub(super) fn single_numbers(&self) -> impl Iterator<Item = (&str, f64)> {
        self.0.iter().filter_map(|(name, value)| match value {
            AttributeValue::Numbers(numbers) => match numbers[..] {
                [only] => Some((name.as_str(), only.rounded())),
                _ => None,
            },
            _ => None,
        })
    }

    /// The unit or the units of the columns, whatever the attribute is called.
    pub(super) fn units(&self) -> &[String] {
        let is_unit = |name: &str| {
            let letters = name.chars().filter(|letter| letter.is_alphanumeric()).collect::<String>();
            matches!(
                letters.to_lowercase().as_str(),
                "unit" | "units" | "unitstring" | "unitsymbol" | "niunitdescription" | "physicalunit"
            )
        };
        let named = self.0.iter().filter(|(name, _)| is_unit(name));
        let mut texts = named.filter_map(|(_, value)| match value {
            AttributeValue::Texts(texts) if !texts.is_empty() => Some(texts),
            _ => None,
        });
        texts.next().map_or(&[], Vec::as_slice)
    }
}

/// How many elements a dataspace has, and its axes: their lengths now and at most.
#[derive(Clone, Debug)]
pub(super) struct Dataspace {
    pub(super) shape: Vec<u64>,
    /// None where an axis has no end.
    pub(super) most: Vec<Option<u64>>,
    /// Nothing is there, not even one element.
    pub(super) none: bool,
}

impl Dataspace {
    pub(super) fn read(cursor: &mut MetadataCursor<'_>) -> Result<Self> {
        let (version, axes, flags) = (cursor.u8()?, usize::from(cursor.u8()?), cursor.u8()?);
        let none = match version {
            1 => {
                cursor.skip(5)?;
                false
            }
            2 => cursor.u8()? == 2,
            _ => return Err(cursor.damaged(format!("version {version} of a shape"), "1 or 2")),
        };
        refuse_if(axes > 32, || cursor.damaged(format!("{axes} axes"), "at most 32"))?;
        let shape = (0..axes).map(|_| cursor.u64()).collect::<Result<Vec<_>, _>>()?;
        let endless = u64::MAX;
        let most = if flags & 1 != 0 {
            let most = (0..axes).map(|_| cursor.u64()).collect::<Result<Vec<_>, _>>()?;
            most.into_iter().map(|length| (length != endless).then_some(length)).collect()
        } else {
            shape.iter().map(|length| Some(*length)).collect()
        };
        Ok(Self { shape, most, none })
    }

    pub(super) fn count(&self) -> u64 {
        if self.none {
            return 0;
        }
        self.shape.iter().fold(1, |count: u64, length| count.saturating_mul(*length))
    }
}

fn attribute(file: &Hdf5File, cursor: &mut MetadataCursor<'_>) -> Result<(String, AttributeValue)> {
    let (version, flags) = (cursor.u8()?, cursor.u8()?);
    refuse_if(!(1..=3).contains(&version), || {
        cursor.damaged(format!("version {version} of an attribute"), "1 to 3")
    })?;
    let lengths = [usize::from(cursor.u16()?), usize::from(cursor.u16()?), usize::from(cursor.u16()?)];
    if version == 3 {
        cursor.skip(1)?;
    }
    // Of the first version each part begins at a multiple of eight bytes.
    let mut part = |length: usize| {
        let part = cursor.part(length)?;
        if version == 1 {
            cursor.skip(length.next_multiple_of(8) - length)?;
        }
        Ok::<_, FormatError>(part)
    };
    let (mut name, mut element, mut space) = (part(lengths[0])?, part(lengths[1])?, part(lengths[2])?);
    let name = name.name()?;
    // A shape that is elsewhere is not written by any library that is known.
    if version > 1 && flags & 2 != 0 {
        return Ok((name, AttributeValue::Other));
    }
    let element = if version > 1 && flags & 1 != 0 {
        let address = header::shared(&mut element)?;
        let there = ObjectHeader::read(file, address)?.first(file, MessageKind::Datatype, datatype::read)?;
        there.unwrap_or(Type::Other("a type that is not there"))
    } else {
        datatype::read(&mut element)?
    };
    let count = Dataspace::read(&mut space)?.count();
    let value = if count > ELEMENTS { AttributeValue::Other } else { value(file, cursor, &element, count)? };
    Ok((name, value))
}

fn value(
    file: &Hdf5File,
    cursor: &mut MetadataCursor<'_>,
    element: &Type,
    count: u64,
) -> Result<AttributeValue> {
    Ok(match element {
        Type::Number(element) => {
            let numbers = (0..count).map(|_| Ok(element.exact(cursor.take(element.bytes)?)));
            AttributeValue::Numbers(numbers.collect::<Result<_>>()?)
        }
        Type::Text { bytes } => {
            let texts = (0..count).map(|_| Ok(text(cursor.take(*bytes)?)));
            AttributeValue::Texts(texts.collect::<Result<_>>()?)
        }
        Type::Texts => {
            let mut heap = HeapTexts::new(file);
            let texts = (0..count).map(|_| Ok(text(&heap.text(cursor)?)));
            AttributeValue::Texts(texts.collect::<Result<_>>()?)
        }
        _ => AttributeValue::Other,
    })
}

/// A text without the zeros and white space around it.
fn text(raw: &[u8]) -> String {
    let mut trimmed = Vec::new();
    TextEncoding::Bytes.read(raw, &mut trimmed);
    String::from_utf8_lossy(&trimmed).into_owned()
}
