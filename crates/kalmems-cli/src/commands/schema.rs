//! `kalmems schema`.

use crate::args::{Described, SchemaArguments};
use crate::{Ending, print};
use kalmems::config::{gyroscope_schema, image_schema, schema, spectrum_schema};

pub fn run(arguments: &SchemaArguments) -> Result<(), Ending> {
    let schema = match arguments.of {
        Described::Experiment => schema(),
        Described::Gyro => gyroscope_schema(),
        Described::Image => image_schema(),
        Described::Spectrum => spectrum_schema(),
        Described::Study => kalmems::study::schema(),
    };
    let schema = serde_json::to_string_pretty(&schema);
    print(&(schema.map_err(|e| Ending::Wrong(e.to_string()))? + "\n"))
}
