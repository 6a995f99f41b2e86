//! `kalmems calibrate`.

use crate::args::{CalibrateArguments, CalibrationSubject};
use crate::progress::ProgressDisplay;
use crate::tell::tell;
use crate::{CommandEnding, print_result, target, terminal};
use kalmems::applications::ApplicationFile;
use kalmems::applications::calibration::GyroscopeCalibration;
use kalmems::applications::calibration::{
    CalibrationSummary, calibrate_with_parts, write_calibration, write_refused_calibration,
};
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
    let mut parts = Vec::new();
    let found = calibrate_with_parts(&file, &bar, &mut parts);
    drop(bar);
    let found = match found {
        Ok(found) => found,
        Err(e) if e.is_interruption() => return Err(CommandEnding::Interrupted),
        Err(e) if parts.is_empty() => return Err(wrong(&e)),
        Err(e) => {
            write_refused_calibration(&file, &e, &parts, &output).map_err(|e| wrong(&e))?;
            let page = target::finish(output)?.join("report.html");
            return Err(CommandEnding::Wrong(format!(
                "{e}; open {} for the parts that were found",
                page.display()
            )));
        }
    };
    let info = RunInfo { started, took: clock.elapsed() };
    write_calibration(&found, &output, info).map_err(|e| wrong(&e))?;
    let out = target::finish(output)?;
    let summary = CalibrationSummary::of(&found);
    print_result(arguments.json, &summary, || summary.to_text_within(terminal::columns()))?;
    tell!("results in {}; open {}", out.display(), out.join("report.html").display());
    Ok(())
}
