//! `kalmems schema`.

use crate::args::{Described, SchemaArguments};
use crate::tell::tell;
use crate::{Ending, print, target};
use kalmems::applications::calibration::GyroscopeCalibration;
use kalmems::applications::image::Image;
use kalmems::applications::spectrum::SpectrumFile;
use kalmems::draft::schema_with_names;
use kalmems::rigs::Workbench;
use std::io::IsTerminal;

pub fn run(workbench: &Workbench, arguments: &SchemaArguments) -> Result<(), Ending> {
    let schema = match arguments.of {
        Described::Experiment => schema_with_names(workbench),
        Described::Gyro => GyroscopeCalibration::schema(),
        Described::Image => Image::schema(),
        Described::Spectrum => SpectrumFile::schema(),
        Described::Study => kalmems::study::schema(),
    };
    let schema = serde_json::to_string_pretty(&schema).map_err(|e| Ending::Wrong(e.to_string()))? + "\n";
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
        return Err(Ending::Wrong(why));
    }
    print(&schema)
}
