//! One decay over time, and four passes of it closely.

use super::bench::{ClosedFormDecay, INTERVAL_S, ThresholdBench, angles, estimate, quarter};
use super::edges::SIGMA;
use super::errors_table::{PRINTED, PUBLISHED_LEVEL};
use super::failed;
use crate::config::CrossingTiming;
use crate::program::significance::SignTest;
use crate::program::{
    Check, Effort, Item, ItemHead, ItemKind, PaperPlace, PartWork, ReproduceError, ValueOrigin,
};
use kalmems_core::detect::SlopeKernel;
use kalmems_figures::significant;
use kalmems_figures::{Axis, Figure, Panel, Series, SeriesRole};

/// The pictures.
pub static HEAD: ItemHead = ItemHead {
    key: "figure-4-10",
    title: "one decay over time",
    kind: ItemKind::Figure,
    places: &[
        PaperPlace { paper: "T", label: "Figure 9", page: "section VI-B" },
        PaperPlace { paper: "D", label: "Figure 4.10", page: "section 4.6.2" },
    ],
    origin: ValueOrigin::Measured,
};

/// s on each side of a pass that are drawn.
const NEAR_S: f64 = 0.08e-3;
const HEADS: [&str; 4] = ["SNR 83", "SNR 23", "SNR 5", "SNR 1"];

/// One trial.
struct SnapshotTrial {
    decay: ClosedFormDecay,
    signal: Vec<f64>,
    /// EKF and hybrid.
    angles: [Vec<f64>; 2],
    /// The samples of detections.
    detections: Vec<usize>,
}

/// Estimates some decays by the printed filters.
pub fn run(work: &PartWork) -> Result<Vec<Item>, ReproduceError> {
    let first_seed = work.seed;
    let bench = ThresholdBench::new()?;
    let settings = bench.mismatched_settings(&PUBLISHED_LEVEL, &PRINTED);
    let trials = match work.effort {
        Effort::Quick => 3,
        Effort::Full => 20,
    };
    let noise = bench.device.noise_variance.sqrt();
    let trials = work.map("decays over time", (trials, 80_000), |i, progress| {
        let decay = ClosedFormDecay::of(&bench.device, ClosedFormDecay::phase(i));
        let seed = first_seed + i as u64;
        let signal = decay.recorded(noise, seed);
        let (crossings, filters) = estimate(&settings, &decay, &signal, seed, progress)?;
        let [ekf, hybrid] = filters.as_slice() else { return Err(ReproduceError::Interrupted) };
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a sample of the recording
        let sample = |time_s: f64| (time_s / INTERVAL_S).round() as usize;
        let detections =
            crossings.iter().filter_map(|c| Some(sample(c.at(CrossingTiming::Sample)?.time_s))).collect();
        let angles = [ekf, hybrid].map(|filter| angles(filter).to_vec());
        Ok(SnapshotTrial { decay, signal, angles, detections })
    })?;
    // The hybrid's errors before and after detections.
    let mut sums = [0.0; 2];
    let mut pairs = Vec::new();
    for trial in &trials {
        for k in trial.detections.iter().filter(|k| **k > 0) {
            let [before, after] =
                [k - 1, *k].map(|at| (trial.angles[1][at] - trial.decay.states[at][0]).powi(2));
            (sums[0], sums[1]) = (sums[0] + before, sums[1] + after);
            pairs.push(after < before);
        }
    }
    let [before, after] = sums.map(|sum| 1e3 * f64::sqrt(sum / pairs.len() as f64));
    let closer = SignTest::of(pairs);
    let Some(first) = trials.first() else { return Err(ReproduceError::Interrupted) };
    Ok(vec![
        Item::new(&HEAD)
            .check(Check::claim(
                "the hybrid filter is corrected at the instant of a detection",
                "shown in four snapshots",
                format!(
                    "{} mrad rms the sample before, {} with it; closer {}",
                    significant(before),
                    significant(after),
                    closer.to_text()
                ),
                "sign test over the detections, at 5 %",
                closer.holds(),
            ))
            .figure(over_all(first)?)
            .figure(snapshots(first)),
    ])
}

fn over_all(trial: &SnapshotTrial) -> Result<Figure, ReproduceError> {
    let kernel = SlopeKernel::<f64, 60>::new(SIGMA).map_err(|e| failed(HEAD.title)(e.into()))?;
    let mut response = vec![0.0; trial.signal.len()];
    kernel.responses(&trial.signal, &mut response);
    let times = &trial.decay.time_s;
    let over = |value: &dyn Fn(usize) -> f64| -> Vec<(f64, f64)> {
        (0..times.len()).map(|k| (times[k], value(k))).collect()
    };
    let error = |filter: usize| over(&|k| trial.angles[filter][k] - trial.decay.states[k][0]);
    let time = || Axis::new("time", "s");
    Ok(Figure::new(
        "figure-4-10_overall",
        "One decay",
        "From above: the motion and the errors of the two filters; the signal; the response of the derivative of a \
         Gaussian, whose maxima are the detections.",
    )
    .with(
        Panel::new(time(), Axis::new("angle", "rad"))
            .with(Series::line("motion (EXP)", SeriesRole::Reference, over(&|k| trial.decay.states[k][0]))),
    )
    .with(
        Panel::new(time(), Axis::new("error", "rad"))
            .with(Series::line("EKF", SeriesRole::Model, error(0)))
            .with(Series::line("hybrid (HYB)", SeriesRole::Estimate, error(1)))
            .sharing_x(),
    )
    .with(
        Panel::new(time(), Axis::new("signal", "V"))
            .with(Series::line("", SeriesRole::Measured, over(&|k| trial.signal[k])))
            .sharing_x(),
    )
    .with(
        Panel::new(time(), Axis::new("response", "V/s"))
            .with(Series::line("", SeriesRole::Other, over(&|k| response[k] / INTERVAL_S)))
            .sharing_x(),
    ))
}

fn snapshots(trial: &SnapshotTrial) -> Figure {
    let mut figure = Figure::new(
        "figure-4-10_snapshots",
        "Four passes of the threshold",
        "One pass in each quarter of the decay: the motion, both filters, and where the hybrid filter used the \
         threshold's angle.",
    );
    let times = &trial.decay.time_s;
    for (i, head) in HEADS.into_iter().enumerate() {
        let here = trial.detections.iter().filter(|k| quarter(times[**k]) == i);
        // The third: the first in which the filters start are still settling.
        let Some(middle) = here.copied().nth(2) else { continue };
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // positive
        let near = (NEAR_S / INTERVAL_S) as usize;
        let window = middle.saturating_sub(near)..(middle + near).min(times.len());
        let over = |value: &dyn Fn(usize) -> f64| -> Vec<(f64, f64)> {
            window.clone().map(|k| (times[k] - times[middle], value(k))).collect()
        };
        let panel =
            Panel::new(Axis::new("time from the detection", "s"), Axis::new(format!("angle, {head}"), "rad"))
                .with(Series::line(
                    "motion (EXP)",
                    SeriesRole::Reference,
                    over(&|k| trial.decay.states[k][0]),
                ))
                .with(Series::line("EKF", SeriesRole::Model, over(&|k| trial.angles[0][k])))
                .with(Series::line("hybrid (HYB)", SeriesRole::Estimate, over(&|k| trial.angles[1][k])));
        figure = figure.with(if i > 0 { panel.sharing_x() } else { panel });
    }
    figure
}
