//! Simulation: what a device would do, and what would be recorded of it.
//!
//! [`Simulator`] integrates any device under a [`Drive`]. [`stepped_sweep`] and [`start_up`] say how large a motion
//! becomes and when; [`Stability`] and [`floquet_exponent`] whether it starts at all. A rig makes of an experiment's
//! `[simulate]` table a [`Simulation`], which runs sample by sample.

mod drive;
mod floquet;
mod noise;
mod recording;
mod response;
mod simulator;
mod source;
mod stability;
mod unwritten;

pub use drive::{Drive, Tone};
pub use floquet::floquet_exponent;
pub use noise::WhiteNoise;
pub use recording::{Channel, Sample, SimulateError, Simulation};
pub use response::{StartUp, SweepPoint, SweepSettings, start_up, stepped_sweep};
pub use simulator::Simulator;
pub use source::drive_of;
pub use stability::Stability;
pub use unwritten::Unwritten;
pub(crate) use unwritten::{RECORDING, REFERENCE, described};
