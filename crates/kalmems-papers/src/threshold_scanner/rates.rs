//! How well a crossing is placed against the sampling rate, with three readings of what is swept.

use super::bench::{ThresholdBench, moments};
use super::published::rates as published;
use super::steady::{PassageSearch, angle_errors};
use crate::program::{
    Check, CheckTolerance, Effort, Item, ItemHead, ItemKind, PaperPlace, PartWork, ReproduceError,
    SeedSpread, ValueOrigin,
};
use kalmems_figures::significant;
use kalmems_figures::{Axis, ColumnHead, Figure, Panel, Series, SeriesRole, TextTable};

/// The sweep.
pub static HEAD: ItemHead = ItemHead {
    key: "figure-4-6a",
    title: "variance of the threshold angle against the sampling rate",
    kind: ItemKind::Figure,
    places: &[
        PaperPlace { paper: "T", label: "Figure 5(a)", page: "section V-A" },
        PaperPlace { paper: "D", label: "Figure 4.6(a)", page: "section 4.5.1" },
    ],
    origin: ValueOrigin::Computed,
};

/// In kHz.
const RATES_KHZ: [f64; 9] =
    [published::SWEPT_KHZ[0], 100.0, 200.0, 350.0, 500.0, 800.0, 1250.0, 2500.0, published::SWEPT_KHZ[1]];
/// The rate at which the Gaussian of Table 4.2 has its 15 samples.
const BASE_KHZ: f64 = 500.0;
const SIGMA: f64 = 15.0;

/// What stays while the rate changes.
const READINGS: [&str; 3] =
    ["15 samples, noise per sample", "30 µs, noise per sample", "30 µs, noise per √Hz"];

fn look(reading: usize, khz: f64, noise: f64) -> PassageSearch {
    let ratio = khz / BASE_KHZ;
    PassageSearch {
        interval_s: 1e-3 / khz,
        sigma: if reading == 0 { SIGMA } else { SIGMA * ratio },
        noise: if reading == 2 { noise * ratio.sqrt() } else { noise },
    }
}

/// Sweeps the rate for each reading and each noise.
pub fn run(work: &PartWork) -> Result<Vec<Item>, ReproduceError> {
    let first_seed = work.seed;
    let bench = ThresholdBench::new()?;
    let count = match work.effort {
        Effort::Quick => 150,
        Effort::Full => 2000,
    };
    let noise = bench.device.noise_variance.sqrt();
    let points = READINGS.len() * published::NOISES.len() * RATES_KHZ.len();
    let variances = work.map("sweep of the sampling rate", (points, count as u64), |i, progress| {
        if progress.reached(0).is_break() {
            return None;
        }
        let (reading, rest) = (i / (published::NOISES.len() * RATES_KHZ.len()), i % 27);
        let (factor, khz) = (published::NOISES[rest / RATES_KHZ.len()], RATES_KHZ[rest % RATES_KHZ.len()]);
        let look = look(reading, khz, noise * factor);
        let errors = angle_errors(&bench.device, look, count, first_seed + i as u64).ok()?;
        Some(moments(&errors).1.powi(2))
    })?;
    let of = |reading: usize, factor: usize| {
        let first = (reading * published::NOISES.len() + factor) * RATES_KHZ.len();
        &variances[first..first + RATES_KHZ.len()]
    };
    Ok(vec![item(&of)])
}

/// The place of the least.
fn least(values: &[f64]) -> usize {
    (0..values.len()).min_by(|a, b| values[*a].total_cmp(&values[*b])).unwrap_or(0)
}

