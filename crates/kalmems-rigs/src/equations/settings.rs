//! From an experiment file to SI.

use super::events::{self, EventSettings};
use super::filter_devices::FilterDevices;
use super::filter_settings::EquationFilterSettings;
use super::first_peak::AngleSign;
use super::own_device::OwnDevice;
use super::sine::QuantitySine;
use super::table::EquationsTable;
use crate::config::{ConfigError, ConfigFault, Estimate, Experiment, FilterStart, FilterTable, Key};
use std::sync::Arc;

/// What the file says of the filters.
pub struct EquationSettings {
    /// The device.
    pub own: Arc<OwnDevice>,
    /// How long the filters have to settle, in s.
    pub skip_s: f64,
    /// The signs that the file states because no signal tells them.
    pub signs: Vec<AngleSign>,
    /// The sine that its motion is, where its table says so.
    pub sine: Option<QuantitySine>,
    /// The events whose times are looked for.
    pub events: Vec<EventSettings>,
    /// The filters.
    pub filters: Vec<EquationFilterSettings>,
    /// What is said of filters that do without something that the file states.
    pub remarks: Vec<String>,
}

impl EquationSettings {
    /// Reads and checks them.
    pub fn of(experiment: &Experiment) -> Result<Self, ConfigError> {
        let own = Arc::new(OwnDevice::of(experiment)?);
        let Some(estimate) = &experiment.estimate else {
            let remedy = "add the table `[estimate]` with `skip` and at least one `[[estimate.filter]]`";
            return Err(experiment.error("estimate", ConfigFault::MissingKey { remedy: remedy.to_owned() }));
        };
        let events = events::events(experiment, &own)?;
        if own.device.has_resets() && !events.is_empty() {
            let why = "the time of an event is followed back along the motion, which states that are set at once (`when`) interrupt; leave \
                       the events or the resets out"
                .to_owned();
            return Err(experiment.error("estimate.events", ConfigFault::Value { why }));
        }
        let (table, _) = EquationsTable::of(experiment)?;
        let signs = AngleSign::stated(experiment, estimate, (&own, &table))?;
        let sine = QuantitySine::of(&own, &table).map_err(|(key, why)| {
            experiment.error(Key::from("device.equations.sine").child(key), ConfigFault::Value { why })
        })?;
        let unused = unused_deviations(&table, estimate);
        let known = FilterDevices::of(experiment, estimate, (table, &own))?;
        let of = |index| {
            let device = known.of_filter(experiment, estimate, index)?;
            EquationFilterSettings::of(experiment, estimate, (&device, &events, sine.as_ref()), index)
        };
        let filters = (0..estimate.filters.len()).map(of).collect::<Result<_, _>>()?;
        let remarks = known.left_out(estimate).into_iter().chain(unused).collect();
        Ok(Self { skip_s: estimate.skip.si(), signs, sine, events, filters, remarks, own })
    }
}

/// Which filters state standard deviations of a start that the signal tells with its own, where some do.
fn unused_deviations(table: &EquationsTable, estimate: &Estimate) -> Option<String> {
    let starts_by_swing = table.oscillation.as_ref().is_some_and(|oscillation| oscillation.starts);
    let unused = |filter: &&FilterTable| {
        let from_signal = !matches!(filter.start, Some(FilterStart::Values(_)));
        table.start_tells_itself && !starts_by_swing && from_signal && !filter.start_sd.is_empty()
    };
    let names: Vec<String> =
        estimate.filters.iter().filter(unused).map(|filter| format!("`{}`", filter.name)).collect();
    (!names.is_empty()).then(|| {
        format!(
            "the `start_sd` of {} is not used: a start from the signal brings its own standard deviations; leave it out",
            names.join(", ")
        )
    })
}
