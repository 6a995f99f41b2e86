//! The tables and figures of the stage's chapter.

mod capacitors;
mod estimates;
mod gyroscope;
mod noise;
mod record_sets;
mod resonance;
mod temperatures;

use crate::program::{Paper, PaperProgram, ProgramPart, ReproduceError};

/// All that is reproduced.
pub const PROGRAM: PaperProgram = PaperProgram {
    title: "Micro-stage",
    papers: &[Paper {
        key: "D",
        citation: "Chen: dissertation, University of Michigan, 2018, chapter 3: In-situ Calibration of MEMS IMUs with an \
                   On-chip Sensing Stage",
    }],
    premises: &[
        "The stage is that of D Tables 3.3, A.1 and A.2, row 2A corrected, with the same gap and gain for all four \
         electrodes. The dissertation states no noise: here a sample of a channel has 4 uV, one of the vibrometer 0.2 mV, \
         one of the drive 0.3 mV, at 625 kHz. Motion and vibrometer are simulated, so that nothing of ours has the errors of \
         their hardware in it.",
        "The gyroscope is an MPU-6500 by its data sheet, at a clock of its own. What a temperature does to the stage is \
         stated nowhere: that it grows the gaps by 0.3 % and the gains by 0.03 % is assumed, and the gyroscope's scale factor \
         is set to the printed one.",
        "Not among these: D Figures 3.3 to 3.10, which are drawings and photographs.",
    ],
    parts: &[
        ProgramPart { heads: &[&resonance::SETTINGS, &resonance::HEAD], run: resonance::run },
        ProgramPart {
            heads: &[&capacitors::PARAMETERS, &capacitors::CRESTS, &capacitors::REJECTION],
            run: capacitors::run,
        },
        ProgramPart { heads: &[&estimates::HEAD], run: estimates::run },
        ProgramPart { heads: &[&gyroscope::HEAD], run: gyroscope::run },
        ProgramPart { heads: &[&temperatures::HEAD, &temperatures::BENCHMARKS], run: temperatures::run },
        ProgramPart { heads: &[&noise::HEAD], run: noise::run },
    ],
};

/// Says which item could not be computed.
fn failed<E: std::error::Error + Send + Sync + 'static>(item: &'static str) -> impl Fn(E) -> ReproduceError {
    move |source| ReproduceError::Item { item, source: Box::new(source) }
}
