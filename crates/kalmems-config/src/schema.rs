//! The JSON schema of experiment files, and what those of other files are made with, from the types that read them.

use super::device::DeviceKind;
use super::key::KeyStep;
use super::quantity::FROM_RECORDING;
use super::{Experiment, Key};
use schemars::JsonSchema;
use schemars::generate::SchemaSettings;
use schemars::transform::{RecursiveTransform, Transform};
use serde_json::Value;

/// The JSON schema of a type that code of its own reads: its name, and what it accepts, which is written wherever the type is used.
///
/// ```
/// use schemars::{JsonSchema, json_schema};
/// struct Even;
/// kalmems_config::inline_schema!(Even, "Even", |_| json_schema!({ "type": "integer", "multipleOf": 2 }));
/// assert_eq!(Even::schema_name(), "Even");
/// ```
#[macro_export]
macro_rules! inline_schema {
    ($type:ty, $name:literal, |$generator:pat_param| $schema:expr) => {
        impl ::schemars::JsonSchema for $type {
            fn schema_name() -> ::std::borrow::Cow<'static, str> {
                $name.into()
            }

            fn inline_schema() -> bool {
                true
            }

            fn json_schema($generator: &mut ::schemars::SchemaGenerator) -> ::schemars::Schema {
                $schema
            }
        }
    };
}

/// The JSON schema of an experiment file with one of these devices: for editors, and for checking a file without this
/// program.
pub fn experiment_schema(devices: &[DeviceKind]) -> Value {
    let mut generator = settings(false).into_generator();
    let device = DeviceKind::schema_of_one(devices, &mut generator);
    let mut schema = generator.into_root_schema_for::<Experiment>();
    if let Some(Value::Object(properties)) = schema.get_mut("properties") {
        properties.insert("device".to_owned(), device.into());
    }
    RecursiveTransform(remove_null).transform(&mut schema);
    RecursiveTransform(noise_may_be_left_out).transform(&mut schema);
    let mut schema = schema.to_value();
    schema["title"] = "A kalmems experiment".into();
    schema
}

/// The JSON schema of what a type reads, under a title.
pub fn schema_of<T: JsonSchema>(title: &str) -> Value {
    let mut schema = generate::<T>(false);
    schema["title"] = title.into();
    schema
}

fn settings(inline: bool) -> SchemaSettings {
    let mut settings = SchemaSettings::draft2020_12();
    settings.inline_subschemas = inline;
    settings
}

fn generate<T: JsonSchema>(inline: bool) -> Value {
    let mut schema = settings(inline).into_generator().into_root_schema_for::<T>();
    RecursiveTransform(remove_null).transform(&mut schema);
    schema.to_value()
}

/// TOML has no null: an optional key is left out.
fn remove_null(schema: &mut schemars::Schema) {
    if let Some(Value::Array(types)) = schema.get_mut("type") {
        types.retain(|t| t != "null");
        if let [single] = types.as_slice() {
            let single = single.clone();
            schema.insert("type".to_owned(), single);
        }
    }
    if let Some(Value::Array(words)) = schema.get_mut("enum") {
        words.retain(|word| !word.is_null());
    }
    let Some(Value::Array(choices)) = schema.get_mut("anyOf") else { return };
    choices.retain(|choice| choice.get("type").is_none_or(|t| t != "null"));
    if let [Value::Object(single)] = choices.as_slice() {
        let single = single.clone();
        schema.remove("anyOf");
        for (key, value) in single {
            // The description of the field says more than that of its type.
            if schema.get(&key).is_none() {
                schema.insert(key, value);
            }
        }
    }
}

/// The noise of a readout that is left out is found in the recording: no such key is required, although its type has a value.
fn noise_may_be_left_out(schema: &mut schemars::Schema) {
    let is_found = |property: &Value| {
        let choices = property.get("anyOf").and_then(Value::as_array);
        choices.is_some_and(|all| all.iter().any(|one| one["const"] == FROM_RECORDING))
    };
    let found: Vec<String> = match schema.get("properties") {
        Some(Value::Object(all)) => {
            all.iter().filter(|(_, property)| is_found(property)).map(|(name, _)| name.clone()).collect()
        }
        _ => return,
    };
    if let Some(Value::Array(required)) = schema.get_mut("required") {
        required.retain(|name| !found.iter().any(|found| name == found));
    }
}

/// What to write at a key of what `T` reads, with an example from the schema; for a key that must be there. `full` is the way
/// to it from the top of the file.
pub(super) fn remedy<T: JsonSchema>(key: &Key, full: &Key) -> String {
    let schema = generate::<T>(true);
    key.steps().iter().try_fold(&schema, |here, step| below(here, step)).map_or_else(String::new, |here| {
        match example(here) {
            // An entry of a list has no name to write it to.
            Some(example) if key.last().is_empty() => format!("write `{example}`"),
            Some(example) => format!("write `{} = {example}`", key.last()),
            None => format!("add {}", tables(here, &full.header())),
        }
    })
}

fn example(schema: &Value) -> Option<String> {
    if let Some(example) = schema.get("examples").and_then(|examples| examples.get(0)) {
        return toml::Value::try_from(example).ok().map(|example| example.to_string());
    }
    match schema.get("type")?.as_str()? {
        "string" => Some("\"...\"".to_owned()),
        "integer" => Some("1".to_owned()),
        "number" => Some("1.0".to_owned()),
        "boolean" => Some("true".to_owned()),
        // A list of values; one of tables has no example.
        "array" => example(schema.get("items")?).map(|item| format!("[{item}]")),
        _ => None,
    }
}

/// The header of a table, or those of all tables of which there must be one.
fn tables(schema: &Value, key: &Key) -> String {
    if schema.get("type").is_some_and(|t| t == "array") {
        return format!("a table headed `[[{key}]]`, with double brackets");
    }
    // Values by names that the device has.
    if schema.get("additionalProperties").is_some_and(Value::is_object) {
        return format!(
            "the table `[{key}]` with a value for each name, which `kalmems help device NAME` lists with an example"
        );
    }
    let Some(variants) = schema.get("oneOf").and_then(Value::as_array) else {
        return format!("the table `[{key}]`");
    };
    let names = variants.iter().filter_map(|v| v.get("properties")?.as_object()?.keys().next());
    let headers: Vec<String> = names.map(|name| format!("`[{key}.{name}]`")).collect();
    if headers.is_empty() {
        return format!("the table `[{key}]`");
    }
    format!("one of the tables {}", headers.join(", "))
}

/// The schema of what stands one step further down.
fn below<'a>(schema: &'a Value, step: &KeyStep) -> Option<&'a Value> {
    let KeyStep::Name(name) = step else { return schema.get("items") };
    let direct = schema.get("properties").and_then(|properties| properties.get(name));
    let mut variants =
        ["oneOf", "anyOf"].into_iter().filter_map(|word| schema.get(word)?.as_array()).flatten();
    direct
        .or_else(|| variants.find_map(|variant| variant.get("properties")?.get(name)))
        .or_else(|| schema.get("additionalProperties").filter(|inner| inner.is_object()))
}
