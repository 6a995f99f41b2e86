//! The tables and figures of the threshold-sensing scanner's papers.
//!
//! T is the journal paper, D chapter 4 of the dissertation before it.

mod bench;
mod decay_fit;
#[cfg(test)]
mod detection_effects;
mod edges;
mod errors_table;
mod identified_comparison;
mod lilliefors;
mod normality;
mod published;
mod rates;
mod snapshot;
mod steady;
mod steepness;
mod temperature;
mod widths;

use crate::program::{Paper, PaperProgram, ProgramPart, ReproduceError};

/// All that is reproduced.
pub const PROGRAM: PaperProgram = PaperProgram {
    title: "Threshold-sensing scanner",
    papers: &[
        Paper {
            key: "T",
            citation: "Chen, Li, Qiu, Wang, Oldham: Improved Extended Kalman Filter Estimation using Threshold Signal \
                       Detection with a MEMS Electrostatic Microscanner, 2019",
        },
        Paper {
            key: "D",
            citation: "Chen: dissertation, University of Michigan, 2018, chapter 4: Threshold Sensing with \
                       Micro-scanner",
        },
    ],
    premises: &[
        "The device swings freely from 0.15 rad for 80 ms, in four quarters with the published signal-to-noise ratios. Its \
         comb is the logistic curve of D (74) with N_g = 2.82 mV s/rad and N_θ = 76 /rad, which are not published: with \
         them, and the published noise, the ratios are the published ones. The reference is the simulated motion itself.",
        "Neither paper says how its model differs from its device. Where published errors are compared, the difference is \
         one of several that lead to them.",
        "Steps are exact. The printed step of Euler takes 0.0039 of a damping ratio of 0.0066 away.",
        "Not among these: photographs, schematics, and D Table 4.1, which is the algorithm, and D Table 4.2, the settings.",
    ],
    parts: &[
        ProgramPart { heads: &[&edges::HEAD], run: edges::run },
        ProgramPart { heads: &[&decay_fit::HEAD], run: decay_fit::run },
        ProgramPart { heads: &[&rates::HEAD], run: rates::run },
        ProgramPart { heads: &[&steepness::VARIANCE, &steepness::CURVES], run: steepness::run },
        ProgramPart { heads: &[&normality::ONE, &normality::ALL], run: normality::run },
        ProgramPart { heads: &[&snapshot::HEAD], run: snapshot::run },
        ProgramPart { heads: &[&widths::VARIANCE, &widths::ERRORS, &widths::LENGTH], run: widths::run },
        ProgramPart {
            heads: &[&errors_table::ERRORS, &errors_table::ORDER, &errors_table::PERFECT],
            run: errors_table::run,
        },
        ProgramPart { heads: &[&temperature::HEAD], run: temperature::run },
        ProgramPart { heads: &[&identified_comparison::HEAD], run: identified_comparison::run },
    ],
};

/// Says which item could not be computed.
fn failed(item: &'static str) -> impl Fn(Box<dyn std::error::Error + Send + Sync>) -> ReproduceError {
    move |source| ReproduceError::Item { item, source }
}
