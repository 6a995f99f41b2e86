//! What an input makes of signals beside the motion, where it is added and not taken off: in a simulation, and in the source of a filter.

use super::feedthrough::{BiasOffRecording, InputFeedthrough, counterpart, quotient};
use super::names::kind_of;
use super::own_device::OwnDevice;
use super::table::EquationsTable;
use crate::config::{ConfigFault, Experiment, Recording, RecordingRole};
use crate::estimate::EstimateError;
use crate::progress::Silent;
use crate::simulate::{Drive, SimulateError, SimulatedInput};
use crate::units::Dimension;

/// What an input makes of the signals of a simulation.
pub struct SimulatedFeedthrough {
    input: Drive,
    rate: Drive,
    stated: Vec<Option<[f64; 2]>>,
}

impl SimulatedFeedthrough {
    /// Under these inputs; `None` where nothing is stated.
    pub fn of(
        experiment: &Experiment,
        own: &OwnDevice,
        inputs: &[SimulatedInput],
    ) -> Result<Option<Self>, SimulateError> {
        let Some(InputFeedthrough { input, stated, .. }) =
            own.feedthrough.as_ref().filter(|of| of.is_stated())
        else {
            return Ok(None);
        };
        let drive = &inputs[*input].drive;
        let rate = drive.rate().ok_or_else(|| {
            let why = format!(
                "what `{}` makes of the signals next to the motion depends on its rate, and this drive jumps; take a sine",
                own.device.inputs()[*input].name
            );
            experiment.error("simulate.drive", ConfigFault::Value { why })
        })?;
        Ok(Some(Self { input: drive.clone(), rate, stated: stated.clone() }))
    }

    /// Its share of a measurement at a time in s.
    pub fn share(&self, measure: usize, time_s: f64) -> f64 {
        let stated = self.stated.get(measure).copied().flatten();
        stated.map_or(0.0, |[gain, slope]| gain * self.input.at(time_s) + slope * self.rate.at(time_s))
    }
}

/// An experiment whose device has what its input makes of the signals in its measurements, as one has that is handed single samples: as stated, or the
/// mean over the records with the bias off. `None` where there is nothing of it.
pub fn measured(experiment: &Experiment) -> Result<Option<Experiment>, EstimateError> {
    let (table, device) = EquationsTable::of(experiment)?;
    let Some(InputFeedthrough { input, stated, .. }) = InputFeedthrough::of(experiment, &table, &device)?
    else {
        return Ok(None);
    };
    let mut known = stated;
    for index in 0..experiment.recordings.len() {
        if let Some(off) = counterpart(experiment, index)? {
            known = BiasOffRecording::read(experiment, off, &Silent)?.mean(&device, input)?;
        }
    }
    let mut other = table.without_device();
    other.feedthrough = None;
    let of = &device.inputs()[input];
    for (measure, known) in device.measures().iter().zip(known) {
        let Some(known) = known else { continue };
        let unit = |of_time| quotient(kind_of(measure).dimension, kind_of(of).dimension, of_time).dimension;
        let number = |value: f64, unit: Dimension| {
            if unit == Dimension::NONE { format!("({value:?})") } else { format!("({value:?}[{unit}])") }
        };
        let [gain, slope] = [number(known[0], unit(0)), number(known[1], unit(1))];
        other.measure.change(&measure.name, |text| {
            let (expression, of_text) = text.rsplit_once(" in ").unwrap_or((text, &measure.unit_text));
            format!("{expression} + {gain}*{0} + {slope}*ddt({0}) in {of_text}", of.name)
        });
    }
    let mut told = experiment.clone();
    told.set_device(other);
    // What it carries is in the measurements now.
    let with_bias = |recording: &&mut Recording| recording.role == RecordingRole::BiasOn;
    told.recordings.iter_mut().filter(with_bias).for_each(|one| one.role = RecordingRole::Test);
    Ok(Some(told))
}
