//! `kalmems schema`.

use crate::args::{SchemaArguments, SchemaSubject};
use crate::tell::tell;
use crate::{CommandEnding, print, target};
use kalmems::applications::ApplicationFile;
use kalmems::applications::calibration::GyroscopeCalibration;
use kalmems::applications::image::Image;
use kalmems::applications::spectrum::SpectrumFile;
use kalmems::draft::schema_with_names;
use kalmems::rigs::Workbench;
use std::io::IsTerminal;

pub fn run(workbench: &Workbench, arguments: &SchemaArguments) -> Result<(), CommandEnding> {
    let schema = match arguments.of {
        SchemaSubject::Experiment => schema_with_names(workbench),
        SchemaSubject::Gyro => GyroscopeCalibration::schema(),
        SchemaSubject::Image => Image::schema(),
        SchemaSubject::Spectrum => SpectrumFile::schema(),
        SchemaSubject::Study => kalmems::study::schema(),
    };
    let schema =
        serde_json::to_string_pretty(&schema).map_err(|e| CommandEnding::Wrong(e.to_string()))? + "\n";
    if let Some(path) = &arguments.write {
        target::write_file(path, &schema, arguments.force)?;
        tell!("the schema: {}", path.display());
        return Ok(());
    }
    if std::io::stdout().is_terminal() {
        let why = format!(
            "the schema has {} lines, which are for an editor; write it to a file, such as `--write schema.json`, or pass it on through a pipe",
            schema.lines().count()
        );
        return Err(CommandEnding::Wrong(why));
    }
    print(&schema)
}
