//! What `kalmems export` made of the examples.

#[rustfmt::skip]
pub mod scanner;
#[rustfmt::skip]
pub mod scanner_rk4;
#[rustfmt::skip]
pub mod scanner_samples;
#[rustfmt::skip]
pub mod threshold;
#[rustfmt::skip]
pub mod threshold_samples;
