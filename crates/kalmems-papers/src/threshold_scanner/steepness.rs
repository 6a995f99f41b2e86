//! Steeper and flatter combs.

use super::bench::{AMPLITUDE, INTERVAL_S, ThresholdBench, moments};
use super::published::{STEEPNESS_FACTORS, rates::NOISES};
use super::steady::{PassageSearch, angle_errors};
use crate::program::{
    Check, Effort, Item, ItemHead, ItemKind, PaperPlace, PartWork, ReproduceError, ValueOrigin,
};
use kalmems_figures::significant;
use kalmems_figures::{Axis, ColumnHead, Figure, Panel, Series, SeriesRole, TextTable};
use kalmems_models::capacitance::CombCurve;

/// What steepness is worth.
pub static VARIANCE: ItemHead = ItemHead {
    key: "figure-4-6b",
    title: "variance of the threshold angle against the steepness of the comb",
    kind: ItemKind::Figure,
    places: &[
        PaperPlace { paper: "T", label: "Figure 5(b)", page: "section V-B" },
        PaperPlace { paper: "D", label: "Figure 4.6(b)", page: "section 4.5.2" },
    ],
    origin: ValueOrigin::Computed,
};

/// The curves.
pub static CURVES: ItemHead = ItemHead {
    key: "figure-4-7",
    title: "capacitance and gain over the angle for several steepnesses",
    kind: ItemKind::Figure,
    places: &[
        PaperPlace { paper: "T", label: "Figure 6", page: "section V-B" },
        PaperPlace { paper: "D", label: "Figure 4.7", page: "section 4.5.2" },
    ],
    origin: ValueOrigin::Computed,
};

const FACTORS: [f64; 7] = [STEEPNESS_FACTORS[0], 0.35, 0.6, 1.0, 1.7, 3.0, STEEPNESS_FACTORS[1]];
/// Of these the curves that are drawn.
const DRAWN: [f64; 3] = [STEEPNESS_FACTORS[0], 1.0, STEEPNESS_FACTORS[1]];

/// Sweeps N_θ.
pub fn run(work: &PartWork) -> Result<Vec<Item>, ReproduceError> {
    let first_seed = work.seed;
    let bench = ThresholdBench::new()?;
    let count = match work.effort {
        Effort::Quick => 400,
        Effort::Full => 4000,
    };
    let noise = bench.device.noise_variance.sqrt();
    let points = (NOISES.len() * FACTORS.len(), count as u64);
    let variances = work.map("sweep of the steepness", points, |i, progress| {
        if progress.reached(0).is_break() {
            return None;
        }
        let mut device = bench.device;
        device.readout.comb.steepness *= FACTORS[i % FACTORS.len()];
        let noise = noise * NOISES[i / FACTORS.len()];
        let look = PassageSearch { interval_s: INTERVAL_S, sigma: super::edges::SIGMA, noise };
        let errors = angle_errors(&device, look, count, first_seed + i as u64).ok()?;
        Some(moments(&errors).1.powi(2))
    })?;
    Ok(vec![variance(&bench, &variances), curves(&bench)])
}

fn variance(bench: &ThresholdBench, variances: &[f64]) -> Item {
    let of = |noise: usize| &variances[noise * FACTORS.len()..(noise + 1) * FACTORS.len()];
    let base = bench.device.readout.comb.steepest();
    let mut table = TextTable::new(
        "Standard deviation of the angle at a detection",
        [
            ColumnHead::number("N_θ over the baseline", ""),
            ColumnHead::number("noise / 10", "mrad"),
            ColumnHead::number("published noise", "mrad"),
            ColumnHead::number("10 × noise", "mrad"),
        ],
    );
    for (k, factor) in FACTORS.iter().enumerate() {
        let cells = [0, 1, 2].map(|noise| significant(1e3 * of(noise)[k].sqrt()));
        table.push([format!("{factor}")].into_iter().chain(cells));
    }
    let slope = Axis::new("largest slope of the gain", "V s/rad^2").log();
    let mut panel = Panel::new(slope, Axis::new("variance of the angle", "rad^2").log());
    let roles = [SeriesRole::Estimate, SeriesRole::Model, SeriesRole::Other];
    for ((label, role), noise) in
        ["noise / 10", "published noise", "10 × noise"].into_iter().zip(roles).zip(0..)
    {
        let points: Vec<(f64, f64)> = FACTORS.iter().zip(of(noise)).map(|(f, v)| (f * base, *v)).collect();
        panel = panel.with(Series::line(label, role, points.clone())).with(Series::points("", role, points));
    }
    let falls =
        (0..NOISES.len()).map(|noise| of(noise)[0] / of(noise)[FACTORS.len() - 1]).collect::<Vec<_>>();
    let all = |holds: &dyn Fn(&[f64]) -> bool| (0..NOISES.len()).all(|noise| holds(of(noise)));
    Item::new(&VARIANCE)
        .check(Check::claim(
            "a steeper comb has less variance, at every noise",
            "decreases as the slope increases",
            format!(
                "{} times less from one end to the other, by the three noises",
                falls.iter().map(|fall| significant(*fall)).collect::<Vec<_>>().join(", ")
            ),
            "less than half from end to end, and no step up by more than 20 %, two standard errors",
            all(&|v| v[0] > 2.0 * v[FACTORS.len() - 1] && v.windows(2).all(|two| two[1] < 1.2 * two[0])),
        ))
        .remark(
            "The fall is not the same at all three: at a tenth of the noise quantisation to the sample is what is left, at \
             ten times of it the flattest combs are lost in the noise, where the error has no room to grow.",
        )
        .table(table)
        .figure(
            Figure::new(
                "figure-4-6b_steepness",
                "Variance of the threshold angle against the slope of the gain",
                "N_θ from 0.2 to 5 times the baseline; N_g is the same.",
            )
            .with(panel),
        )
}

