//! How the errors of the threshold angle are distributed.

use super::bench::{ClosedFormDecay, ThresholdBench, estimate, moments};
use super::lilliefors::Lilliefors;
use super::published::TRIALS;
use super::steady::{PassageSearch, angle_errors};
use crate::config::CrossingTiming;
use crate::program::significance::{LEVEL, at_least, p_words};
use crate::program::{
    Check, Effort, Item, ItemHead, ItemKind, PaperPlace, PartWork, ReproduceError, ValueOrigin,
};
use kalmems_figures::significant;
use kalmems_figures::{Axis, ColumnHead, Figure, Panel, Series, SeriesRole, TextTable};
use kalmems_rigs::crossings::Acceptance;
use statrs::distribution::{ContinuousCDF, Normal};

/// In a steady motion.
pub static ONE: ItemHead = ItemHead {
    key: "figure-4-8",
    title: "distribution of the threshold angle's error in a steady motion",
    kind: ItemKind::Figure,
    places: &[PaperPlace { paper: "D", label: "Figure 4.8", page: "section 4.6.1" }],
    origin: ValueOrigin::Computed,
};

/// In the four quarters of a decay.
pub static ALL: ItemHead = ItemHead {
    key: "figure-4-9",
    title: "distribution of the threshold angle's error at four signal-to-noise ratios",
    kind: ItemKind::Figure,
    places: &[
        PaperPlace { paper: "T", label: "Figure 7", page: "section VI-A" },
        PaperPlace { paper: "D", label: "Figure 4.9", page: "section 4.6.1" },
    ],
    origin: ValueOrigin::Measured,
};

/// The sampling rate of D Figure 4.8 in kHz.
const RATE_KHZ: f64 = 2500.0;
/// Detections of D Figure 4.8; how many there were is not said.
const DETECTIONS: usize = 1000;
/// The smallest response that counts, in standard deviations of that to noise.
const DEVIATIONS: f64 = 2.0;
const HEADS: [&str; 4] = ["SNR 83", "SNR 23", "SNR 5", "SNR 1"];

/// How often a test at the level of 5 % refuses a normal distribution.
#[derive(Clone, Copy, Debug)]
struct Refusals {
    refused: usize,
    of: usize,
}

impl Refusals {
    const RULE: &str = "Lilliefors' test at 5 % refuses no more runs than it does of normal errors, by a binomial test at 5 %";

    fn percent(self) -> f64 {
        100.0 * self.refused as f64 / self.of as f64
    }

    /// How probable as many refusals are, the errors being normal.
    fn p_value(self) -> f64 {
        at_least(self.refused, self.of, LEVEL)
    }

    fn can_be_normal(self) -> bool {
        self.p_value() > LEVEL
    }

    fn to_text(self) -> String {
        let Self { refused, of } = self;
        format!("refused in {refused} of {of} runs ({:.0} %), {}", self.percent(), p_words(self.p_value()))
    }
}

/// Tests both.
pub fn run(work: &PartWork) -> Result<Vec<Item>, ReproduceError> {
    let bench = ThresholdBench::new()?;
    Ok(vec![steady(work, &bench)?, decays(work, &bench)?])
}

fn steady(work: &PartWork, bench: &ThresholdBench) -> Result<Item, ReproduceError> {
    let first_seed = work.seed;
    let noise = bench.device.noise_variance.sqrt();
    let batches = match work.effort {
        Effort::Quick => 40,
        Effort::Full => 200,
    };
    // With a Gaussian of 15 samples, and with one of 30 µs.
    let points = (2 * batches, DETECTIONS as u64);
    let errors = work.map("detections in a steady motion", points, |i, progress| {
        if progress.reached(0).is_break() {
            return None;
        }
        let sigma = [15.0, 15.0 * RATE_KHZ / 500.0][i / batches];
        let look = PassageSearch { interval_s: 1e-3 / RATE_KHZ, sigma, noise };
        angle_errors(&bench.device, look, DETECTIONS, first_seed + (i % batches) as u64).ok()
    })?;
    let refused = [0, 1].map(|reading| {
        let mine = &errors[reading * batches..(reading + 1) * batches];
        let refused = mine.iter().filter(|errors| Lilliefors::of(errors).is_none_or(|test| test.refuses()));
        Refusals { refused: refused.count(), of: batches }
    });
    let figure = Figure::new(
        "figure-4-8_quantiles",
        "Errors of the threshold angle and a normal distribution",
        "Each error over the normal quantile of its rank. On the line are errors that are normally distributed.",
    );
    let panels = [("15 samples", 0), ("30 µs", batches)];
    let panels = panels.into_iter().filter_map(|(name, run)| Some(quantiles(name, errors.get(run)?)));
    Ok(Item::new(&ONE)
        .check(Check::claim(
            "the errors are normally distributed, with 15 samples",
            "well modelled by a normal distribution",
            refused[0].to_text(),
            Refusals::RULE,
            refused[0].can_be_normal(),
        ))
        .check(Check::claim(
            "the errors are normally distributed, with 30 µs",
            "well modelled by a normal distribution",
            refused[1].to_text(),
            Refusals::RULE,
            refused[1].can_be_normal(),
        ))
        .remark(format!(
            "{DETECTIONS} detections at {RATE_KHZ} kHz in each run; how many the paper's picture has is not said. Lilliefors' \
             test: the largest distance between the distribution of the errors and the normal one of their mean and variance. \
             Of normal errors it refuses 5 %. With 15 samples, 6 µs at this rate, several maxima compete for each pass."
        ))
        .figure(panels.fold(figure, Figure::with)))
}

