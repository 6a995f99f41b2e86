//! The device as each filter knows it: with the low-passes of the readout or without, and without the states that it is given.

use super::known::{KnownDevice, known_states};
use super::own_device::OwnDevice;
use super::table::EquationsTable;
use crate::config::{ConfigError, Estimate, Experiment, FilterTable, Key, Values};
use crate::estimate::refuse_demodulator;
use kalmems_equations::Device;
use std::sync::Arc;

/// The device as filters may know it.
pub(super) struct FilterDevices {
    table: Arc<EquationsTable>,
    own: Arc<OwnDevice>,
    /// The same with the low-passes of its readout, where some filter asks for them and there are some.
    demodulated: Option<(Arc<EquationsTable>, Arc<OwnDevice>)>,
    /// The same with states as inputs, as each filter is given them.
    known: Vec<Option<KnownDevice>>,
}

/// The device as one filter knows it, with the states that it is given as inputs.
pub(super) struct FilterDevice<'a> {
    pub(super) table: &'a EquationsTable,
    pub(super) own: &'a Arc<OwnDevice>,
    pub(super) known: &'a [usize],
}

impl FilterDevices {
    pub(super) fn of(
        experiment: &Experiment,
        estimate: &Estimate,
        (table, own): (Arc<EquationsTable>, &Arc<OwnDevice>),
    ) -> Result<Self, ConfigError> {
        let asked = estimate.filters.iter().any(|filter| filter.demodulator);
        let other = table.demodulator.as_ref().and_then(|own| own.device.clone()).filter(|_| asked);
        let with = |table: Arc<EquationsTable>| {
            Ok((Arc::clone(&table), Arc::new(OwnDevice::of_table(experiment, &table)?)))
        };
        let demodulated = other.map(with).transpose()?;
        let given = |(index, filter): (usize, &FilterTable)| {
            let at = Key::from("estimate").child("filter").index(index);
            let known = known_states((experiment, &at, filter), &own.device)?;
            let of = |known| KnownDevice::of(experiment, (&table, &own.device), known);
            (!known.is_empty()).then(|| of(known)).transpose()
        };
        let known = estimate.filters.iter().enumerate().map(given).collect::<Result<_, _>>()?;
        Ok(Self { table, own: Arc::clone(own), demodulated, known })
    }

    /// Which filters do without the low-passes that the readout has, where some do.
    pub(super) fn left_out(&self, estimate: &Estimate) -> Option<String> {
        self.table.demodulator.as_ref()?.device.as_ref()?;
        let without = estimate.filters.iter().filter(|filter| !filter.demodulator);
        let names: Vec<String> = without.map(|filter| format!("`{}`", filter.name)).collect();
        (!names.is_empty()).then(|| {
            format!(
                "the readout's `poles` are no part of the model of {}; with `demodulator = true` a filter has them",
                names.join(", ")
            )
        })
    }

    /// As the filter at this place knows it.
    pub(super) fn of_filter(
        &self,
        experiment: &Experiment,
        estimate: &Estimate,
        index: usize,
    ) -> Result<FilterDevice<'_>, ConfigError> {
        let filter = &estimate.filters[index];
        let at = || Key::from("estimate").child("filter").index(index);
        let whole = |table, own| FilterDevice { table, own, known: &[] };
        let refused = |why: &str| {
            refuse_demodulator(experiment, (&at(), filter), why).map(|()| whole(&*self.table, &self.own))
        };
        if let Some(Some(KnownDevice { known, table, own })) = self.known.get(index) {
            refuse_demodulator(experiment, (&at(), filter), "with known states there is none")?;
            return Ok(FilterDevice { table, own, known });
        }
        match (&self.demodulated, &self.table.demodulator) {
            (Some(_), _) if filter.method.has_fixed_gain() => refused(
                "the gain for all of a swing is that of angle and rate alone; leave it out, or use `ekf`",
            ),
            (Some((table, own)), _) if filter.demodulator => Ok(whole(table, own)),
            (_, Some(known)) => refused(known.remedy),
            (_, None) => refused("this device has none; write a `lag` in its table"),
        }
    }
}

/// Whether a filter without a stated start begins at the oscillation that the first cycles of the signal show.
pub(super) fn begins_by_swing(table: &EquationsTable, own: &OwnDevice, filter: &FilterTable) -> bool {
    let starts = table.oscillation.as_ref().is_some_and(|oscillation| oscillation.starts);
    starts && own.axes.is_empty() && !(filter.method.claims() && filter.start_sd.is_empty())
}

/// What is said of a demodulator stands for each of its low-passes, the states that lags add.
pub(super) fn of_each_low_pass(device: &Device, values: &Values) -> Values {
    let mut all = values.clone();
    if let Some(value) = all.remove("demodulator") {
        let lags = device.states().iter().skip(device.own_states());
        all.extend(lags.map(|named| (named.name.to_string(), value.clone())));
    }
    all
}
