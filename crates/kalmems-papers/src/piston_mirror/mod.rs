//! The table and the figures of the mirror's paper.

mod bench;
mod circuit;
mod drift;
mod published;
mod reached_bound;
mod table;

use crate::program::{Paper, PaperProgram, ProgramPart, ReproduceError};

/// All that is reproduced.
pub const PROGRAM: PaperProgram = PaperProgram {
    title: "Piston mirror",
    papers: &[Paper {
        key: "P",
        citation: "Faller, Zangl: Feasibility Considerations on an Inkjet-Printed Capacitive Position Sensor for \
                   Electrostatically Actuated Resonant MEMS-Mirror Systems, 2017",
    }],
    premises: &[
        "The mirror is that of P section II: 500 Hz, ±0.5 mm about 1 mm, 109.3 fF there. Its capacitance is a \
         parallel plate; the paper's own series for C(d), from field simulations, is not printed. The noise is \
         white, 0.151 aF/√Hz as printed and 0.393 aF/√Hz as the printed circuit has it. Phases are those at the \
         sample: P equations 15 and 18 to 20 take them one sample ahead.",
        "The paper does not print the process noise of its filter. Where a figure depends on it, what is stated is said \
         beside the figure.",
        "Not among these: P Figures 1 to 5, which are drawings, a photograph, a circuit and a flow chart.",
    ],
    parts: &[
        ProgramPart { heads: &[&circuit::HEAD], run: circuit::run },
        ProgramPart { heads: &[&table::HEAD, &table::WANTED], run: table::run },
        ProgramPart {
            heads: &[&drift::SNAPSHOT, &drift::LINE, &drift::RATES, &drift::SAMPLING],
            run: drift::run,
        },
        ProgramPart { heads: &[&reached_bound::HEAD], run: reached_bound::run },
    ],
};

/// Says which item could not be computed.
fn failed(item: &'static str) -> impl Fn(Box<dyn std::error::Error + Send + Sync>) -> ReproduceError {
    move |source| ReproduceError::Item { item, source }
}
