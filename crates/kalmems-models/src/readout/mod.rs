//! From capacitance to a recorded voltage.

mod demodulated;

pub use demodulated::DemodulatedComb;
