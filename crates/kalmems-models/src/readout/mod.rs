//! From capacitance to a recorded voltage.

mod angle_before;
mod biased;
mod delayed;
mod demodulated;
mod low_pass;
mod low_passed;
mod two_axis;

pub use angle_before::AngleBefore;
pub use biased::BiasedComb;
pub use delayed::DelayedComb;
pub use demodulated::DemodulatedComb;
pub use low_pass::{LowPassOutput, LowPassPair};
pub use low_passed::LowPassedComb;
pub use two_axis::TwoAxisComb;
