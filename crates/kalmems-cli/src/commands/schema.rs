//! `kalmems schema`.

use crate::args::{Described, SchemaArguments};
use crate::{Ending, print};
use kalmems::applications::calibration::GyroscopeCalibration;
use kalmems::applications::image::Image;
use kalmems::applications::spectrum::SpectrumFile;
use kalmems::rigs::Workbench;

pub fn run(workbench: &Workbench, arguments: &SchemaArguments) -> Result<(), Ending> {
    let schema = match arguments.of {
        Described::Experiment => workbench.schema(),
        Described::Gyro => GyroscopeCalibration::schema(),
        Described::Image => Image::schema(),
        Described::Spectrum => SpectrumFile::schema(),
        Described::Study => kalmems::study::schema(),
    };
    let schema = serde_json::to_string_pretty(&schema);
    print(&(schema.map_err(|e| Ending::Wrong(e.to_string()))? + "\n"))
}
