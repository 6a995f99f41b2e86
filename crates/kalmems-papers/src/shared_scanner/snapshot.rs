//! A few cycles: drive, motion, signal.

use super::bench::{EstimatorResult, SAMPLING_HZ, ScannerBench};
use super::estimator_comparison::{DIVERGED_DEG, WRONG_STIFFNESS};
use crate::program::{Check, Item, ItemHead, ItemKind, PaperPlace, PartWork, ReproduceError, ValueOrigin};
use kalmems_figures::significant;
use kalmems_figures::{Axis, ColumnHead, Figure, Panel, Series, SeriesRole, TextTable};

/// S: drive and angle.
pub static JOURNAL: ItemHead = ItemHead {
    key: "figure-8",
    title: "drive and angle over a few cycles",
    kind: ItemKind::Figure,
    places: &[PaperPlace { paper: "S", label: "Figure 8", page: "section IV-B" }],
    origin: ValueOrigin::Measured,
};

/// D: the signal as well.
pub static DISSERTATION: ItemHead = ItemHead {
    key: "figure-5-8",
    title: "the signal that EKF and UKF expect, over a few cycles",
    kind: ItemKind::Figure,
    places: &[PaperPlace { paper: "D", label: "Figure 5.8", page: "page 99" }],
    origin: ValueOrigin::Measured,
};

/// The middle of the band over which the device moves.
const DRIVE_HZ: f64 = 31_350.0;
/// Samples that are shown: about three cycles of the motion.
const SHOWN: usize = 200;
/// Of these the UKF's that are drawn.
const POINT_EVERY: usize = 8;
/// The estimators that the papers' figures show.
pub(super) const PUBLISHED: [&str; 3] = ["model_alone", "ekf", "ukf"];

/// Estimates one recording.
pub fn run(work: &PartWork) -> Result<Vec<Item>, ReproduceError> {
    let bench = ScannerBench::new()?;
    let first_seed = work.seed;
    let mut results = work.map("a few cycles", (1, 120_000), |_, progress| {
        let motion = bench.steady(&[DRIVE_HZ], 6000).into_iter().next().ok_or(ReproduceError::Interrupted)?;
        let judged = bench.estimate(&motion, &WRONG_STIFFNESS, (first_seed, 0), progress)?;
        let signal = bench.signal(&motion, (first_seed, 0));
        Ok((motion, judged, signal))
    })?;
    let Some((motion, judged, signal)) = results.pop() else { return Err(ReproduceError::Interrupted) };

    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // an index
    let from = (bench.skip_s() * SAMPLING_HZ) as usize;
    let window = from..(from + SHOWN).min(motion.time_s.len());
    let times = &motion.time_s[window.clone()];
    let start = times.first().copied().unwrap_or(0.0);
    let since = |values: &[f64]| -> Vec<(f64, f64)> {
        times
            .iter()
            .zip(values.get(window.clone()).unwrap_or_default())
            .map(|(t, v)| (t - start, *v))
            .collect()
    };
    let degrees = |values: &[f64]| since(&values.iter().map(|v| v.to_degrees()).collect::<Vec<_>>());
    let time = || Axis::new("time", "s");
    let mut angle = Panel::new(time(), Axis::new("angle", "deg")).with(Series::line(
        "simulated motion (EXP)",
        SeriesRole::Reference,
        degrees(&motion.truth.angle),
    ));
    let mut sensor = Panel::new(time(), Axis::new("signal", "V")).with(Series::points(
        "simulated",
        SeriesRole::Measured,
        since(&signal),
    ));
    let shown = |judged: &&EstimatorResult| PUBLISHED.contains(&judged.trajectory.key.as_str());
    for EstimatorResult { trajectory, .. } in judged.iter().filter(shown) {
        let role = if trajectory.claims() { SeriesRole::Other } else { SeriesRole::Model };
        // EKF and UKF are one line: the UKF is drawn as points, so that both are seen.
        let drawn = |values: Vec<(f64, f64)>| {
            if trajectory.key == "ukf" {
                Series::points(&trajectory.name, role, values.into_iter().step_by(POINT_EVERY))
            } else {
                Series::line(&trajectory.name, role, values)
            }
        };
        if let Some(state) = trajectory.state("angle") {
            angle = angle.with(drawn(degrees(&state.mean)));
        }
        let predicted: Vec<f64> = signal.iter().zip(&trajectory.innovation).map(|(y, i)| y - i).collect();
        sensor = sensor.with(drawn(since(&predicted)));
    }
    angle.shares_x = true;
    let motions = Figure::new(
        "figure-8_motion",
        "Drive and angle",
        "31.35 kHz; the stiffness of model and filters is 0.3 % too high. The UKF's points, every \
         eighth sample, lie on the EKF's line, and both on the motion.",
    )
    .with(Panel::new(time(), Axis::new("drive", "V")).with(Series::line(
        "drive",
        SeriesRole::Input,
        since(&motion.volts),
    )))
    .with(angle);
    let signals = Figure::new(
        "figure-5-8_signal",
        "Signal",
        "The signal of the same cycles as recorded, and what each estimator expects from the samples before it. The UKF's \
         points, every eighth sample, lie on the EKF's line.",
    )
    .with(sensor);

    let error = |key: &str| judged.iter().find(|j| j.trajectory.key == key).and_then(|j| j.errors.as_ref());
    let phase = |key| error(key).and_then(|e| e.peak_phase_rmse_deg).unwrap_or(f64::NAN);
    let (model, ekf, ukf) = (phase("model_alone"), phase("ekf"), phase("ukf"));
    let apart = difference_of_predictions(&judged);
    let noise = bench.hardware().noise_variance.sqrt();
    let journal = Item::new(&JOURNAL)
        .check(Check::claim(
            "EKF and UKF have less error in phase than the model alone",
            "both less",
            format!("{} and {} against {} deg", significant(ekf), significant(ukf), significant(model)),
            "both less",
            ekf < model && ukf < model,
        ))
        .figure(motions)
        .table(errors_table(&judged));
    let dissertation = Item::new(&DISSERTATION)
        .check(Check::claim(
            "the EKF's linearisation shows in the estimated signal",
            "a visible discrepancy",
            format!(
                "EKF and UKF expect the same within {:.2} mV rms; the noise is {:.1} mV",
                1e3 * apart,
                1e3 * noise
            ),
            "further apart than the noise of a sample",
            apart > noise,
        ))
        .figure(signals);
    Ok(vec![journal, dissertation])
}