/// Errors over normal quantiles, and the line on which they would lie.
fn quantiles(name: &str, errors: &[f64]) -> Panel {
    let (mean, deviation) = moments(errors);
    let mut sorted = errors.to_vec();
    sorted.sort_by(f64::total_cmp);
    let n = sorted.len() as f64;
    let normal = Normal::standard();
    let points: Vec<(f64, f64)> = sorted
        .iter()
        .enumerate()
        .map(|(i, error)| (normal.inverse_cdf((i as f64 + 0.5) / n), *error))
        .collect();
    let ends = points.first().zip(points.last()).map_or([0.0, 0.0], |(first, last)| [first.0, last.0]);
    Panel::new(Axis::new("normal quantile", ""), Axis::new(format!("error, {name}"), "rad"))
        .with(Series::points("detections", SeriesRole::Estimate, points))
        .with(Series::line("normal", SeriesRole::Model, ends.map(|u| (u, mean + deviation * u))))
}

fn decays(work: &PartWork, bench: &ThresholdBench) -> Result<Item, ReproduceError> {
    let first_seed = work.seed;
    let batches = match work.effort {
        Effort::Quick => 40,
        Effort::Full => 200,
    };
    let trials = batches * TRIALS as usize;
    let mut settings = bench.settings_for(bench.device, &[]);
    settings.detector.acceptance = Acceptance::Deviations(DEVIATIONS);
    let noise = bench.device.noise_variance.sqrt();
    let found = work.map("detections in decays", (trials, 40_000), |i, progress| {
        let decay = ClosedFormDecay::of(&bench.device, ClosedFormDecay::phase(i));
        let seed = first_seed + i as u64;
        let (crossings, _) = estimate(&settings, &decay, &decay.recorded(noise, seed), seed, progress)?;
        let times =
            crossings.iter().filter_map(|c| c.at(CrossingTiming::Sample)).map(|instant| instant.time_s);
        Ok(decay.misses(&bench.device, times))
    })?;
    // The errors of some recordings in one quarter.
    let errors = |records: std::ops::Range<usize>, quarter: usize| -> Vec<f64> {
        found[records].iter().flatten().filter(|m| m.quarter == quarter).map(|m| m.angle).collect()
    };
    let mut table = TextTable::new(
        format!("Lilliefors' test at 5 %, in {batches} experiments of {TRIALS} trials, and of all together"),
        [
            ColumnHead::text("quarter"),
            ColumnHead::number("mean", "mrad"),
            ColumnHead::number("standard deviation", "mrad"),
            ColumnHead::number("experiments refused", "%"),
            ColumnHead::number("of all, modified distance", ""),
            ColumnHead::text("of all"),
        ],
    );
    let mut refused = [Refusals { refused: 0, of: batches }; 4];
    let mut figure = Figure::new(
        "figure-4-9_quantiles",
        "Errors of the threshold angle and normal distributions",
        "Each error of all trials over the normal quantile of its rank, in the four quarters of the decay. On the line are \
         errors that are normally distributed.",
    );
    for (quarter, head) in HEADS.into_iter().enumerate() {
        let all = errors(0..trials, quarter);
        let batch = |b: usize| errors(b * TRIALS as usize..(b + 1) * TRIALS as usize, quarter);
        let is_refused = |b: &usize| Lilliefors::of(&batch(*b)).is_none_or(|test| test.refuses());
        refused[quarter].refused = (0..batches).filter(is_refused).count();
        let (mean, deviation) = moments(&all);
        let whole = Lilliefors::of(&all);
        table.push([
            head.to_owned(),
            significant(1e3 * mean),
            significant(1e3 * deviation),
            format!("{:.1}", refused[quarter].percent()),
            whole.map_or("–".to_owned(), |test| significant(test.modified)),
            whole.map_or("–", |test| if test.refuses() { "refused" } else { "not refused" }).to_owned(),
        ]);
        let panel = quantiles(head, &all);
        figure = figure.with(if quarter > 0 { panel.sharing_x() } else { panel });
    }
    let item = HEADS.into_iter().zip(refused).fold(Item::new(&ALL), |item, (head, refused)| {
        item.check(Check::claim(
            format!("the errors are normally distributed at {head}, in experiments of {TRIALS} trials"),
            "well modelled by a normal distribution",
            refused.to_text(),
            Refusals::RULE,
            refused.can_be_normal(),
        ))
    });
    Ok(item
        .remark(
            "Of normal errors 5 % would be refused, so that a single experiment of the paper's size shows a departure of this kind \
             seldom. Where several maxima compete the errors are bounded by the distance over \
             which one is kept; where the decay is steep their mean and variance change within a quarter. With more trials \
             than the paper's ten, any of that shows.",
        )
        .table(table)
        .figure(figure))
}

#[cfg(test)]
mod tests {
    use super::Refusals;

    /// A rate of 25 % at the level of 5 % refuses normality, where there are runs enough to tell.
    #[test]
    fn a_quarter_of_refusals_at_five_percent_refuses_normality() {
        assert!(!Refusals { refused: 10, of: 40 }.can_be_normal());
        assert!(!Refusals { refused: 3, of: 8 }.can_be_normal());
        assert!(Refusals { refused: 2, of: 40 }.can_be_normal());
        let few = Refusals { refused: 1, of: 4 };
        assert!(few.can_be_normal());
        assert_eq!(few.to_text(), "refused in 1 of 4 runs (25 %), p = 0.1855");
    }
}
