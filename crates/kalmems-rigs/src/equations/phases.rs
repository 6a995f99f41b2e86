//! Amplitude, phase and zero phases to come of a device whose first two states are an angle and its rate, as samples arrive.

use super::course::{EquationSegment, set_nodes};
use super::interpolation::Interpolation;
use super::model::{EquationModel, Interval, StepRoom};
use super::settings::EquationSettings;
use super::table::EquationsTable;
use crate::config::{ConfigError, ConfigFault, Experiment, Key};
use crate::estimate::driven::SegmentDrive;
use crate::estimate::{Filtering, PHASE, PhasePredictor, SideOutputs, StatePropagation, Transition};
use crate::side_outputs::side_outputs;
use crate::signal::Sine;
use kalmems_core::Nodes;
use std::cell::RefCell;

/// What the table `stream` of the file wants of a device, checked.
pub fn wanted(experiment: &Experiment, settings: &EquationSettings) -> Result<SideOutputs, ConfigError> {
    let Some(stream) = &experiment.stream else { return Ok(SideOutputs::default()) };
    let key = match (&stream.trigger, stream.phase) {
        (Some(_), _) => "trigger",
        (None, true) => "phase",
        (None, false) => return Ok(SideOutputs::default()),
    };
    let refused =
        |why: String| Err(experiment.error(Key::from("stream").child(key), ConfigFault::Value { why }));
    let (table, device) = EquationsTable::of(experiment)?;
    let own = &settings.own;
    let first = table.angles.iter().next();
    let places = first.and_then(|(angle, rate)| Some([device.state(angle)?, device.state(rate.trim())?]));
    if places != Some([0, 1]) || settings.sine.is_some() {
        return refused(
            "amplitude and phase are those of an angle: the first two states have to be it and its rate, and `[device.equations.angles]` to \
             name them, such as `angle = \"rate\"`"
                .to_owned(),
        );
    }
    let named = device.quantities().iter().map(|named| &*named.name);
    if let Some(name) = named.into_iter().find(|name| ["amplitude", PHASE].contains(name)) {
        return refused(format!(
            "the quantity `{name}` of the device has the name of what the filter gives; give it another name"
        ));
    }
    let Some(natural_hz) = own.natural_hz() else {
        return refused("a device that does not move by itself has no phase; leave it out".to_owned());
    };
    let filters: Vec<_> = settings.filters.iter().map(|filter| &filter.basics).collect();
    side_outputs(experiment, &filters, (natural_hz, table.least_amplitude))
}

/// What predicts zero phases on a course, and from when on in s.
pub struct PhaseCourse {
    predictor: PhasePredictor,
    from_s: f64,
    /// One step from sample to sample.
    usual: Interval,
}

impl PhaseCourse {
    /// By a predictor from a time in s on, of samples that are so many s apart.
    pub fn new(predictor: PhasePredictor, from_s: f64, interval_s: f64) -> Self {
        Self { predictor, from_s, usual: Interval::of(interval_s) }
    }

    /// What predicts, at the end of the way.
    pub fn into_predictor(self) -> PhasePredictor {
        self.predictor
    }

    /// Tells it what a filter says of sample `k`, and how the state goes on while the inputs follow their sines.
    pub fn take(
        &mut self,
        filter: &dyn Filtering,
        k: usize,
        (model, data, between): (&EquationModel, &EquationSegment<'_>, &[Interpolation]),
    ) {
        let time_s = data.time_s[k];
        if time_s < self.from_s {
            return;
        }
        let sines: Option<Vec<&Sine>> = data.inputs.iter().map(|input| input.continuation(k)).collect();
        // How far the inputs are from what was foreseen, relative to their amplitudes, and what their sines leave.
        let sines = sines.filter(|sines| {
            let (mut strayed, mut residual) = (0.0_f64, 0.0_f64);
            for (input, sine) in data.inputs.iter().zip(sines).take(data.stated_inputs) {
                let off = (input.volts()[k] - sine.at(time_s)) / sine.amplitude;
                if off.is_nan() || off.abs() > strayed.abs() {
                    strayed = off;
                }
                residual = residual.max(sine.residual_rms / sine.amplitude);
            }
            self.predictor.follows(strayed, residual)
        });
        let coming = sines.map(|sines| ContinuedInputs {
            model,
            usual: &self.usual,
            inputs: sines.into_iter().zip(between.iter().copied()).collect(),
            from_s: time_s,
            interval_s: data.samples.interval_s,
            mean: filter.mean(),
            nodes: RefCell::default(),
        });
        filter.predict_phases(&mut self.predictor, time_s, coming.as_ref().map(|coming| coming as _));
    }
}

/// Inputs that go on as sines.
struct ContinuedInputs<'a> {
    model: &'a EquationModel,
    usual: &'a Interval,
    inputs: Vec<(&'a Sine, Interpolation)>,
    from_s: f64,
    interval_s: f64,
    /// The state from which they go on.
    mean: &'a [f64],
    /// Kept, so that none is allocated for each step.
    nodes: RefCell<[Vec<f64>; 3]>,
}

impl StatePropagation for ContinuedInputs<'_> {
    fn step(&self, number: u32, with: &mut dyn FnMut(&dyn Transition)) {
        let at = |step: f64| self.from_s + step * self.interval_s;
        let step = f64::from(number);
        let mut nodes = self.nodes.borrow_mut();
        set_nodes(&mut nodes, self.inputs.iter().copied(), |(sine, between)| {
            between.between_ends(SegmentDrive::nodes_from_sine(sine, at(step), at(step + 1.0)))
        });
        let [start, middle, end] = &*nodes;
        let mut room = StepRoom::default();
        with(&self.model.under(self.usual, Nodes { start, middle, end }, self.mean, &mut room));
    }
}
