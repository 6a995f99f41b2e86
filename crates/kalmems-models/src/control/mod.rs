//! What closes a loop around a device, and what can be said of it before it runs.

mod complex;
mod oscillator;
mod phase;
mod pi;
mod rebalance;
mod regulator;
mod sampled;
mod trigger;

pub use complex::Complex;
pub use oscillator::{Ahead, Onward, Oscillator};
pub use phase::MotionPhase;
pub use pi::PiController;
pub use rebalance::{Margins, RebalanceLoop};
pub use regulator::{Command, Limits, Regulator, RegulatorSettings, Stage, StartUp, Tolerance};
pub use sampled::{Comparator, STOP, SampledRebalance, Stopped};
pub use trigger::{Crossing, Mark, NoCrossing, Trigger, TriggerEvent, TriggerSettings, UnusableTrigger};
