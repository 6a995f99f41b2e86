//! What an estimated motion is for.

pub mod image;
pub mod spectrum;
