//! The pictures of an identification.

use super::{RingDown, RingDownFit, SteadyState, SteadyStateFit, integrated_capacitance, unknown};
use crate::identify::{Identification, Material, StillNoise};
use kalmems_figures::{Axis, Figure, Panel, Series, SeriesRole};
use kalmems_models::capacitance::GaussianComb;
use std::f64::consts::TAU;

/// Cycles of a close-up.
const CYCLES: f64 = 4.0;

fn time_axis() -> Axis {
    Axis::new("time", "s")
}

/// The first samples of a few cycles.
fn close_up(interval_s: f64, rate: f64, samples: usize) -> usize {
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // not negative, at most the record
    let count = (CYCLES * TAU / rate / interval_s).ceil().min(samples as f64) as usize;
    count
}

pub fn ring_down(found: &mut Identification, material: &Material, record: &RingDown, fitted: &RingDownFit) {
    let p = &fitted.fit.parameters;
    let rate = (p[unknown::STIFFNESS] / record.scanner.resonator.inertia).sqrt();
    let near = close_up(material.interval_s, rate, material.time_s.len());
    let zip = |values: &dyn Fn(usize) -> f64, count: usize| -> Vec<(f64, f64)> {
        (0..count).map(|k| (material.time_s[k], values(k))).collect()
    };
    let all = material.time_s.len();
    let caption = "The first cycles of the ring-down: what was recorded, and what the fitted device gives. The fit \
                   takes the whole record.";
    let mut figure = Figure::new("ring_down_fit", "Ring-down: fit over data", caption).with(
        Panel::new(time_axis(), Axis::new("V_o1", "V"))
            .with(Series::points("measured", SeriesRole::Measured, zip(&|k| material.signal[k], near)))
            .with(Series::line("fitted", SeriesRole::Model, zip(&|k| fitted.fitted[k][0], near))),
    );
    let mut angle = Panel::new(time_axis(), Axis::new("angle", "deg"));
    if fitted.with_reference {
        angle = angle.with(Series::points(
            "reference",
            SeriesRole::Reference,
            zip(&|k| material.angle[k].to_degrees(), near),
        ));
    }
    angle = angle.with(Series::line(
        "fitted",
        SeriesRole::Model,
        zip(&|k| fitted.fitted[k][1].to_degrees(), near),
    ));
    figure = figure.with(angle.sharing_x());
    found.figures.push(figure);

    let caption = "What the fit leaves over the whole ring-down, with three standard deviations of the noise on each \
                   side. A pattern would be motion or circuit that the model does not have.";
    let mut figure = Figure::new("ring_down_residuals", "Ring-down: residuals", caption);
    let channels = [("V_o1", "V_o1 residual", "V", 1.0), ("reference", "angle residual", "deg", TAU / 360.0)];
    for (channel, (name, label, unit, scale)) in channels.into_iter().enumerate() {
        if channel == 1 && !fitted.with_reference {
            continue;
        }
        let left = |k: usize| {
            let measured = if channel == 0 { material.signal[k] } else { material.angle[k] };
            (measured - fitted.fitted[k][channel]) / scale
        };
        let three = 3.0 * fitted.deviations[channel] / scale;
        let panel = Panel::new(time_axis(), Axis::new(label, unit))
            .with(Series::points(name, SeriesRole::Measured, zip(&left, all)))
            .with(Series::level("±3σ", SeriesRole::Bound, three))
            .with(Series::level("", SeriesRole::Bound, -three));
        figure = figure.with(if channel == 0 { panel } else { panel.sharing_x() });
    }
    found.figures.push(figure);
    found.figures.push(profile(record, fitted));
}

