//! From capacitance to a recorded voltage.

mod demodulated;
mod two_axis;

pub use demodulated::DemodulatedComb;
pub use two_axis::TwoAxisComb;
