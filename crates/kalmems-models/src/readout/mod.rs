//! From capacitance to a recorded voltage.

mod biased;
mod demodulated;
mod low_pass;
mod low_passed;
mod two_axis;

pub use biased::BiasedComb;
pub use demodulated::DemodulatedComb;
pub use low_pass::{LowPassOutput, LowPassPair};
pub use low_passed::LowPassedComb;
pub use two_axis::TwoAxisComb;