/// C over the angle: as fitted, and as the charge that is added up has it.
fn profile(record: &RingDown, fitted: &RingDownFit) -> Figure {
    let p = &fitted.fit.parameters;
    let comb = GaussianComb { nominal: p[unknown::NOMINAL], angular_width: p[unknown::WIDTH], bias: 0.0 };
    let before = record.scanner.comb;
    let believed = GaussianComb { bias: 0.0, ..before };
    let angle_of = |k: usize| fitted.fitted[k][1] - p[unknown::ANGLE_OFFSET];
    let largest = (0..fitted.fitted.len()).map(|k| angle_of(k).abs()).fold(0.0, f64::max);
    let curve = |comb: GaussianComb<f64>| -> Vec<(f64, f64)> {
        (-100..=100)
            .map(|i| {
                let angle = 1.1 * largest * f64::from(i) / 100.0;
                (angle.to_degrees(), comb.capacitance(angle))
            })
            .collect()
    };
    let first = comb.capacitance(fitted.fitted.first().map_or(0.0, |_| angle_of(0)));
    // Without the offset that was fitted, whose integral would walk along whatever curve is drawn.
    let signal: Vec<f64> = record.signal.iter().map(|volts| volts - p[unknown::OFFSET]).collect();
    let summed = integrated_capacitance(&signal, record.interval_s, record.gain);
    let charge: Vec<(f64, f64)> =
        (0..summed.len()).map(|k| (angle_of(k).to_degrees(), first + summed[k])).collect();
    let times = || (0..summed.len()).map(|k| k as f64 * record.interval_s);
    let walked = times().enumerate().map(|(k, t)| (t, first + summed[k] - comb.capacitance(angle_of(k))));
    // The sum of k samples' noise has the variance of one times k.
    let step = fitted.deviations[0] * record.interval_s / record.gain.abs();
    let reach = |k: usize| 2.0 * step * (k as f64).sqrt();
    let expected = times().enumerate().map(|(k, t)| (t, -reach(k), reach(k)));
    let drift = Panel::new(time_axis(), Axis::new("charge less fitted", "F"))
        .with(Series::band("±2 standard deviations of added-up noise", SeriesRole::Bound, expected))
        .with(Series::line("charge added up less fitted", SeriesRole::Estimate, walked));
    let caption = "The part of the capacitance that the motion changes, C − C_b, over the angle: as the experiment had \
                   it, as fitted, and from the charge added up from the first sample on, less the offset that was fitted. The \
                   sum of the samples' noise walks: the points lie beside the fitted line by what is drawn below over \
                   time, with what noise alone lets expect.";
    Figure::new("capacitance_profile", "Capacitance over the angle", caption)
        .with(
            Panel::new(Axis::new("angle", "deg"), Axis::new("C − C_b", "F"))
                .with(Series::points("charge added up", SeriesRole::Measured, charge))
                .with(Series::line("before", SeriesRole::Reference, curve(believed)))
                .with(Series::line("fitted", SeriesRole::Model, curve(comb))),
        )
        .with(drift)
}

pub fn steady_state(
    found: &mut Identification,
    material: &Material,
    record: &SteadyState,
    fitted: &SteadyStateFit,
) {
    let all = material.time_s.len();
    let over = |values: &dyn Fn(usize) -> f64| -> Vec<(f64, f64)> {
        (0..all).map(|k| (record.comb.capacitance(material.angle[k]), values(k))).collect()
    };
    let line = &fitted.affine;
    let fit = |k: usize| line.slope * record.comb.capacitance(material.angle[k]) + line.intercept;
    let caption = "The demodulated signal over the capacitance at the reference's angle, and the line through it; below \
                   what the line leaves, and what is left with the demodulator's poles where they are seen. A loop \
                   is a lag.";
    let mut residuals = Panel::new(Axis::new("capacitance", "F"), Axis::new("residual", "V"))
        .with(Series::points("affine", SeriesRole::Measured, over(&|k| line.residuals[k])));
    if let Some(poles) = &fitted.poles {
        residuals =
            residuals.with(Series::points("with poles", SeriesRole::Estimate, over(&|k| poles.residuals[k])));
    }
    found.figures.push(
        Figure::new("circuit_gain", "Signal over capacitance", caption)
            .with(
                Panel::new(Axis::new("capacitance", "F"), Axis::new("signal", "V"))
                    .with(Series::points("measured", SeriesRole::Measured, over(&|k| material.signal[k])))
                    .with(Series::line("fitted", SeriesRole::Model, over(&fit))),
            )
            .with(residuals.sharing_x()),
    );
}

pub fn still(found: &mut Identification, material: &Material, fitted: &StillNoise) {
    let all = material.time_s.len();
    let three = 3.0 * fitted.variance.sqrt();
    let points: Vec<(f64, f64)> = (0..all).map(|k| (material.time_s[k], material.signal[k])).collect();
    let caption = "The signal without motion, of a long record its beginning, with three standard deviations on each side \
                   of the mean of all.";
    found.figures.push(
        Figure::new("noise", "Noise without motion", caption).with(
            Panel::new(time_axis(), Axis::new("signal", "V"))
                .with(Series::points("measured", SeriesRole::Measured, points))
                .with(Series::level("±3σ", SeriesRole::Bound, fitted.mean + three))
                .with(Series::level("", SeriesRole::Bound, fitted.mean - three)),
        ),
    );
}
