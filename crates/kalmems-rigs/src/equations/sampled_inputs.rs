//! The inputs of a device over the rows of a part of a recording.

use super::EquationColumns;
use super::axes::{AxisSines, InputRows};
use super::course::peak_after;
use super::names;
use super::own_device::OwnDevice;
use super::settings::EquationSettings;
use crate::estimate::driven::{DrivePast, InterpolationLag, SegmentDrive};
use crate::estimate::{EstimateError, Past, SampleSelection, SegmentPart, SignalSegment};
use crate::progress::{Interruption, Progress, Silent};
use crate::recording::SampledRecording;
use crate::signal::SLOPE_REACH;
use kalmems_equations::Device;

/// The rows before and behind the new ones that the rates of inputs and the polynomial through six of them ask for.
pub(super) const fn rows_for_rates(lag: InterpolationLag) -> (usize, usize) {
    let (before, after) = lag.rows_around();
    (before + SLOPE_REACH, after + SLOPE_REACH)
}

/// The rates of those inputs whose rates the equations need, at each sample.
pub fn rates_of_inputs(device: &Device, inputs: &[SegmentDrive<'_>], interval_s: f64) -> Vec<Vec<f64>> {
    device
        .rated_inputs()
        .iter()
        .filter_map(|input| inputs.get(*input))
        .map(|input| input.rates(interval_s))
        .collect()
}

/// The inputs over the rows of a part.
pub(super) struct SampledInputs<'a, 'b> {
    pub(super) segment: &'a SignalSegment<'a>,
    pub(super) samples: &'b SampleSelection,
    pub(super) past: &'b mut Past,
    /// Whether it is asked how they go on.
    pub(super) foresees: bool,
    pub(super) progress: &'b dyn Progress,
}

impl<'a> SampledInputs<'a, '_> {
    /// One with these samples, of the column that a message names.
    fn of(
        &mut self,
        (index, column): (usize, &str),
        foresees: bool,
        drive: impl FnOnce(&mut DrivePast, &Interruption) -> SegmentDrive<'a>,
    ) -> Result<SegmentDrive<'a>, EstimateError> {
        let kept = self.past.input(index);
        kept.foresees |= foresees || self.foresees;
        let stop = Interruption::by(self.progress);
        let drive = drive(kept, &stop);
        if stop.is_requested() {
            return Err(EstimateError::Interrupted);
        }
        let Some((first_s, count)) = drive.unknown() else { return Ok(drive) };
        let (place, column) = (self.segment.place.clone(), column.to_owned());
        Err(EstimateError::DriveUnknown { place, column, count, first_s })
    }

    /// Those that the recording has.
    pub(super) fn stated(
        &mut self,
        own: &OwnDevice,
        columns: &EquationColumns,
    ) -> Result<Vec<SegmentDrive<'a>>, EstimateError> {
        let mut all = Vec::new();
        for (index, (column, named)) in columns.inputs.iter().zip(own.device.inputs()).enumerate() {
            let values = self.segment.recording.column_of(column, names::kind_of(named))?;
            let foresees = own.between[index].needs_sine() || own.device.rated_inputs().contains(&index);
            let (SignalSegment { time_s, segment, .. }, samples) = (self.segment, self.samples);
            let of = (values, *segment);
            all.push(self.of((index, column), foresees, |kept, stop| {
                SegmentDrive::of_column(of, time_s, samples, kept, stop)
            })?);
        }
        Ok(all)
    }

    /// Those of states that filters are given, by their places, behind so many inputs.
    pub(super) fn known(
        &mut self,
        (own, first): (&OwnDevice, usize),
        columns: &EquationColumns,
    ) -> Result<Vec<(usize, SegmentDrive<'a>)>, EstimateError> {
        let mut all = Vec::new();
        for (index, (state, column)) in columns.known.iter().enumerate() {
            let values =
                self.segment.recording.column_of(column, names::kind_of(&own.device.states()[*state]))?;
            let (SignalSegment { time_s, segment, .. }, samples) = (self.segment, self.samples);
            let drive = self.of((first + index, column), false, |kept, stop| {
                SegmentDrive::of_column((values, *segment), time_s, samples, kept, stop)
            })?;
            all.push((*state, drive));
        }
        Ok(all)
    }

    /// The rates of some behind them.
    pub(super) fn add_rates(
        &mut self,
        inputs: &mut Vec<SegmentDrive<'a>>,
        (device, rates): (&Device, &'a [Vec<f64>]),
        columns: &EquationColumns,
    ) -> Result<(), EstimateError> {
        for (rates, of) in rates.iter().zip(device.rated_inputs()) {
            let column = format!("the rate of {}", columns.inputs[*of]);
            let (time_s, samples) = (&self.segment.time_s, self.samples);
            inputs.push(self.of((inputs.len(), &column), false, |kept, stop| {
                SegmentDrive::of(time_s, rates, samples, kept, stop)
            })?);
        }
        Ok(())
    }
}

/// The time in s of the first peak of each angle's drive after the settling time, in a recording's first segment.
pub fn first_drive_peaks(
    settings: &EquationSettings,
    columns: &EquationColumns,
    recording: &SampledRecording,
) -> Result<Vec<f64>, EstimateError> {
    let (own, device) = (&settings.own, &settings.own.device);
    let Some((first, (measure, column))) = recording.segments().first().zip(columns.measured.first()) else {
        return Ok(Vec::new());
    };
    let (part, mut past) = (SegmentPart::whole(recording, first), Past::default());
    let kind = names::kind_of(&device.measures()[*measure]);
    let segment = SignalSegment::of(&part, (column, kind), settings.skip_s, &mut past)?;
    let samples = segment.samples();
    let mut sampled = SampledInputs {
        segment: &segment,
        samples: &samples,
        past: &mut past,
        foresees: false,
        progress: &Silent,
    };
    let inputs = sampled.stated(own, columns)?;
    let start_s = segment.start_s + settings.skip_s;
    if own.axes.is_empty() {
        return Ok(vec![peak_after(&inputs, start_s)]);
    }
    let rows = InputRows { inputs: &inputs, interval_s: segment.interval_s };
    let sines = AxisSines::first(own, rows, start_s);
    Ok(sines.map_or_else(Vec::new, |sines| sines.sines.map(|sine| sine.peak_after(start_s)).into()))
}
