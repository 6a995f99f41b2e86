//! A recording that is computed.

use super::WhiteNoise;
use crate::config::{ConfigError, RecordingRole};
use crate::recording::{ReadError, RecordingSource};
use kalmems_figures::{Figure, number};
use std::ops::ControlFlow;

/// A column of a simulated recording: what it means to the rig, and its name in the file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SimulatedColumn {
    /// Its meaning, such as `signal`.
    pub meaning: &'static str,
    /// Its name with its unit, such as `cap_V`.
    pub column: &'static str,
}

impl SimulatedColumn {
    /// The motion of one axis.
    pub const ANGLE_AND_RATE: [Self; 2] =
        [Self { meaning: "angle", column: "angle_rad" }, Self { meaning: "rate", column: "rate_rad_per_s" }];
    /// The motion of a plate along its axis.
    pub const POSITION_AND_VELOCITY: [Self; 2] = [
        Self { meaning: "position", column: "position_m" },
        Self { meaning: "velocity", column: "velocity_m_per_s" },
    ];
}

/// One sample.
#[derive(Clone, Copy, Debug)]
pub struct SimulatedSample<'a> {
    /// When.
    pub time_s: f64,
    /// What is recorded, in the order of [`Simulation::recorded`].
    pub recorded: &'a [f64],
    /// What is true, in the order of [`Simulation::truth`].
    pub truth: &'a [f64],
}

/// What a run tells beside its samples, such as what a loop commanded.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SimulationFiles {
    /// Files beside the recording.
    pub files: Vec<RunFile>,
    /// Pictures beside it, which are called as the figures are.
    pub figures: Vec<Figure>,
    /// What to say, a line each.
    pub lines: Vec<String>,
}

/// A file of a run.
#[derive(Clone, Debug, PartialEq)]
pub struct RunFile {
    /// Its name.
    pub name: &'static str,
    /// What it holds.
    pub content: Vec<u8>,
}

/// A simulation of one device, ready to run.
pub trait Simulation {
    /// The channels of the recording beside the time.
    fn recorded(&self) -> &[SimulatedColumn];

    /// The channels of the reference beside the time.
    fn truth(&self) -> &[SimulatedColumn];

    /// What the recording would have been taken for.
    fn role(&self) -> RecordingRole {
        RecordingRole::Test
    }

    /// How many samples there will be.
    fn samples(&self) -> u64;

    /// How many steps it takes per second, where these are not as many as the experiment states.
    fn steps_per_s(&self) -> Option<f64> {
        None
    }

    /// Whether its steps are exact, so that shorter ones record the same.
    fn is_exact(&self) -> bool {
        false
    }

    /// Files that it is made from.
    fn sources(&self) -> &[RecordingSource] {
        &[]
    }

    /// What can be said of the device under this drive before it moves, in words.
    fn outlook(&self) -> Option<String> {
        None
    }

    /// What moves the device before the recording begins, as far as that; nothing where its start is stated.
    fn begin(&self) -> Result<SimulationStart, SimulateError> {
        Ok(SimulationStart::default())
    }

    /// Runs it from its start, sample by sample. Every run gives the same.
    fn run(&self, each: &mut dyn FnMut(&SimulatedSample) -> ControlFlow<()>) -> Result<(), SimulateError>;

    /// The same from where [`begin`](Self::begin) has led this simulation, or one that differs from it in steps and noise alone.
    fn run_from(
        &self,
        _: &SimulationStart,
        each: &mut dyn FnMut(&SimulatedSample) -> ControlFlow<()>,
    ) -> Result<(), SimulateError> {
        self.run(each)
    }

    /// What a run tells beside its samples; nothing before it has run.
    fn files(&self) -> SimulationFiles {
        SimulationFiles::default()
    }
}

/// A simulation where its recording begins.
#[derive(Clone, Debug, Default)]
pub struct SimulationStart {
    /// The states.
    pub state: Vec<f64>,
    /// The random numbers of their rates.
    pub noises: Vec<WhiteNoise>,
    /// States and inputs at whole samples before, as many as instruments look back.
    pub past: Vec<[Vec<f64>; 2]>,
}

/// Why there is no simulation.
#[derive(Debug, thiserror::Error)]
pub enum SimulateError {
    /// The experiment file is wrong.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// The recorded drive cannot be read.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// The motion left all bounds.
    #[error(
        "the motion is not finite any more at {} s; raise `simulate.integration_rate`, or check the device",
        number(*time_s)
    )]
    NotFinite {
        /// When.
        time_s: f64,
    },
    /// The motion left the points of a table.
    #[error("after {} s the motion goes where the device is not described: {why}", number(*time_s))]
    NotDescribed {
        /// The last time at which it was described.
        time_s: f64,
        /// What it left.
        why: String,
    },
    /// A mass has gone to a plate, and stays there.
    #[error(
        "{why}: more than spring and loop hold; take a smaller acceleration, a stiffer spring, or a feedback with more \
         gain or bias"
    )]
    PulledIn {
        /// When, and to which plate.
        why: String,
    },
    /// There is no settled filter for what is to observe in a loop.
    #[error("there is no observer for the loop: {why}; act on the output instead")]
    NoObserver {
        /// Why its gain does not settle.
        why: String,
    },
    /// Stopped from outside.
    #[error("interrupted; nothing was written")]
    Interrupted,
}
