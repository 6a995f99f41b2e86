//! How well the estimate knows the rate.

use super::failed;
use super::record_sets::{DRIVE_HZ, DRIVES_V, PRINTED, experiment};
use crate::program::{
    Check, CheckTolerance, Item, ItemHead, ItemKind, PaperPlace, PartWork, ReproduceError, SeedSpread,
    ValueOrigin,
};
use crate::progress::Silent;
use crate::simulate::{ComputedRecording, SimulateError, described};
use kalmems_figures::{Axis, Figure, Panel, Series, SeriesRole};
use kalmems_rigs::Rig;
use kalmems_rigs::equations::PresetRig;
use kalmems_rigs::micro_stage::device::MicroStage;
use kalmems_rigs::published;
use kalmems_rigs::workflow::{self, Outcome};

/// The validation.
pub static HEAD: ItemHead = ItemHead {
    key: "table-3-5",
    title: "error, scale factor and bias of the estimated rate",
    kind: ItemKind::Table,
    places: &[
        PaperPlace { paper: "D", label: "Table 3.5", page: "page 47" },
        PaperPlace { paper: "D", label: "Figure 3.14", page: "page 47" },
    ],
    origin: ValueOrigin::Measured,
};

/// D Table 3.5.
const RMSE: f64 = 0.1140;
const ALPHA: f64 = 1.0008;
const BETA: f64 = -0.0207;

/// One run at a drive.
fn outcome(volts: f64, seed: u64) -> Result<Outcome, ReproduceError> {
    let experiment = experiment(HEAD.key, volts, seed, &PRINTED)?;
    let simulation = PresetRig::<MicroStage>::new().simulate(&experiment).map_err(failed(HEAD.key))?;
    let unwritten: Result<ComputedRecording, SimulateError> =
        ComputedRecording::of(simulation.as_ref(), &Silent);
    let recorded = described(&experiment, simulation.as_ref());
    workflow::estimate_computed(published(), &recorded, &unwritten.map_err(failed(HEAD.key))?, &Silent)
        .map_err(failed(HEAD.key))
}

/// The item.
pub fn run(work: &PartWork) -> Result<Vec<Item>, ReproduceError> {
    let (mut errors, mut scales, mut biases, mut figure) = (Vec::new(), Vec::new(), Vec::new(), None);
    for (index, volts) in DRIVES_V.into_iter().enumerate() {
        let outcome = outcome(volts, work.seed + index as u64)?;
        for segment in outcome.recordings.iter().flat_map(|recording| &recording.segments) {
            let found = segment.values.first().and_then(|values| values.get("rate"));
            if let Some(rate) = found {
                errors.push(rate.rmse);
                scales.extend(rate.scale_factor.map(|alpha| 1e6 * (alpha - 1.0)));
                biases.extend(rate.offset);
            }
            if let Some(trajectory) = segment.estimate.trajectories.first().filter(|_| volts > 1.25)
                && let (Some(state), Some(rate)) = (trajectory.state("rate"), found)
            {
                let from = trajectory.time_s.partition_point(|t| *t < segment.estimate.from_s());
                let to =
                    trajectory.time_s.partition_point(|t| *t < segment.estimate.from_s() + 1.0 / DRIVE_HZ);
                let estimate: Vec<(f64, f64)> =
                    (from..to).map(|k| (trajectory.time_s[k], state.mean[k])).collect();
                let error: Vec<(f64, f64)> = rate
                    .error
                    .time_s
                    .iter()
                    .copied()
                    .zip(rate.error.error.iter().copied())
                    .take(to - from)
                    .collect();
                figure = Some(
                    Figure::new(
                        "figure-3-14_rate",
                        "The rate over one cycle at 1.3 V",
                        "Estimated rate, and what it differs from the true one by.",
                    )
                    .with(Panel::new(Axis::new("time", "s"), Axis::new("rate", "rad/s")).with(Series::line(
                        "estimated",
                        SeriesRole::Estimate,
                        estimate,
                    )))
                    .with(
                        Panel::new(Axis::new("time", "s"), Axis::new("error", "rad/s"))
                            .with(Series::line("error", SeriesRole::Estimate, error))
                            .with(Series::level("D: root mean square 0.1140", SeriesRole::Bound, RMSE))
                            .with(Series::level("", SeriesRole::Bound, -RMSE))
                            .sharing_x(),
                    ),
                );
            }
        }
    }
    let (rmse, alpha, beta) = (SeedSpread::of(errors), SeedSpread::of(scales), SeedSpread::of(biases));
    let item = Item::new(&HEAD)
        .check(Check::value("RMSE of the rate", "rad/s", RMSE, rmse, CheckTolerance::part(0.1, "four drives, and no spread is stated")))
        .check(Check::value(
            "scale factor alpha, less 1",
            "ppm",
            (1e6 * (ALPHA - 1.0)).round(),
            alpha,
            CheckTolerance::digit(100.0),
        ))
        .check(Check::claim(
            "the bias beta is a part in a thousand of the motion, or less",
            format!("{BETA} rad/s"),
            format!("{} rad/s", beta.to_text()),
            "no more than the printed",
            beta.median.abs() <= BETA.abs(),
        ))
        .remark(
            "Four drives from 1 to 1.3 V, each with its own noise. Our error is smaller because nothing but white noise is in \
             it; the dissertation names residual feedthrough and the mismatch of the capacitance as its own.",
        );
    Ok(vec![match figure {
        Some(figure) => item.figure(figure),
        None => item,
    }])
}
