//! Filters over a few recorded samples: what the target and the host both run.
//!
//! The modules under `generated` are made from the examples by `.ci/firmware generate`, with `kalmems export`.

#![no_std]

#[cfg(target_os = "none")]
pub mod board;
pub mod by_hand;
pub mod generated;
pub mod runs;
#[cfg(target_os = "none")]
pub mod text;
