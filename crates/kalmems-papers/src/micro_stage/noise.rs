//! From the sensors' noise to the scale factor.

use super::failed;
use super::record_sets::{
    DAMPING_RATIO, DRIVE_GAIN, DRIVE_HZ, DRIVES_V, NATURAL_HZ, NOISE_V, RATE_HZ, angle, channels,
};
use crate::program::{
    Check, Effort, Item, ItemHead, ItemKind, PaperPlace, PartWork, ReproduceError, ValueOrigin,
};
use kalmems_applications::calibration::{NoiseShare, NoiseStudy};
use kalmems_figures::{Axis, Figure, Panel, Series, SeriesRole};
use kalmems_models::dynamics::TorsionalResonator;
use std::f64::consts::TAU;

/// The study.
pub static HEAD: ItemHead = ItemHead {
    key: "figure-3-16",
    title: "standard deviation of the scale factor over the noise of the sensors",
    kind: ItemKind::Figure,
    places: &[PaperPlace { paper: "D", label: "Figure 3.16", page: "page 51" }],
    origin: ValueOrigin::Computed,
};

/// Standard deviations of a sample in V.
const LEVELS: [f64; 5] = [1e-6, 3e-6, 1e-5, 3e-5, 1e-4];
/// Samples of a training record: two cycles.
const SAMPLES: usize = 735;

/// The item.
pub fn run(work: &PartWork) -> Result<Vec<Item>, ReproduceError> {
    let natural = TAU * NATURAL_HZ;
    let study = NoiseStudy {
        channels: channels().map(|channel| (channel.plate, channel.gain)).to_vec(),
        stage: TorsionalResonator {
            inertia: 1.0,
            damping: 2.0 * DAMPING_RATIO * natural,
            stiffness: natural * natural,
        },
        frequency_hz: DRIVE_HZ,
        training_rad: DRIVES_V.map(|volts| angle(volts).amplitude).to_vec(),
        test_rad: angle(DRIVES_V[2]).amplitude,
        rate_hz: RATE_HZ,
        samples: SAMPLES,
        drive_variance: (DRIVE_GAIN * NOISE_V[2]).powi(2),
    };
    let (levels, runs) = match work.effort {
        Effort::Quick => (&LEVELS[1..4], 12),
        Effort::Full => (&LEVELS[..], 50),
    };
    let seed = work.seed;
    let shares = work.map("ways of the noise", (levels.len(), 1), |index, _| {
        Some(study.run(levels[index], runs, seed + index as u64))
    })?;
    let shares: Vec<NoiseShare> = shares.into_iter().collect::<Result<_, _>>().map_err(failed(HEAD.key))?;
    let least = |of: &dyn Fn(&NoiseShare) -> f64| shares.iter().map(of).fold(f64::INFINITY, f64::min);
    let (gap, gain) = (least(&|s| s.by_gap / s.by_filter), least(&|s| s.by_gain / s.by_filter));
    let together = least(&|s| s.by_gap.min(s.by_gain) / s.by_both);
    Ok(vec![
        Item::new(&HEAD)
            .check(Check::claim(
                "wrongly identified gaps cost much more than the noise in the filter",
                "much more",
                format!("at least {gap:.1} times"),
                "at least twice as much, at every noise",
                gap > 2.0,
            ))
            .check(Check::claim(
                "wrongly identified gains cost much more than the noise in the filter",
                "much more",
                format!("at least {gain:.1} times"),
                "at least twice as much, at every noise",
                gain > 2.0,
            ))
            .remark(format!(
                "The dissertation shows curves without numbers. They are of a wrong gap beside a right gain and the other way \
                 round, which no identification gives: gap and gain of one identification are wrong together, and the error \
                 of the scale factor is then at least {together:.0} times smaller. Each channel's gap and gain are fitted to {} \
                 records of {SAMPLES} samples with the motion known, {runs} times; the filter's part is its covariance with the \
                 right model and a drive that is known to 0.3 mV.",
                DRIVES_V.len()
            ))
            .figure(figure(&shares)),
    ])
}

fn figure(shares: &[NoiseShare]) -> Figure {
    let line = |label: &str, role: SeriesRole, of: fn(&NoiseShare) -> f64| {
        let points: Vec<(f64, f64)> = shares.iter().map(|s| (s.noise_v.powi(2), 1e6 * of(s))).collect();
        Series::line(label, role, points)
    };
    let panel = Panel::new(
        Axis::new("variance of the sensor noise", "V^2").log(),
        Axis::new("standard deviation of the scale factor", "ppm").log(),
    )
    .with(line("identified gaps, true gains", SeriesRole::Measured, |s| s.by_gap))
    .with(line("identified gains, true gaps", SeriesRole::Model, |s| s.by_gain))
    .with(line("both, as identified together", SeriesRole::Estimate, |s| s.by_both))
    .with(line("filter with the true model", SeriesRole::Bound, |s| s.by_filter));
    Figure::new(
        "figure-3-16_noise",
        "From sensor noise to the scale factor",
        "What the noise of a sample does to a scale factor, by each way that it takes.",
    )
    .with(panel)
}
