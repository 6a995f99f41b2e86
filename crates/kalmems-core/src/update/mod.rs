//! Which corrections are taken.

mod policy;

pub use policy::{Always, Correction, Gate, OnNeed, Policy};
