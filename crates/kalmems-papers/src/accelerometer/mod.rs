//! The tables and figures of the thesis.

mod bench;
mod digital;
mod noise;
mod parameters;
mod published;
mod responses;
mod structures;
mod tuning;

use crate::program::{Paper, PaperProgram, ProgramPart, ReproduceError};

/// All that is reproduced.
pub const PROGRAM: PaperProgram = PaperProgram {
    title: "Force-rebalance accelerometer",
    papers: &[Paper {
        key: "Z",
        citation: "Zhang: Sensing and Control of MEMS Accelerometers Using Kalman Filter, master's thesis, Cleveland \
                   State University, 2010",
    }],
    premises: &[
        "Everything is simulated, in the thesis and here. The instrument is that of its Tables I and II with the \
         corrections of the book's chapter on the accelerometer; where Table I's relative permittivity of 4 and a gap of \
         air disagree, both are computed.",
        "The thesis feeds its observer the true acceleration. What is computed so is called `told`: it shows what the \
         thesis did, and is no instrument, because an instrument that knew the acceleration would not have to measure it. \
         Beside it stands the honest filter, to which the acceleration is a state.",
        "Neither the sampling rate nor the bandwidth of the readout's noise is stated. Here the output is sampled once \
         per period of the carrier, at 1 MHz, and Table II's R is the variance of such a sample.",
        "Not among these: Figures 1 to 7, 9, 11, 13 to 17, which are photographs and diagrams.",
    ],
    parts: &[
        ProgramPart { heads: &[&parameters::TABLE_I, &parameters::TABLE_II], run: parameters::run },
        ProgramPart { heads: &[&responses::OPEN, &responses::CLOSED], run: responses::run },
        ProgramPart { heads: &[&noise::FIGURE_12, &noise::RATIOS], run: noise::run },
        ProgramPart { heads: &[&structures::TABLE_III, &structures::FIGURES], run: structures::run },
        ProgramPart { heads: &[&tuning::TABLE_IV, &tuning::FIGURES], run: tuning::run },
        ProgramPart { heads: &[&digital::ONE_BIT, &digital::DECIMATION], run: digital::run },
    ],
};

/// Says which item could not be computed.
fn failed(item: &'static str) -> impl Fn(Box<dyn std::error::Error + Send + Sync>) -> ReproduceError {
    move |source| ReproduceError::Item { item, source }
}
