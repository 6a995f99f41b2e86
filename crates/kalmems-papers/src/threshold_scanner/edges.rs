//! A derivative of the signal, and the derivative of its Gaussian average.

use super::bench::{ClosedFormDecay, INTERVAL_S, ThresholdBench, quarter};
use super::failed;
use crate::program::{
    Check, Effort, Item, ItemHead, ItemKind, PaperPlace, PartWork, ReproduceError, ValueOrigin,
};
use kalmems_core::detect::SlopeKernel;
use kalmems_figures::{Axis, ColumnHead, Figure, Panel, Series, SeriesRole, TextTable};

/// The comparison.
pub static HEAD: ItemHead = ItemHead {
    key: "figure-4-2e",
    title: "a derivative operator and a derivative of a Gaussian",
    kind: ItemKind::Figure,
    places: &[
        PaperPlace { paper: "T", label: "Figure 2(e)", page: "section II-B" },
        PaperPlace { paper: "D", label: "Figure 4.2(e)", page: "section 4.2.2" },
    ],
    origin: ValueOrigin::Stated,
};

/// The published Gaussian in samples.
pub const SIGMA: f64 = 15.0;
/// A maximum within so much of the pass, in s, has found it.
const FOUND_S: f64 = 30e-6;
/// The passes are looked for within so many samples.
const WITHIN: usize = 150;
/// What is drawn of the third quarter, in samples.
const SHOWN: std::ops::Range<usize> = 20_100..22_100;

/// The responses to a signal, of both.
fn responses(signal: &[f64]) -> Result<[Vec<f64>; 2], ReproduceError> {
    let wrong = |e: kalmems_core::detect::DetectError| failed(HEAD.title)(e.into());
    // A difference of neighbours: one sample on each side, all of its weight there.
    let (plain, gaussian) =
        (SlopeKernel::<f64, 1>::new(1.0).map_err(wrong)?, SlopeKernel::<f64, 60>::new(SIGMA).map_err(wrong)?);
    let mut all = [vec![0.0; signal.len()], vec![0.0; signal.len()]];
    plain.responses(signal, &mut all[0]);
    gaussian.responses(signal, &mut all[1]);
    Ok(all)
}

/// Finds the passes of some decays by the highest response near each.
pub fn run(work: &PartWork) -> Result<Vec<Item>, ReproduceError> {
    let first_seed = work.seed;
    let bench = ThresholdBench::new()?;
    let noise = bench.device.noise_variance.sqrt();
    let trials = match work.effort {
        Effort::Quick => 4,
        Effort::Full => 40,
    };
    let results = work.map("derivatives of the signal", (trials, 40_000), |i, _| {
        let decay = ClosedFormDecay::of(&bench.device, ClosedFormDecay::phase(i));
        let both = responses(&decay.recorded(noise, first_seed + i as u64)).ok()?;
        // Passes, and those found by each, in the quarters.
        let mut counts = [[0_u32; 3]; 4];
        for pass_s in &decay.passes_s {
            #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a sample of the recording
            let middle = (pass_s / INTERVAL_S).round() as usize;
            let count = &mut counts[quarter(*pass_s)];
            count[0] += 1;
            for (response, found) in both.iter().zip(&mut count[1..]) {
                let window = middle - WITHIN..=middle + WITHIN;
                let highest = window.max_by(|a, b| response[*a].total_cmp(&response[*b]))?;
                *found += u32::from((highest as f64 * INTERVAL_S - pass_s).abs() < FOUND_S);
            }
        }
        Some(counts)
    })?;
    let share = |quarter: usize, by: usize| {
        let sum = |place: usize| results.iter().map(|counts| f64::from(counts[quarter][place])).sum::<f64>();
        100.0 * sum(by) / sum(0)
    };
    let mut table = TextTable::new(
        "Passes whose highest response within 0.3 ms is within 30 µs of them",
        [
            ColumnHead::text("quarter"),
            ColumnHead::number("derivative", "%"),
            ColumnHead::number("derivative of a Gaussian", "%"),
        ],
    );
    for (i, name) in ["SNR 83", "SNR 23", "SNR 5", "SNR 1"].into_iter().enumerate() {
        table.push([name.to_owned(), format!("{:.1}", share(i, 1)), format!("{:.1}", share(i, 2))]);
    }
    let decay = ClosedFormDecay::of(&bench.device, 0.0);
    let signal = decay.recorded(noise, first_seed);
    let both = responses(&signal)?;
    let drawn = |values: &[f64]| -> Vec<(f64, f64)> {
        SHOWN.map(|k| (decay.time_s[k] - decay.time_s[SHOWN.start], values[k])).collect()
    };
    let per_s = |values: &[f64]| values.iter().map(|v| v / INTERVAL_S).collect::<Vec<_>>();
    let time = || Axis::new("time", "s");
    let passes: Vec<(f64, f64)> = decay
        .passes_s
        .iter()
        .map(|pass_s| (pass_s - decay.time_s[SHOWN.start], 0.0))
        .filter(|(t, _)| (0.0..SHOWN.len() as f64 * INTERVAL_S).contains(t))
        .collect();
    let figure = Figure::new(
        "figure-4-2e_operators",
        "Slopes of a noisy signal",
        "Two and a half cycles at a signal-to-noise ratio of 5. Above the signal, in the middle its differences from sample \
         to sample, below the derivative of its Gaussian average. Points: the threshold is passed.",
    )
    .with(Panel::new(time(), Axis::new("signal", "V")).with(Series::line("signal", SeriesRole::Measured, drawn(&signal))))
    .with(
        Panel::new(time(), Axis::new("derivative", "V/s"))
            .with(Series::line("derivative", SeriesRole::Model, drawn(&per_s(&both[0]))))
            .sharing_x(),
    )
    .with(
        Panel::new(time(), Axis::new("of a Gaussian", "V/s"))
            .with(Series::line("derivative of a Gaussian", SeriesRole::Estimate, drawn(&per_s(&both[1]))))
            .with(Series::points("passes", SeriesRole::Reference, passes))
            .sharing_x(),
    );
    let [plain, gaussian] = [1, 2].map(|by| (0..3).map(|i| share(i, by)).fold(f64::INFINITY, f64::min));
    Ok(vec![
        Item::new(&HEAD)
            .check(Check::claim(
                "a derivative does not find the crossings, a derivative of a Gaussian does",
                "drawn",
                format!("{plain:.0} and {gaussian:.0} % found in the worst of the first three quarters"),
                "more than 60 % found, and less than half of that by the derivative",
                gaussian > 60.0 && plain < 0.5 * gaussian,
            ))
            .table(table)
            .figure(figure),
    ])
}