/// The errors of each estimator.
fn errors_table(judged: &[EstimatorResult]) -> TextTable {
    let mut table = TextTable::new(
        "Errors of this recording",
        [
            ColumnHead::text("estimator"),
            ColumnHead::number("angle RMSE", "deg"),
            ColumnHead::number("of p-p", "%"),
            ColumnHead::number("phase RMSE", "deg"),
        ],
    );
    for EstimatorResult { trajectory, errors } in judged {
        // How far away an estimator is that follows no longer is no figure of merit.
        let lost = errors.as_ref().is_some_and(|e| e.angle.rmse_deg >= DIVERGED_DEG);
        let none = if lost { "lost" } else { "–" };
        let cell = |value: Option<f64>| value.map_or_else(|| none.to_owned(), significant);
        let errors = errors.as_ref().filter(|_| !lost);
        table.push([
            trajectory.name.clone(),
            cell(errors.map(|e| e.angle.rmse_deg)),
            cell(errors.map(|e| e.angle.rmse_percent_of_peak_to_peak)),
            cell(errors.and_then(|e| e.peak_phase_rmse_deg)),
        ]);
    }
    table
}

/// The root mean square difference of the signals that EKF and UKF predict, after both have settled.
fn difference_of_predictions(judged: &[EstimatorResult]) -> f64 {
    let of = |key: &str| judged.iter().find(|j| j.trajectory.key == key).map(|j| &j.trajectory.innovation);
    let Some((ekf, ukf)) = of("ekf").zip(of("ukf")) else { return f64::NAN };
    let settled = ekf.len() / 2;
    let squares = ekf.iter().zip(ukf).skip(settled).map(|(a, b)| (a - b).powi(2));
    (squares.sum::<f64>() / (ekf.len() - settled).max(1) as f64).sqrt()
}
