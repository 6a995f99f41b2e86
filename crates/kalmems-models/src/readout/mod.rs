//! From capacitance to a recorded voltage.

mod angle_before;
mod biased;
mod charge_amplifier;
mod current;
mod delayed;
mod demodulated;
mod feedthrough;
mod low_pass;
mod low_passed;
mod two_axis;

pub use angle_before::AngleBefore;
pub use biased::BiasedComb;
pub use charge_amplifier::{ChargeAmplifier, DifferentialReadout};
pub use current::CurrentReadout;
pub use delayed::DelayedComb;
pub use demodulated::DemodulatedComb;
pub use feedthrough::Feedthrough;
pub use low_pass::{LowPassOutput, LowPassPair};
pub use low_passed::LowPassedComb;
pub use two_axis::TwoAxisComb;
