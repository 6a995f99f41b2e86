//! What closes a loop around a device, and what can be said of it before it runs.

mod complex;
mod pi;
mod rebalance;
mod sampled;

pub use complex::Complex;
pub use pi::PiController;
pub use rebalance::{Margins, RebalanceLoop};
pub use sampled::{Comparator, STOP, SampledRebalance, Stopped};
