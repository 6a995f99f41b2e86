//! A description as TOML.

use crate::description::{
    CurveExtension, CurvePoints, Description, Follower, NamedText, ResetText, TextPlace,
};
use crate::error::{EquationError, EquationFault, nearest};
use crate::vectors::{VectorElement, text_of_element, vector_elements};
use toml::Spanned;
use toml::de::{DeString, DeTable, DeValue};

/// The tables of a description, with the one value among them.
const TABLES: [&str; 16] = [
    "states",
    "inputs",
    "parameters",
    "let",
    "functions",
    "derivative",
    "measure",
    "quantities",
    "noise",
    "tables",
    "events",
    "when",
    "cyclic",
    "lag",
    "delay",
    "energy",
];

/// The longest file, in bytes.
const LONGEST_FILE: usize = 1_000_000;

type TableItem<'a, 'b> = (&'a str, usize, &'a Spanned<DeValue<'b>>);

impl Description {
    /// Reads TOML, the order of whose keys is that of the states, inputs, parameters and measurements.
    ///
    /// # Errors
    ///
    /// What is no TOML, a table that is not known, and a value of the wrong kind.
    pub fn read(text: &str) -> Result<Self, EquationError> {
        if text.len() > LONGEST_FILE {
            let fault = EquationFault::TooLong { length: text.len(), limit: LONGEST_FILE };
            return Err(EquationError::whole(&TextPlace::default(), "", fault));
        }
        let document = DeTable::parse(text).map_err(|error| {
            let span = error.span().unwrap_or(0..0);
            let place = TextPlace { key: "the file".to_owned(), offset: Some(span.start) };
            EquationError::new(&place, text, span, EquationFault::File(error.message().replace('\n', "; ")))
        })?;
        Self::of_table(document.get_ref())
    }

    /// Reads the tables of a description within a larger file.
    ///
    /// # Errors
    ///
    /// A table that is not known, and a value of the wrong kind.
    pub fn of_table(table: &DeTable<'_>) -> Result<Self, EquationError> {
        let mut description = Self::default();
        for (name, offset, value) in ordered(table) {
            let place = TextPlace { key: name.to_owned(), offset: Some(offset) };
            if name == "energy" {
                description.energy = Some(entry(None, (name, offset, value))?);
                continue;
            }
            if !TABLES.contains(&name) {
                let suggestion = nearest(name, TABLES.into_iter());
                let what = "a table of a device's equations";
                let fault = EquationFault::Unknown { name: name.to_owned(), what, suggestion };
                return Err(EquationError::whole(&place, "", fault));
            }
            let inner = table_of(&place, value)?;
            match name {
                "tables" => description.tables = each(name, inner, points)?,
                "lag" => description.lag = followers(name, inner)?,
                "delay" => description.delay = followers(name, inner)?,
                "when" => description.when = each(name, inner, reset)?.concat(),
                _ => {
                    let mut entries = Vec::new();
                    for pair in ordered(inner) {
                        let written = entry(Some(name), pair)?;
                        for element in elements(&written.place, pair.0)? {
                            let text = of_element(&written, &element)?;
                            entries.push(NamedText {
                                name: element.name,
                                text,
                                place: written.place.clone(),
                            });
                        }
                    }
                    *description.entries(name) = entries;
                }
            }
        }
        Ok(description)
    }

    fn entries(&mut self, table: &str) -> &mut Vec<NamedText> {
        match table {
            "states" => &mut self.states,
            "inputs" => &mut self.inputs,
            "parameters" => &mut self.parameters,
            "let" => &mut self.lets,
            "functions" => &mut self.functions,
            "derivative" => &mut self.derivative,
            "measure" => &mut self.measure,
            "quantities" => &mut self.quantities,
            "noise" => &mut self.noise,
            "events" => &mut self.events,
            _ => &mut self.cyclic,
        }
    }
}

/// The pairs of a table in the order of the file; a map may have sorted them.
fn ordered<'a, 'b>(table: &'a DeTable<'b>) -> Vec<TableItem<'a, 'b>> {
    let of = |(key, value): (&'a Spanned<DeString<'b>>, &'a Spanned<DeValue<'b>>)| {
        (key.get_ref().as_ref(), key.span().start, value)
    };
    let mut pairs: Vec<TableItem<'a, 'b>> = table.iter().map(of).collect();
    pairs.sort_by_key(|(_, offset, _)| *offset);
    pairs
}

fn wrong(place: &TextPlace, value: &Spanned<DeValue<'_>>, expected: &str) -> EquationError {
    let found = value.get_ref().type_str();
    let fault = EquationFault::File(format!("found a TOML value of the type {found}; expected {expected}"));
    EquationError::whole(place, "", fault)
}

fn table_of<'a, 'b>(
    place: &TextPlace,
    value: &'a Spanned<DeValue<'b>>,
) -> Result<&'a DeTable<'b>, EquationError> {
    value.get_ref().as_table().ok_or_else(|| wrong(place, value, "a table"))
}

/// Those that a key stands for.
fn elements(place: &TextPlace, key: &str) -> Result<Vec<VectorElement>, EquationError> {
    vector_elements(key).map_err(|why| EquationError::whole(place, "", EquationFault::Value(why)))
}

/// The text of a key for one of those that it stands for.
fn of_element(written: &NamedText, element: &VectorElement) -> Result<String, EquationError> {
    text_of_element(&written.text, element)
        .map_err(|why| EquationError::whole(&written.place, &written.text, EquationFault::Value(why)))
}

fn followers(table: &str, inner: &DeTable<'_>) -> Result<Vec<Follower>, EquationError> {
    let mut all = Vec::new();
    for written in each(table, inner, follower)? {
        for element in elements(&written.of.place, &written.name)? {
            let part = |written: &NamedText| -> Result<NamedText, EquationError> {
                let text = of_element(written, &element)?;
                Ok(NamedText { name: element.name.clone(), text, place: written.place.clone() })
            };
            let (of, time) = (part(&written.of)?, part(&written.time)?);
            all.push(Follower { name: element.name.clone(), of, time, order: written.order });
        }
    }
    Ok(all)
}

fn each<T>(
    table: &str,
    inner: &DeTable<'_>,
    read: fn(&str, &TextPlace, &DeTable<'_>) -> Result<T, EquationError>,
) -> Result<Vec<T>, EquationError> {
    let of = |(name, offset, value): TableItem<'_, '_>| {
        let place = TextPlace { key: format!("{table}.{name}"), offset: Some(offset) };
        read(name, &place, table_of(&place, value)?)
    };
    ordered(inner).into_iter().map(of).collect()
}

fn entry(table: Option<&str>, (name, offset, value): TableItem<'_, '_>) -> Result<NamedText, EquationError> {
    let key = table.map_or_else(|| name.to_owned(), |table| format!("{table}.{name}"));
    let place = TextPlace { key, offset: Some(offset) };
    let text = value.get_ref().as_str().ok_or_else(|| wrong(&place, value, "a text in quotes"))?;
    Ok(NamedText { name: name.to_owned(), text: text.to_owned(), place })
}

/// The values of a table with these keys alone.
fn fields<'a, 'b, const N: usize>(
    place: &TextPlace,
    table: &'a DeTable<'b>,
    keys: [&str; N],
) -> Result<[Option<TableItem<'a, 'b>>; N], EquationError> {
    let mut found = [const { None }; N];
    for pair in ordered(table) {
        let Some(slot) = keys.iter().position(|key| *key == pair.0).and_then(|index| found.get_mut(index))
        else {
            let suggestion = nearest(pair.0, keys.into_iter());
            let fault = EquationFault::Unknown { name: pair.0.to_owned(), what: "a key here", suggestion };
            return Err(EquationError::whole(place, "", fault));
        };
        *slot = Some(pair);
    }
    Ok(found)
}

fn needed<'a, 'b>(
    place: &TextPlace,
    key: &str,
    found: Option<TableItem<'a, 'b>>,
) -> Result<TableItem<'a, 'b>, EquationError> {
    found.ok_or_else(|| {
        EquationError::whole(place, "", EquationFault::Missing(format!("the key `{key}` is missing")))
    })
}

fn follower(name: &str, place: &TextPlace, table: &DeTable<'_>) -> Result<Follower, EquationError> {
    let [of, time, order] = fields(place, table, ["of", "time", "order"])?;
    let part = |key: &str, found: Option<TableItem<'_, '_>>| -> Result<NamedText, EquationError> {
        let mut entry = entry(Some(&place.key), needed(place, key, found)?)?;
        name.clone_into(&mut entry.name);
        Ok(entry)
    };
    let order = match order {
        None => 2,
        Some((_, _, value)) => {
            let number = value.get_ref().as_integer().and_then(|number| number.as_str().parse().ok());
            number.ok_or_else(|| wrong(place, value, "the order 1 or 2"))?
        }
    };
    Ok(Follower { name: name.to_owned(), of: part("of", of)?, time: part("time", time)?, order })
}

/// The resets that a key stands for.
fn reset(name: &str, place: &TextPlace, table: &DeTable<'_>) -> Result<Vec<ResetText>, EquationError> {
    let [rises, falls, crosses, set] = fields(place, table, ["rises", "falls", "crosses", "set"])?;
    let (_, offset, set) = needed(place, "set", set)?;
    let of_set = TextPlace { key: format!("{}.set", place.key), offset: Some(offset) };
    let set = table_of(&of_set, set)?;
    let one = |element: VectorElement| {
        let part = |found: Option<TableItem<'_, '_>>| -> Result<Option<NamedText>, EquationError> {
            let Some(written) = found.map(|pair| entry(Some(&place.key), pair)).transpose()? else {
                return Ok(None);
            };
            Ok(Some(NamedText { text: of_element(&written, &element)?, ..written }))
        };
        let mut states = Vec::new();
        for pair in ordered(set) {
            let written = entry(Some(&of_set.key), pair)?;
            let key = NamedText { text: written.name.clone(), ..written.clone() };
            for state in elements(&written.place, &of_element(&key, &element)?)? {
                let text = of_element(
                    &NamedText { text: of_element(&written, &element)?, ..written.clone() },
                    &state,
                )?;
                states.push(NamedText { name: state.name, text, place: written.place.clone() });
            }
        }
        let (rises, falls, crosses) = (part(rises)?, part(falls)?, part(crosses)?);
        let (name, place) = (element.name.clone(), place.clone());
        Ok(ResetText { name, place, rises, falls, crosses, set: states })
    };
    elements(place, name)?.into_iter().map(one).collect()
}

fn points(name: &str, place: &TextPlace, table: &DeTable<'_>) -> Result<CurvePoints, EquationError> {
    let [file, x, y, z, x_unit, y_unit, z_unit, outside] =
        fields(place, table, ["file", "x", "y", "z", "x_unit", "y_unit", "z_unit", "outside"])?;
    let text = |found: Option<TableItem<'_, '_>>| -> Result<Option<String>, EquationError> {
        found.map(|pair| entry(Some(&place.key), pair).map(|entry| entry.text)).transpose()
    };
    let outside = match text(outside)?.as_deref() {
        None | Some("error") => CurveExtension::Error,
        Some("clamp") => CurveExtension::Clamp,
        Some("linear") => CurveExtension::Linear,
        Some(other) => {
            let suggestion = nearest(other, ["error", "clamp", "linear"].into_iter());
            let what = "a rule for what is outside; expected `error`, `clamp` or `linear`";
            let fault = EquationFault::Unknown { name: other.to_owned(), what, suggestion };
            return Err(EquationError::whole(place, "", fault));
        }
    };
    let file = text(file)?;
    if file.is_some() {
        let units = [text(x_unit)?, text(y_unit)?, text(z_unit)?].map(Option::unwrap_or_default);
        let [x_unit, y_unit, z_unit] = units;
        let name = name.to_owned();
        return Ok(CurvePoints {
            name,
            place: place.clone(),
            file,
            x: vec![],
            y: vec![],
            z: vec![],
            x_unit,
            y_unit,
            z_unit,
            outside,
        });
    }
    let (x, y) = (numbers(place, needed(place, "x", x)?)?, numbers(place, needed(place, "y", y)?)?);
    let x_unit = entry(Some(&place.key), needed(place, "x_unit", x_unit)?)?;
    let y_unit = entry(Some(&place.key), needed(place, "y_unit", y_unit)?)?;
    let (z, z_unit) = match z {
        None => (Vec::new(), String::new()),
        Some(z) => {
            (grid(place, z, y.len())?, entry(Some(&place.key), needed(place, "z_unit", z_unit)?)?.text)
        }
    };
    CurvePoints {
        name: name.to_owned(),
        place: place.clone(),
        file: None,
        x,
        y,
        x_unit: x_unit.text,
        y_unit: y_unit.text,
        z,
        z_unit,
        outside,
    }
    .in_si()
}

/// The rows of a surface, each with as many numbers as there are places along the second argument.
fn grid(
    place: &TextPlace,
    (_, _, value): TableItem<'_, '_>,
    columns: usize,
) -> Result<Vec<f64>, EquationError> {
    let rows = value.get_ref().as_array().ok_or_else(|| wrong(place, value, "a list of rows of numbers"))?;
    let mut all = Vec::new();
    for (index, row) in rows.iter().enumerate() {
        let row = numbers(place, ("z", 0, row))?;
        if row.len() != columns {
            let why = format!(
                "row {} of `z` has {} numbers; expected {columns}, one for each `y`",
                index + 1,
                row.len()
            );
            return Err(EquationError::whole(place, "", EquationFault::Value(why)));
        }
        all.extend(row);
    }
    Ok(all)
}

fn numbers(place: &TextPlace, (_, _, value): TableItem<'_, '_>) -> Result<Vec<f64>, EquationError> {
    let list = value.get_ref().as_array().ok_or_else(|| wrong(place, value, "a list of numbers"))?;
    let number = |item: &Spanned<DeValue<'_>>| {
        let text: Option<String> = match item.get_ref() {
            DeValue::Integer(number) => Some(number.as_str().to_owned()),
            DeValue::Float(number) => Some(number.as_str().to_owned()),
            _ => None,
        };
        text.and_then(|text| text.replace('_', "").parse().ok()).ok_or_else(|| wrong(place, item, "a number"))
    };
    list.iter().map(number).collect()
}
