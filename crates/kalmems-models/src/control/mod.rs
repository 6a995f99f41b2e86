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
pub use oscillator::{Oscillator, StateStep, StepsAhead};
pub use phase::MotionPhase;
pub use pi::PiController;
pub use rebalance::{Margins, RebalanceLoop};
pub use regulator::{DriveCommand, Limits, Regulator, RegulatorSettings, RegulatorStage, StartUp, Tolerance};
pub use sampled::{Comparator, LoopStop, STOP, SampledRebalance};
pub use trigger::{Mark, MarkCrossing, NoCrossing, Trigger, TriggerEvent, TriggerSettings, UnusableTrigger};
