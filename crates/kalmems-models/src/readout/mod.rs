//! From capacitance to a recorded voltage.

mod biased;
mod demodulated;
mod low_pass;
mod two_axis;

pub use biased::BiasedComb;
pub use demodulated::DemodulatedComb;
pub use low_pass::{LowPassOutput, LowPassPair};
pub use two_axis::TwoAxisComb;
