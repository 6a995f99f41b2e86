//! The language of equations.

mod bounds;
#[path = "../common/mod.rs"]
mod common;
mod energy;
mod held;
mod hidden_turns;
mod kinks;
mod laws;
mod mistakes;
mod published;
mod symmetry;
mod typeset;
