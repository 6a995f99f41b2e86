//! What `kalmems export` made of the examples.

#[rustfmt::skip]
pub mod threshold;
#[rustfmt::skip]
pub mod threshold_samples;
