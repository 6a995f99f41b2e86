//! A device of one's own, in a crate of its own: a comb resonator with a cubic spring, read through one pole. With it the
//! program has every command of `kalmems` for its device as for the published ones:
//!
//!     cargo run -- simulate experiment.toml --out out/simulated
//!     cargo run -- estimate out/simulated/experiment.toml

mod device;
mod model;
mod rig;

use kalmems::rigs::{DrivenRig, published};
use std::process::ExitCode;

fn main() -> ExitCode {
    kalmems_cli::run(&published().clone().with(DrivenRig(rig::CombDevice)))
}
