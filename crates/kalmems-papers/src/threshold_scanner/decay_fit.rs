//! What a free decay says of the mirror and its comb.

use super::bench::{ClosedFormDecay, INTERVAL_S, ThresholdBench};
use super::published::identified as published;
use crate::program::{
    Check, CheckTolerance, Effort, Item, ItemHead, ItemKind, PaperPlace, PartWork, ReproduceError,
    SeedSpread, ValueOrigin,
};
use crate::progress::Silent;
use crate::simulate::WhiteNoise;
use kalmems_figures::{Axis, ColumnHead, Figure, Panel, Series, SeriesRole, TextTable};
use kalmems_models::capacitance::CurveShape;
use kalmems_rigs::threshold_scanner::identification::{DecayRecord as Record, fit_curve, fit_decay, unknown};
use std::f64::consts::TAU;

/// The identification.
pub static HEAD: ItemHead = ItemHead {
    key: "figure-4-5",
    title: "decay, and the capacitance that follows from it",
    kind: ItemKind::Figure,
    places: &[
        PaperPlace { paper: "T", label: "Figure 4", page: "section IV-B" },
        PaperPlace { paper: "D", label: "Figure 4.5", page: "section 4.4.2" },
    ],
    origin: ValueOrigin::Measured,
};

/// Why the identified values agree.
const MADE: &str = "the simulated device was made with it";
/// R_s·V_bias in Ω·V.
const TRANSIMPEDANCE: f64 = 10e6 * 10.0;
/// The noise of the reference as an angle, in rad: 5 mV of a detector of 0.5 mm/V at 32.7 mm.
const REFERENCE_NOISE: f64 = 5e-3 * 0.5e-3 / 32.7e-3;
/// How much later than the motion the reference shows it, in s: 57 samples.
const DELAY: usize = 57;
/// Every so many samples are fitted.
const THINNED: usize = 4;

/// One trial: what was found, in the order of the checks, and the curves of the first.
struct DecayFitTrial {
    found: [f64; 3],
    /// By how much the charge that is added up over time is off at the end, without its mean, and taken back to its peak
    /// at each crossing, in F rms.
    walked: [f64; 2],
    /// The part of the signal's mean square, without the noise, that a Gaussian capacitance explains, in per cent.
    gaussian: f64,
    curve: Vec<(f64, f64)>,
}

/// Identifies some decays.
pub fn run(work: &PartWork) -> Result<Vec<Item>, ReproduceError> {
    let first_seed = work.seed;
    let bench = ThresholdBench::new()?;
    let trials = match work.effort {
        Effort::Quick => 3,
        Effort::Full => 10,
    };
    let results = work.map("identification of decays", (trials, 400_000), |i, progress| {
        if progress.reached(0).is_break() {
            return None;
        }
        trial(&bench, i, first_seed + i as u64)
    })?;
    let spread = |place: usize| SeedSpread::of(results.iter().map(|trial| trial.found[place]));
    let device = bench.device.readout.comb;
    let curve = results.first().map(|trial| trial.curve.clone()).unwrap_or_default();
    let truth: Vec<(f64, f64)> =
        curve.iter().map(|(angle, _)| (*angle, device.capacitance_change(*angle, TRANSIMPEDANCE))).collect();
    let rms = |place: usize| SeedSpread::of(results.iter().map(|trial| 1e15 * trial.walked[place]));
    let mut table = TextTable::new(
        "The charge added up over time, root mean square distance from C(θ(t))",
        [ColumnHead::text("sum"), ColumnHead::text("distance (fF)")],
    );
    table.push(["as D (73) has it".to_owned(), rms(0).to_text()]);
    table.push(["taken back to its peak at each crossing".to_owned(), rms(1).to_text()]);
    let decay = ClosedFormDecay::of(&bench.device, 0.0);
    let figure = Figure::new(
        "figure-4-5_decay",
        "Decay and capacitance",
        "Above, the free decay; below, the capacitance over the angle, by splines through the signal of one decay, and as \
         the simulated device has it.",
    )
    .with(Panel::new(Axis::new("time", "s"), Axis::new("angle", "rad")).with(Series::line(
        "motion",
        SeriesRole::Reference,
        decay.time_s.iter().zip(&decay.states).map(|(t, x)| (*t, x[0])),
    )))
    .with(
        Panel::new(Axis::new("angle", "rad"), Axis::new("C − C(θ_th)", "F"))
            .with(Series::line("device", SeriesRole::Reference, truth))
            .with(Series::points("identified", SeriesRole::Estimate, curve)),
    );
    let gaussian = SeedSpread::of(results.iter().map(|trial| trial.gaussian));
    Ok(vec![
        Item::new(&HEAD)
            .check(Check::value("f_n", "Hz", published::NATURAL_HZ, spread(0), CheckTolerance::digit(0.1)).circular(MADE))
            .check(Check::value("ζ", "", published::DAMPING_RATIO, spread(1), CheckTolerance::digit(1e-4)).circular(MADE))
            .check(Check::value("θ_th", "rad", published::THRESHOLD, spread(2), CheckTolerance::digit(1e-4)).circular(MADE))
            .check(Check::claim(
                "the capacitance can be approximated by a Gaussian",
                "stated, without a number",
                format!("it explains {} % of the signal's mean square", gaussian.to_text()),
                "more than 95 %",
                gaussian.median > 95.0,
            ))
            .remark(
                "The device of this reproduction was made with these three values: that they are found again shows that the \
                 identification is right, and nothing of the hardware. D (74) is a logistic gain, whose capacitance has \
                 straight flanks: a Gaussian is another curve, near it over the angles of the decay.",
            )
            .remark(
                "The added-up charge walks away with the noise and the offset; what makes a curve of it is that the \
                 capacitance returns to its peak at each crossing, which the papers do not mention.",
            )
            .table(table)
            .figure(figure),
    ])
}

