//! Simulation: what a device would do, and what would be recorded of it.
//!
//! [`Simulator`] integrates any device under a [`Drive`]. [`stepped_sweep`] and [`start_up`] say how large a motion
//! becomes and when, [`Balance`] the same of steady motions without integration, [`RegulatedMotion`] how one of them answers
//! to its drive; [`Stability`], [`floquet_exponent`] and
//! [`StabilityMap`] whether it starts at all. A rig makes of an experiment's
//! `[simulate]` table a [`Simulation`], which runs sample by sample.

mod balance;
mod computed_recording;
mod converter;
mod drive;
mod floquet;
mod input;
mod integration;
mod noise;
mod recording;
mod response;
mod simulator;
mod slow_flow;
mod source;
mod stability;
mod stability_map;
mod waveform;

pub use balance::{Balance, SteadyMotion};
pub use computed_recording::ComputedRecording;
pub use computed_recording::{RECORDING, REFERENCE, described};
pub use converter::Converter;
pub use drive::{Drive, Interruptions, Tone, parts_of_all};
pub use floquet::{floquet_exponent, monodromy};
pub use input::{SimulatedInput, captured, input_of};
pub use integration::IntegrationError;
pub use noise::WhiteNoise;
pub use recording::{
    RunFile, SimulateError, SimulatedColumn, SimulatedSample, Simulation, SimulationFiles, SimulationStart,
};
pub use response::{
    SweepHold, SweepPoint, SweepSettings, SweepStartUp, Sweeps, start_up, stepped_sweep, sweeps_both_ways,
};
pub use simulator::Simulator;
pub use slow_flow::{LoopMargins, RegulatedMotion};
pub use source::drive_of;
pub use stability::{Stability, starting_factor};
pub use stability_map::StabilityMap;
pub use waveform::PeriodStep;
