//! Bytes as the files that an operator writes.

use kalmems_applications::ApplicationFile;
use kalmems_applications::calibration::GyroscopeCalibration;
use kalmems_applications::image::Image;
use kalmems_applications::spectrum::SpectrumFile;
use kalmems_engines::progress::Silent;
use std::path::Path;

/// Reads the text as each kind of description, and makes of an experiment all that is made before a recording is opened.
pub fn read(data: &[u8]) {
    let Ok(text) = std::str::from_utf8(data) else { return };
    let path = Path::new("nowhere/experiment.toml");
    let _ = Image::parse(text, path);
    let _ = SpectrumFile::parse(text, path);
    let _ = GyroscopeCalibration::parse(text, path);
    let Ok(experiment) = kalmems_rigs::published().parse(text, path) else { return };
    let written = experiment.to_toml().expect("what was read can be written");
    let again = kalmems_rigs::published().parse(&written, path).expect("what was written can be read");
    assert_eq!(experiment, again, "the written form says something else");
    let Ok(rig) = kalmems_rigs::published().rig(&experiment) else { return };
    for index in rig.wanted(&experiment).unwrap_or_default() {
        let _ = rig.layout(&experiment, index);
        if let Ok(estimator) = rig.estimator(&experiment, index, &Silent) {
            let _ = estimator.around(1e-6);
        }
    }
    let filters = experiment.estimate.as_ref().map_or(0, |estimate| estimate.filters.len());
    for place in 0..filters.min(4) {
        let _ = rig.exported(&experiment, place);
    }
    let _ = rig.simulate(&experiment);
    // Takes a hundred times as long as all of the above.
    if data.len() % 32 == 0 {
        let _ = rig.outlook(&experiment);
    }
}
