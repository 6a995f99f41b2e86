//! The tables and figures of the scanner's two papers.
//!
//! Both report the same device: S is the journal paper, D chapter 5 of the dissertation before it.

mod bench;
mod circuit_figures;
mod estimator_comparison;
mod image_figure;
pub mod misprinted_ukf;
mod parameters;
pub mod printed_lines;
mod published;
mod ring_down;
mod snapshot;
mod sweep;
mod target;

use crate::program::{Paper, PaperProgram, ProgramPart, ReproduceError};

/// All that is reproduced.
pub const PROGRAM: PaperProgram = PaperProgram {
    title: "Shared-electrode scanner",
    papers: &[
        Paper {
            key: "S",
            citation: "Chen, Lee, Birla, Li, Li, Duan, Wang, Oldham: Motion Estimation for a Compact Electrostatic \
                       Micro-scanner via Shared Driving and Sensing Electrodes in Endomicroscopy, 2020",
        },
        Paper {
            key: "D",
            citation: "Chen: dissertation, University of Michigan, 2018, chapter 5: Motion Estimation with Shared \
                       Electrodes for Driving and Sensing",
        },
    ],
    premises: &[
        "The device is that of S Table II. At the printed drive of 0 to 60 V it cannot move (S Table I, below), so \
         that wherever motion is needed here the drive is 90 V + 90 V sin. The recorded signal has the noise of S \
         Table II. The reference is the simulated motion itself: it has no error of an optical sensor in it.",
        "Not among these: S Figures 1, 2 and 6, which are a photograph, a circuit diagram and the set-up.",
    ],
    parts: &[
        ProgramPart { heads: &[&target::SCANNER, &target::SAMPLING], run: target::run },
        ProgramPart { heads: &[&parameters::SETTINGS, &parameters::MOTION], run: parameters::run },
        ProgramPart {
            heads: &[&circuit_figures::AMPLIFIED, &circuit_figures::DEMODULATED],
            run: circuit_figures::run,
        },
        ProgramPart { heads: &[&sweep::HEAD], run: sweep::run },
        ProgramPart { heads: &[&ring_down::HEAD], run: ring_down::run },
        ProgramPart { heads: &[&snapshot::JOURNAL, &snapshot::DISSERTATION], run: snapshot::run },
        ProgramPart {
            heads: &[
                &estimator_comparison::JOURNAL,
                &estimator_comparison::DISSERTATION,
                &estimator_comparison::GAP,
            ],
            run: estimator_comparison::run,
        },
        ProgramPart { heads: &[&image_figure::HEAD], run: image_figure::run },
    ],
};

/// Says which item could not be computed.
fn failed(item: &'static str) -> impl Fn(Box<dyn std::error::Error + Send + Sync>) -> ReproduceError {
    move |source| ReproduceError::Item { item, source }
}
