//! A value put at a key of a parsed experiment file.

use super::{ConfigFault, Key, KeyStep};
use toml::{Table, Value};

/// Puts a value at a key. Tables on the way that are not there are made; entries of lists are not.
pub fn put(document: &mut Table, key: &Key, value: Value) -> Result<(), ConfigFault> {
    let (Some(KeyStep::Name(first)), steps) = (key.steps().first(), key.steps().get(1..).unwrap_or_default())
    else {
        return Err(ConfigFault::Value { why: "a key begins with a name".to_owned() });
    };
    if let Some(KeyStep::Index(_)) = steps.first()
        && !document.contains_key(first)
    {
        return Err(ConfigFault::Value { why: format!("there is no list `{first}` in the experiment file") });
    }
    let mut here = document.entry(first).or_insert_with(|| Value::Table(Table::new()));
    for step in steps {
        here = match (step, here) {
            (KeyStep::Name(name), Value::Table(table)) => {
                table.entry(name).or_insert_with(|| Value::Table(Table::new()))
            }
            (KeyStep::Name(name), other) => {
                let why = format!("`{name}` cannot stand below {}", other.type_str());
                return Err(ConfigFault::Value { why });
            }
            (KeyStep::Index(index), Value::Array(items)) => {
                let count = items.len();
                items.get_mut(*index).ok_or_else(|| {
                    let why =
                        format!("there is no entry {index} of this list; it has {count}, counted from 0");
                    ConfigFault::Value { why }
                })?
            }
            (KeyStep::Index(_), other) => {
                let why = format!("an index needs a list, and {} stands there", other.type_str());
                return Err(ConfigFault::Value { why });
            }
        };
    }
    *here = value;
    Ok(())
}

/// The value at a key.
pub fn get<'a>(document: &'a Table, key: &Key) -> Option<&'a Value> {
    let (KeyStep::Name(first), steps) = key.steps().split_first()? else { return None };
    steps.iter().try_fold(document.get(first)?, |value, step| match step {
        KeyStep::Name(name) => value.get(name.as_str()),
        KeyStep::Index(index) => value.get(*index),
    })
}

/// The first name on the way to a key that the document does not have, and the names beside which it would stand.
pub fn absent<'a>(document: &'a Table, key: &'a Key) -> Option<(&'a str, Vec<&'a str>)> {
    let mut table = Some(document);
    let mut list: Option<&[Value]> = None;
    for step in key.steps() {
        let value = match step {
            KeyStep::Name(name) => {
                let there = table?;
                let Some(value) = there.get(name) else {
                    return Some((name, there.keys().map(String::as_str).collect()));
                };
                value
            }
            KeyStep::Index(index) => list?.get(*index)?,
        };
        table = value.as_table();
        list = value.as_array().map(Vec::as_slice);
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    fn document() -> Table {
        "a = 1\n[b.c]\nd = \"2 V\"\n[[e]]\nf = true\n[[e]]\nf = false\n".parse().unwrap()
    }

    #[test]
    fn puts_a_value_at_every_kind_of_key() {
        for (key, expected) in [
            ("a", "a = 9\n[b.c]\nd = \"2 V\"\n[[e]]\nf = true\n[[e]]\nf = false\n"),
            ("b.c.d", "a = 1\n[b.c]\nd = 9\n[[e]]\nf = true\n[[e]]\nf = false\n"),
            ("b.c.new", "a = 1\n[b.c]\nd = \"2 V\"\nnew = 9\n[[e]]\nf = true\n[[e]]\nf = false\n"),
            ("b.x.y", "a = 1\n[b.c]\nd = \"2 V\"\n[b.x]\ny = 9\n[[e]]\nf = true\n[[e]]\nf = false\n"),
            ("e[1].f", "a = 1\n[b.c]\nd = \"2 V\"\n[[e]]\nf = true\n[[e]]\nf = 9\n"),
        ] {
            let mut document = document();
            put(&mut document, &Key::parse(key).unwrap(), Value::Integer(9)).unwrap();
            assert_eq!(document, expected.parse::<Table>().unwrap(), "{key}");
            assert_eq!(get(&document, &Key::parse(key).unwrap()), Some(&Value::Integer(9)), "{key}");
        }
        for key in ["e[2].f", "a.b", "b[0]", "e.f", "g[0].h", "b.g[0]"] {
            assert!(put(&mut document(), &Key::parse(key).unwrap(), Value::Integer(9)).is_err(), "{key}");
        }
    }

    #[test]
    fn an_absent_key_is_reported() {
        let document = document();
        let absent = |key: &str| {
            let key = Key::parse(key).unwrap();
            absent(&document, &key).map(|(name, known)| format!("{name} of {}", known.join(" ")))
        };
        assert_eq!(absent("b.c.d"), None);
        assert_eq!(absent("e[1].f"), None);
        assert_eq!(absent("b.x.y").unwrap(), "x of c");
        assert_eq!(absent("e[1].g").unwrap(), "g of f");
    }
}
