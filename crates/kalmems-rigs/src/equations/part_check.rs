//! What a published device knows of recordings that are none of it.

use super::EquationColumns;
use super::absent::require_none;
use super::names::kind_of;
use super::table::EquationsTable;
use crate::config::Experiment;
use crate::estimate::{EstimateError, SignalSegment};
use kalmems_equations::{Device, Named};

/// What refuses a part of a recording that is none of a device as it is described.
pub type PartCheck = fn(&Experiment, &CheckedPart) -> Result<(), EstimateError>;

/// A part of a segment as it is recorded.
pub struct CheckedPart<'a> {
    /// The recording and its segment, for messages.
    pub place: &'a str,
    /// Whether the segment begins with it.
    pub begins: bool,
    /// When, in s.
    pub time_s: &'a [f64],
    /// The usual interval between samples in s.
    pub interval_s: f64,
    /// The columns of the measurements with their samples.
    pub signals: Vec<(&'a str, &'a [f64])>,
    /// The columns of the stated inputs with their samples.
    pub inputs: Vec<(&'a str, &'a [f64])>,
}

impl EquationColumns<'_> {
    /// Refuses an input that acts where there is none, and what a published device's own rule refuses.
    pub fn require_right(
        &self,
        experiment: &Experiment,
        (device, begins): (&Device, bool),
        segment: &SignalSegment,
    ) -> Result<(), EstimateError> {
        require_none(self, segment)?;
        let Some(check) = experiment.device_in_terms_of::<EquationsTable>()?.check else { return Ok(()) };
        let samples = |(named, column): (&Named, &'_ &'_ str)| -> Result<_, EstimateError> {
            Ok(segment.recording.column_of(column, kind_of(named))?.of(segment.segment))
        };
        let mut part = CheckedPart {
            place: &segment.place,
            begins,
            time_s: &segment.time_s,
            interval_s: segment.interval_s,
            signals: Vec::new(),
            inputs: Vec::new(),
        };
        for (measure, column) in &self.measured {
            part.signals.push((column, samples((&device.measures()[*measure], column))?));
        }
        for of in device.inputs().iter().zip(&self.inputs) {
            part.inputs.push((of.1, samples(of)?));
        }
        check(experiment, &part)
    }
}
