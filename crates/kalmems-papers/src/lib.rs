//! The papers of the published systems: their tables and figures, computed again and set beside the papers' own.
//!
//! [`program`] is what all of them share: the items of a paper, the checks that compare it with what was computed, the verdict
//! that follows from them, and the files that are written. Each device has a module with its [`PaperProgram`];
//! [`ALL`] lists them. The devices, their filters and their simulations are those of [`kalmems_rigs`], which knows nothing of
//! this crate.
//!
//! ```
//! use kalmems_papers::program::{Effort, ReproductionSettings, ItemVerdict, reproduce};
//!
//! let program = kalmems_papers::of("shared_scanner").ok_or("no paper of that device")?;
//! let only = Some("Equation 7".to_owned());
//! let settings = ReproductionSettings { only, effort: Effort::Quick, seed: 1, threads: 1 };
//! let found = reproduce("shared_scanner", program, settings, &kalmems_engines::progress::Silent)?;
//! assert_eq!(found.items[0].verdict(), ItemVerdict::Reproduced);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub mod program;

mod accelerometer;
mod micro_stage;
mod piston_mirror;
mod shared_scanner;
mod threshold_scanner;

pub use shared_scanner::misprinted_ukf::{Misprint, MisprintedUkf};
pub use shared_scanner::printed_lines::{PrintedLine, printed_lines};

use kalmems_engines::{
    circuit, config, estimate, evaluate, fit, identify, progress, recording, signal, simulate,
};

use program::PaperProgram;

/// Each device with published tables and figures: its name, as in the device table of an experiment file, and what there is to
/// reproduce.
pub const ALL: &[(&str, &PaperProgram)] = &[
    ("accelerometer", &accelerometer::PROGRAM),
    ("micro_stage", &micro_stage::PROGRAM),
    ("piston_mirror", &piston_mirror::PROGRAM),
    ("shared_scanner", &shared_scanner::PROGRAM),
    ("threshold_scanner", &threshold_scanner::PROGRAM),
];

/// What there is to reproduce of the device of this name; `None` where no paper of it is reproduced.
pub fn of(device: &str) -> Option<&'static PaperProgram> {
    ALL.iter().find(|(name, _)| *name == device).map(|(_, program)| *program)
}
