//! The claim that the filter reaches the bound where nothing drifts.

use super::bench::{PistonRun, RUN, SKIP_S, filters};
use crate::program::{
    Check, Effort, Item, ItemHead, ItemKind, PaperPlace, PartWork, ReproduceError, SeedSpread, ValueOrigin,
};

/// P section IV, at its end.
pub static HEAD: ItemHead = ItemHead {
    key: "static",
    title: "the filter against the bound in a static system",
    kind: ItemKind::Table,
    places: &[PaperPlace { paper: "P", label: "Section IV", page: "its end" }],
    origin: ValueOrigin::Computed,
};

/// What the filter claims without noise, along the true motion, is the bound's recursion.
pub fn run(work: &PartWork) -> Result<Vec<Item>, ReproduceError> {
    let filters = filters(1e-15, true)?;
    let seeds = if work.effort == Effort::Full { 20 } else { 6 };
    let still = PistonRun { drift: 0.0, sampling_hz: 20e3, duration_s: 2.0 * SKIP_S, ..RUN };
    let first = work.seed;
    let rms = work.map("a static system", (seeds, 1), |i, progress| {
        let run = PistonRun { seed: first + i as u64, ..still };
        let judged = run.estimate(&filters, &["five"], progress)?;
        let [filter, _] = judged.as_slice() else { return None };
        let position = filter.trajectory.state("position")?;
        let scored = filter.trajectory.scored(SKIP_S);
        let square = scored.clone().map(|k| position.sd[k].powi(2)).sum::<f64>() / scored.len() as f64;
        Some(filter.rms() / square.sqrt())
    })?;
    let count = rms.len() as f64;
    let pooled = (rms.iter().map(|r| r * r).sum::<f64>() / count).sqrt();
    let spread = SeedSpread::of(rms);
    Ok(vec![
        Item::new(&HEAD)
            .check(Check::claim(
                "an extended filter of a static system attains the bound",
                "it will reach the lower bound",
                format!("its error is {pooled:.2} times the posterior bound, single recordings {}", spread.to_text()),
                "within 20 % over all recordings, two standard errors of as many",
                (0.8..1.2).contains(&pooled),
            ))
            .remark(
                "The bound is the posterior one for the filter's own process noise, along the true motion. That the filter \
                 attains it, with noise in the motion as the filter has it and without any, is tested by `cargo test \
                 --workspace --test models piston::`. Nothing of it is lost by a drift if its rate is a state.",
            ),
    ])
}
