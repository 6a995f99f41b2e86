//! Stages of the circuit that makes a voltage of a capacitance.

mod cascade;
mod constant_current;
mod diode;
mod sampled;
mod section;
mod square_law;
mod synchronous;
mod transimpedance;

pub use cascade::{Cascade, SampledCascade};
pub use constant_current::ConstantCurrent;
pub use diode::{DiodeEnvelope, SampledDiode};
pub use sampled::SampledSection;
pub use section::Section;
pub use square_law::SquareLaw;
pub use synchronous::SynchronousDemodulator;
pub use transimpedance::Transimpedance;
