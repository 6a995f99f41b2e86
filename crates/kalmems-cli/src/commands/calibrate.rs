//! `kalmems calibrate`.

use crate::args::{CalibrateArguments, CalibrationSubject};
use crate::progress::ProgressDisplay;
use crate::tell::tell;
use crate::{CommandEnding, print_result, target};
use kalmems::applications::ApplicationFile;
use kalmems::applications::calibration::GyroscopeCalibration;
use kalmems::applications::calibration::calibrate;
use kalmems::applications::calibration::{CalibrationSummary, write_calibration};
use kalmems::results::{RunInfo, Work};
use std::time::{Instant, SystemTime};

pub fn run(arguments: &CalibrateArguments) -> Result<(), CommandEnding> {
    let CalibrationSubject::Gyro(arguments) = &arguments.what;
    let (started, clock) = (SystemTime::now(), Instant::now());
    let wrong = |e: &dyn std::fmt::Display| CommandEnding::Wrong(e.to_string());
    let file = GyroscopeCalibration::load(&arguments.file).map_err(|e| wrong(&e))?;
    let work = Work::of_file("calibrate gyro", &arguments.file, file.files());
    let output = arguments.folder.begin(&["calibrated", &file.name.to_string()], work)?;
    let bar = ProgressDisplay::default();
    let found = calibrate(&file, &bar)
        .map_err(|e| if e.is_interruption() { CommandEnding::Interrupted } else { wrong(&e) })?;
    drop(bar);
    let info = RunInfo { started, took: clock.elapsed() };
    write_calibration(&found, &output, info).map_err(|e| wrong(&e))?;
    let out = target::finish(output)?;
    let summary = CalibrationSummary::of(&found);
    print_result(arguments.json, &summary, || summary.to_text())?;
    tell!("results in {}; open {}", out.display(), out.join("report.html").display());
    Ok(())
}
