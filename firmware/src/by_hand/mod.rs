//! Filters of the shared-electrode scanner written from the library by hand, beside which the exported one is measured, and samples for all of them.

#[rustfmt::skip]
pub mod scanner;
#[rustfmt::skip]
pub mod scanner_rk4;
#[rustfmt::skip]
pub mod scanner_samples;
