//! A simulated recording that is handed on without a file, and how an experiment describes one.

use super::{SimulateError, SimulatedColumn, Simulation};
use crate::config::{Channels, Clock, ColumnChoice, Experiment, Name, Recording, Reference};
use crate::progress::Progress;
use crate::recording::{self, ReadError, RecordingFromRows, RecordingLayout};
use std::collections::BTreeMap;
use std::ops::ControlFlow;

/// The file of what is recorded.
pub const RECORDING: &str = "recording.csv";
/// The file of what is true.
pub const REFERENCE: &str = "reference.csv";
const TIME: &str = "time_s";

/// Samples between two looks at whether to go on.
const PULSE: u64 = 10_000;

/// The samples of a simulation: what a laboratory would have recorded, and apart from it what is true.
///
/// Both become recordings as their files would, see [`RecordingFromRows`].
#[derive(Clone, Debug)]
pub struct ComputedRecording {
    time_s: Vec<f64>,
    recorded: SimulatedColumns,
    truth: SimulatedColumns,
}

#[derive(Clone, Debug)]
struct SimulatedColumns {
    channels: Vec<SimulatedColumn>,
    /// Row after row.
    values: Vec<f64>,
}

impl ComputedRecording {
    /// Runs a simulation.
    pub fn of(simulation: &dyn Simulation, progress: &dyn Progress) -> Result<Self, SimulateError> {
        let columns = |channels: &[SimulatedColumn]| SimulatedColumns {
            channels: channels.to_vec(),
            values: Vec::new(),
        };
        let (mut recorded, mut truth) = (columns(simulation.recorded()), columns(simulation.truth()));
        let mut time_s = Vec::new();
        progress.begin("simulating", simulation.samples());
        simulation.run(&mut |sample| {
            time_s.push(sample.time_s);
            recorded.values.extend(sample.recorded);
            truth.values.extend(sample.truth);
            let done = time_s.len() as u64;
            if done.is_multiple_of(PULSE) { progress.reached(done) } else { ControlFlow::Continue(()) }
        })?;
        Ok(Self { time_s, recorded, truth })
    }

    /// What was recorded, read by a layout.
    pub fn recorded(&self, layout: &RecordingLayout) -> Result<recording::SampledRecording, ReadError> {
        self.recorded.read(RECORDING, &self.time_s, layout)
    }

    /// What was recorded, as columns with their names as files have them; the times come first.
    pub fn recorded_columns(&self) -> Vec<(&'static str, Vec<f64>)> {
        self.recorded.each(&self.time_s)
    }

    /// The true motion, in the same form.
    pub fn true_columns(&self) -> Vec<(&'static str, Vec<f64>)> {
        self.truth.each(&self.time_s)
    }

    /// Changes what was recorded of a channel, by what it means and sample by sample with the times in s, as a disturbance would: all of it at once.
    ///
    /// False where nothing of this meaning is recorded.
    pub fn change_recorded(&mut self, meaning: &str, change: impl FnOnce(&mut [f64], &[f64])) -> bool {
        let SimulatedColumns { channels, values } = &mut self.recorded;
        let Some(place) = channels.iter().position(|channel| channel.meaning == meaning) else {
            return false;
        };
        let mut of_channel: Vec<f64> = values.iter().skip(place).step_by(channels.len()).copied().collect();
        change(&mut of_channel, &self.time_s);
        for (value, changed) in values.iter_mut().skip(place).step_by(channels.len()).zip(of_channel) {
            *value = changed;
        }
        true
    }

    /// What is true, read by a layout; for the evaluation alone.
    pub fn truth(&self, layout: &RecordingLayout) -> Result<recording::SampledRecording, ReadError> {
        self.truth.read(REFERENCE, &self.time_s, layout)
    }
}

impl SimulatedColumns {
    fn each(&self, time_s: &[f64]) -> Vec<(&'static str, Vec<f64>)> {
        let of =
            |place: usize| self.values.iter().skip(place).step_by(self.channels.len()).copied().collect();
        let channels = self.channels.iter().enumerate().map(|(place, channel)| (channel.column, of(place)));
        std::iter::once((TIME, time_s.to_vec())).chain(channels).collect()
    }

    fn read(
        &self,
        name: &str,
        time_s: &[f64],
        layout: &RecordingLayout,
    ) -> Result<recording::SampledRecording, ReadError> {
        let header: Vec<&str> = [TIME].into_iter().chain(self.channels.iter().map(|c| c.column)).collect();
        let mut rows = RecordingFromRows::new(name, &header, layout)?;
        let mut row = Vec::with_capacity(header.len());
        for (time, values) in time_s.iter().zip(self.values.chunks(self.channels.len().max(1))) {
            row.clear();
            row.push(*time);
            row.extend(values);
            rows.push(&row);
        }
        rows.finish()
    }
}

/// The experiment with the simulated recording instead of its own, ready to be estimated.
pub fn described(experiment: &Experiment, simulation: &dyn Simulation) -> Experiment {
    let named = |channels: &[SimulatedColumn]| {
        let names: BTreeMap<String, ColumnChoice> =
            channels.iter().map(|c| (c.meaning.to_owned(), c.column.into())).collect();
        Channels::try_from(names).ok()
    };
    let mut described = experiment.clone();
    // Its estimate shall not take the place of that of the real recording.
    if let Ok(name) = Name::try_from(format!("{}-simulated", experiment.name)) {
        described.name = name;
    }
    described.simulate = None;
    described.recordings = named(simulation.recorded())
        .map(|channels| {
            let reference = named(simulation.truth()).map(|truth| Reference::of(REFERENCE.into(), truth));
            Recording::of(simulation.role(), RECORDING.into(), Clock::column(TIME), channels, reference)
        })
        .into_iter()
        .collect();
    described
}
