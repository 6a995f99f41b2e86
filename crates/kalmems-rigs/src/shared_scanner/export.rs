//! Which filter can be exported, and what of it.

use super::settings::ScannerSettings;
use crate::config::{Experiment, Method};
use crate::export::{ExportError, ExportableFilter, Integration, ScannerFilter};

/// The filter at this place of the file.
pub fn exported(experiment: &Experiment, place: usize) -> Result<ExportableFilter, ExportError> {
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
    Ok(ExportableFilter::Scanner(ScannerFilter {
        scanner: hardware.scanner,
        readout: hardware.readout,
        noise_variance: hardware.noise_variance,
        acceleration_density: filter.acceleration_density,
        start,
        start_sd: filter.start_sd,
        integration,
    }))
}
