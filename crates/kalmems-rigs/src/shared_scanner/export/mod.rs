//! Which filter can be exported, and its source.

mod c;
mod scaled;

use super::settings::ScannerSettings;
use crate::config::{Experiment, Method};
use crate::export::{
    ExpectedAnswer, ExportError, ExportTask, ExportableFilter, FilterSource, SourceLanguage,
};
use crate::source_code::rust_module;
use scaled::{Integration, ScannerFilter};

/// The filter at this place of the file.
pub fn exported(experiment: &Experiment, place: usize) -> Result<ScannerFilter, ExportError> {
    let settings = ScannerSettings::of(experiment)?;
    let (hardware, filter) = (&settings.hardware, &settings.filters[place]);
    let refuse =
        |why: &str| Err(ExportError::Filter { filter: filter.basics.name.clone(), why: why.to_owned() });
    let integration = match filter.basics.method {
        Method::Ekf => Integration::RungeKutta,
        Method::EulerEkf => Integration::Euler,
        _ => return refuse("of a scanner, the methods `ekf` and `euler_ekf` can be exported"),
    };
    if filter.demodulator_sd.is_some()
        || !(filter.basics.tracked.is_empty() && filter.basics.readout.is_empty())
    {
        return refuse("it has other states than angle and rate; leave `demodulator` and `states` out");
    }
    if hardware.delay_s > 0.0 {
        return refuse("the readout has a `delay`, which is not exported");
    }
    let Some(start) = filter.start else {
        return refuse(
            "it starts from the signal; give `start` as values, such as `{ angle = \"0.05 rad\", rate = \"0 rad/s\" }`",
        );
    };
    Ok(ScannerFilter {
        scanner: hardware.scanner,
        readout: hardware.readout,
        noise_variance: hardware.noise_variance,
        acceleration_density: filter.acceleration_density,
        start,
        start_sd: filter.start_sd,
        integration,
    })
}

impl ExportableFilter for ScannerFilter {
    fn source(&self, task: &ExportTask<'_>) -> Result<FilterSource, ExportError> {
        let &ExportTask { prefix, heading, interval_s, update_every, .. } = task;
        let (scaled, every) = (self.scaled(interval_s), update_every.get());
        Ok(match task.target {
            SourceLanguage::Rust => {
                let what = "The filter of a shared-electrode scanner, for a microcontroller.";
                let module = rust_module(what, heading, &scaled.to_rust(self.integration, every));
                FilterSource { files: vec![("filter.rs".to_owned(), module)], expected: None }
            }
            SourceLanguage::C => FilterSource {
                files: c::files((&scaled, self.integration), (interval_s, every), prefix, heading),
                expected: Some(ExpectedAnswer {
                    angle: self.angles(task.samples, interval_s, update_every),
                    use_of_tables: c::use_of_samples(prefix, self.integration),
                }),
            },
        })
    }
}
