//! From capacitance to a recorded voltage.

mod angle_before;
mod biased;
mod carrier;
mod charge_amplifier;
mod current;
mod delayed;
mod demodulated;
mod feedthrough;
mod first_state;
mod low_pass;
mod low_passed;
mod phasor_capacitance;
mod phasor_detector;
mod plate_current;
mod two_axis;
mod vibrometer;

pub use angle_before::AngleBefore;
pub use biased::BiasedComb;
pub use carrier::CarrierDivider;
pub use charge_amplifier::{ChargeAmplifier, DifferentialReadout};
pub use current::CurrentReadout;
pub use delayed::DelayedComb;
pub use demodulated::DemodulatedComb;
pub use feedthrough::Feedthrough;
pub use low_pass::{LowPassOutput, LowPassPair};
pub use low_passed::LowPassedComb;
pub use phasor_capacitance::{
    AmplifiedPhasorCapacitance, DriftingPhasorCapacitance, SteadyPhasorCapacitance,
};
pub use phasor_detector::PhasorDetector;
pub use plate_current::{DifferentialCurrent, PlateCurrent, PlateCurrents};
pub use two_axis::TwoAxisComb;
pub use vibrometer::EdgeVibrometer;