fn item<'a>(of: &dyn Fn(usize, usize) -> &'a [f64]) -> Item {
    let last = RATES_KHZ.len() - 1;
    let kept = of(0, 1);
    let best = least(kept);
    let mut table = TextTable::new(
        "Standard deviation of the angle at a detection, at the published noise",
        [
            ColumnHead::number("rate", "kHz"),
            ColumnHead::number(READINGS[0], "mrad"),
            ColumnHead::number(READINGS[1], "mrad"),
            ColumnHead::number(READINGS[2], "mrad"),
        ],
    );
    for (k, khz) in RATES_KHZ.iter().enumerate() {
        let cells = [0, 1, 2].map(|reading| significant(1e3 * of(reading, 1)[k].sqrt()));
        table.push([format!("{khz}")].into_iter().chain(cells));
    }
    let mut figure = Figure::new(
        "figure-4-6a_rates",
        "Variance of the threshold angle against the sampling rate",
        "From above: the Gaussian keeps its 15 samples; it keeps its 30 µs; it keeps its 30 µs and the noise its density. \
         Each with a tenth of the published noise, with it, and with ten times of it.",
    );
    for (reading, words) in READINGS.iter().enumerate() {
        let x = Axis::new("sampling rate", "Hz").log();
        let mut panel = Panel::new(x, Axis::new(*words, "rad^2").log());
        for ((label, role), factor) in [
            ("noise / 10", SeriesRole::Estimate),
            ("published noise", SeriesRole::Model),
            ("10 × noise", SeriesRole::Other),
        ]
        .into_iter()
        .zip(0..)
        {
            let points: Vec<(f64, f64)> =
                RATES_KHZ.iter().zip(of(reading, factor)).map(|(khz, v)| (1e3 * khz, *v)).collect();
            panel =
                panel.with(Series::line(label, role, points.clone())).with(Series::points("", role, points));
        }
        if reading == 0 {
            let all = [0, 1, 2].map(|factor| of(reading, factor)).concat();
            let [low, high] = [f64::min, f64::max].map(|of| all.iter().copied().fold(all[0], of));
            let best_hz = 1e3 * published::BEST_KHZ;
            let line = [(best_hz, low), (best_hz, high)];
            panel = panel.with(Series::line("T Figure 5(a): least at 1.25 MHz", SeriesRole::Bound, line));
        }
        figure = figure.with(if reading > 0 { panel.sharing_x() } else { panel });
    }
    let (scaled, density) = (of(1, 1), of(2, 1));
    Item::new(&HEAD)
        .check(Check::value(
            "best sampling rate, the Gaussian keeping its samples",
            "kHz",
            published::BEST_KHZ,
            SeedSpread::exact(RATES_KHZ[best]),
            CheckTolerance::part(0.2, "the same step of the sweep"),
        ))
        .check(Check::claim(
            "there is a best sampling rate, the Gaussian keeping its samples",
            format!("slower than {} kHz quantisation, faster more noise", published::BEST_KHZ),
            format!(
                "{} mrad at {} kHz, {} at {}, {} at {}",
                significant(1e3 * kept[0].sqrt()),
                RATES_KHZ[0],
                significant(1e3 * kept[best].sqrt()),
                RATES_KHZ[best],
                significant(1e3 * kept[last].sqrt()),
                RATES_KHZ[last]
            ),
            "a variance at least twice the least one at both ends",
            best > 0 && best < last && kept[0] > 2.0 * kept[best] && kept[last] > 2.0 * kept[best],
        ))
        .remark(format!(
            "That is so only because the Gaussian then becomes shorter in time, from 300 µs to 3 µs. Where it keeps its \
             30 µs, faster sampling is never worse: {} mrad at {} kHz and {} at {}. With noise of a constant density, as an \
             amplifier has it, nothing is gained above the rate at which quantisation no longer shows: {} mrad at {} kHz \
             and {} at {}. The papers say that the filter's size kept its ratio to the cycle; w_DOG may have, σ_DOG cannot.",
            significant(1e3 * scaled[4].sqrt()),
            RATES_KHZ[4],
            significant(1e3 * scaled[last].sqrt()),
            RATES_KHZ[last],
            significant(1e3 * density[4].sqrt()),
            RATES_KHZ[4],
            significant(1e3 * density[last].sqrt()),
            RATES_KHZ[last]
        ))
        .remark(
            "The motion is at 624.6 Hz: at the printed 625 Hz all passes fall on the same places between samples, and \
             quantisation would be a bias and no variance.",
        )
        .table(table)
        .figure(figure)
}