fn trial(bench: &ThresholdBench, i: usize, seed: u64) -> Option<DecayFitTrial> {
    let decay = ClosedFormDecay::of(&bench.device, ClosedFormDecay::phase(i));
    let signal = decay.recorded(bench.device.noise_variance.sqrt(), seed);
    let mut noise = WhiteNoise::new(seed, 1);
    let mut late = |k: usize| {
        decay.angle_at(k.saturating_sub(DELAY) as f64 * INTERVAL_S) + REFERENCE_NOISE * noise.sample()
    };
    let angle: Vec<f64> = (0..signal.len()).map(|k| if k < DELAY { f64::NAN } else { late(k) }).collect();
    let thin = |values: &[f64]| values.iter().copied().step_by(THINNED).collect::<Vec<f64>>();
    let (thin_signal, thin_angle) = (thin(&signal), thin(&angle));
    let fitted = |shape: CurveShape| {
        let record = Record {
            interval_s: THINNED as f64 * INTERVAL_S,
            signal: &thin_signal,
            angle: &thin_angle,
            multiple: 1.0,
            shape,
        };
        fit_decay(&record, &Silent).ok()
    };
    let found = fitted(CurveShape::Logistic)?;
    let gaussian = fitted(CurveShape::Gaussian)?;
    let p = &found.fit.parameters;
    let curve = fit_curve(&thin_signal, &found.motion, p[unknown::THRESHOLD], TRANSIMPEDANCE).ok()?;
    Some(DecayFitTrial {
        found: [p[unknown::NATURAL_RATE] / TAU, p[unknown::DAMPING_RATIO], p[unknown::THRESHOLD]],
        walked: walked(bench, &decay, &signal),
        gaussian: explained(gaussian.deviations[0], &decay.clean, bench.device.noise_variance),
        curve: curve.iter().map(|point| (point.angle, point.capacitance[0])).collect(),
    })
}

/// What a fit that leaves this deviation explains of the signal without noise, in per cent of its mean square.
fn explained(left: f64, clean: &[f64], noise_variance: f64) -> f64 {
    let mean_square = clean.iter().map(|volts| volts * volts).sum::<f64>() / clean.len() as f64;
    100.0 * (1.0 - (left * left - noise_variance) / mean_square)
}

/// C(θ(t)) − C(θ_th) as the charge since the first pass, and the same brought back to 0 along a line from pass to pass: how
/// far each is from the truth, root mean square.
fn walked(bench: &ThresholdBench, decay: &ClosedFormDecay, signal: &[f64]) -> [f64; 2] {
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a sample of the recording
    let places: Vec<usize> =
        decay.passes_s.iter().map(|pass_s| (pass_s / INTERVAL_S).round() as usize).collect();
    let comb = bench.device.readout.comb;
    let (mut sums, mut count, mut charge) = ([0.0; 2], 0.0, 0.0);
    for pair in places.windows(2) {
        let [from, to] = [pair[0], pair[1]];
        let before = charge;
        let added: Vec<f64> = (from..to)
            .map(|k| {
                charge -= signal[k] * INTERVAL_S / TRANSIMPEDANCE;
                charge
            })
            .collect();
        for (n, value) in added.iter().enumerate() {
            let truth = comb.capacitance_change(decay.states[from + n + 1][0], TRANSIMPEDANCE);
            let line = before + (charge - before) * (n + 1) as f64 / added.len() as f64;
            sums[0] += (value - truth).powi(2);
            sums[1] += (value - line - truth).powi(2);
            count += 1.0;
        }
    }
    sums.map(|sum| f64::sqrt(sum / count))
}
