//! What all rigs share: how a device is described, recorded, simulated, identified, estimated, judged and shown.
//!
//! Data flows one way: `Experiment → Recording → Trajectory → Evaluation → Report`. Nothing here knows which devices
//! there are; a device brings a [`rig::Rig`]. Users take all of it from the crate `kalmems`.

pub mod circuit;
pub mod estimate;
pub mod evaluate;
pub mod export;
pub mod fit;
pub mod identify;
pub mod inspect;
pub mod outlook;
pub mod progress;
pub mod recording;
pub mod rig;
pub mod signal;
pub mod simulate;
pub mod topics;

pub use kalmems_config as config;
pub use kalmems_units as units;