fn curves(bench: &ThresholdBench) -> Item {
    let transimpedance = 10e6 * 10.0;
    let device = bench.device.readout.comb;
    let at = |factor: f64| CombCurve { steepness: device.steepness * factor, ..device };
    let angles: Vec<f64> = (-150..=150).map(|k| AMPLITUDE * f64::from(k) / 150.0).collect();
    let change = |comb: &CombCurve<f64>, angle: f64| comb.capacitance_change(angle, transimpedance);
    // Where the capacitance has lost half of what it loses to 0.15 rad.
    let half_width = |comb: &CombCurve<f64>| {
        let whole = change(comb, AMPLITUDE);
        let near = angles.iter().filter(|a| **a > comb.centre).find(|a| change(comb, **a) < 0.5 * whole);
        near.map_or(f64::NAN, |angle| angle - comb.centre)
    };
    // By differences of the curve, not by its formula.
    let step = 1e-6;
    let slope = |comb: &CombCurve<f64>| {
        (comb.sensitivity(comb.centre + step) - comb.sensitivity(comb.centre - step)) / (2.0 * step)
    };
    let mut table = TextTable::new(
        "The curves",
        [
            ColumnHead::number("N_θ over the baseline", ""),
            ColumnHead::number("slope of the gain", "V s/rad^2"),
            ColumnHead::number("half width of the capacitance's peak", "mrad"),
        ],
    );
    for factor in FACTORS {
        let comb = at(factor);
        table.push([format!("{factor}"), significant(slope(&comb)), significant(1e3 * half_width(&comb))]);
    }
    let mut capacitance = Panel::new(Axis::new("angle", "rad"), Axis::new("C − C(θ_th)", "F"));
    let mut gain = Panel::new(Axis::new("angle", "rad"), Axis::new("gain", "V s/rad"));
    for (factor, role) in DRAWN.into_iter().zip([SeriesRole::Estimate, SeriesRole::Model, SeriesRole::Other])
    {
        let comb = at(factor);
        let label = format!("{factor} N_θ");
        capacitance =
            capacitance.with(Series::line(&label, role, angles.iter().map(|a| (*a, change(&comb, *a)))));
        gain = gain.with(Series::line(&label, role, angles.iter().map(|a| (*a, comb.sensitivity(*a)))));
    }
    let rising =
        |of: &dyn Fn(&CombCurve<f64>) -> f64| FACTORS.windows(2).all(|two| of(&at(two[1])) > of(&at(two[0])));
    let [flat, steep] = STEEPNESS_FACTORS.map(at);
    Item::new(&CURVES)
        .check(Check::claim(
            "the capacitance becomes sharper as N_θ increases",
            "shown",
            format!(
                "half width {} mrad at 0.2 and {} at 5",
                significant(1e3 * half_width(&flat)),
                significant(1e3 * half_width(&steep))
            ),
            "narrower from each steepness to the next",
            rising(&|comb| -half_width(comb)),
        ))
        .check(Check::claim(
            "the gain becomes steeper as N_θ increases",
            "shown",
            format!("{} V s/rad² at 0.2 and {} at 5", significant(slope(&flat)), significant(slope(&steep))),
            "steeper from each to the next",
            rising(&slope),
        ))
        .table(table)
        .figure(
            Figure::new(
                "figure-4-7_curves",
                "Capacitance and gain for several steepnesses",
                "D (75) with the limit θ, and D (74) with the argument θ − θ_th.",
            )
            .with(capacitance)
            .with(gain.sharing_x()),
        )
}
