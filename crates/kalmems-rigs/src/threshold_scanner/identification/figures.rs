//! The pictures of the identification.

use super::super::hardware::ThresholdHardware;
use super::{DecayResult, unknown};
use crate::identify::Material;
use kalmems_figures::{Axis, Figure, Panel, Series, SeriesRole};
use std::f64::consts::TAU;

/// Cycles of a close-up.
const CYCLES: f64 = 3.0;

pub fn of(material: &Material, found: &DecayResult, device: (&ThresholdHardware, f64)) -> Vec<Figure> {
    vec![fit(material, found), residuals(material, found), curve(found, device)]
}

fn time_axis() -> Axis {
    Axis::new("time", "s")
}

fn over_time(material: &Material, count: usize, value: impl Fn(usize) -> f64) -> Vec<(f64, f64)> {
    (0..count.min(material.time_s.len())).map(|k| (material.time_s[k], value(k))).collect()
}

fn fit(material: &Material, found: &DecayResult) -> Figure {
    let cycle_s = TAU / found.decay.fit.parameters[unknown::NATURAL_RATE];
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // positive, and cut to the record
    let near = (CYCLES * cycle_s / material.interval_s).ceil() as usize;
    let fitted = &found.decay.fitted;
    let caption = "The first cycles of the free decay: what was recorded, and what the fitted device gives, the \
                   reference as late as it was found to be. The fit takes the whole record.";
    let signal = Panel::new(time_axis(), Axis::new("signal", "V"))
        .with(Series::points(
            "measured",
            SeriesRole::Measured,
            over_time(material, near, |k| material.signal[k]),
        ))
        .with(Series::line("fitted", SeriesRole::Model, over_time(material, near, |k| fitted[k][0])));
    let angle = Panel::new(time_axis(), Axis::new("angle", "deg"))
        .with(Series::points(
            "reference",
            SeriesRole::Reference,
            over_time(material, near, |k| material.angle[k].to_degrees()),
        ))
        .with(Series::line(
            "fitted",
            SeriesRole::Model,
            over_time(material, near, |k| fitted[k][1].to_degrees()),
        ));
    Figure::new("free_decay_fit", "Free decay: fit over data", caption).with(signal).with(angle.sharing_x())
}

fn residuals(material: &Material, found: &DecayResult) -> Figure {
    let all = material.time_s.len();
    let caption = "What the fit leaves over the whole record, with three standard deviations of the noise on each side. \
                   A pattern would be motion or a comb that the model does not have.";
    let fitted = &found.decay.fitted;
    let three = [0, 1].map(|channel| 3.0 * found.decay.deviations[channel]);
    let signal = Panel::new(time_axis(), Axis::new("signal residual", "V"))
        .with(Series::points(
            "signal",
            SeriesRole::Measured,
            over_time(material, all, |k| material.signal[k] - fitted[k][0]),
        ))
        .with(Series::level("±3σ", SeriesRole::Bound, three[0]))
        .with(Series::level("", SeriesRole::Bound, -three[0]));
    let limit = three[1].to_degrees();
    let angle = Panel::new(time_axis(), Axis::new("angle residual", "deg"))
        .with(Series::points(
            "reference",
            SeriesRole::Measured,
            over_time(material, all, |k| (material.angle[k] - fitted[k][1]).to_degrees()),
        ))
        .with(Series::level("±3σ", SeriesRole::Bound, limit))
        .with(Series::level("", SeriesRole::Bound, -limit));
    Figure::new("free_decay_residuals", "Free decay: residuals", caption).with(signal).with(angle.sharing_x())
}

fn curve(found: &DecayResult, (hardware, transimpedance): (&ThresholdHardware, f64)) -> Figure {
    let (before, fitted) = (hardware.readout.comb, found.decay.comb());
    let points = |value: &dyn Fn(usize) -> f64| -> Vec<(f64, f64)> {
        (0..found.curve.len()).map(|i| (found.curve[i].angle.to_degrees(), value(i))).collect()
    };
    let angle = |i: usize| found.curve[i].angle;
    let caption = "The comb's curve h(θ) and the capacitance C(θ) − C(θ_th) that follows from it: as the experiment had \
                   them, as fitted with a formula, and without one, as splines with two standard errors on each side.";
    let side =
        |sign: f64| points(&|i| found.curve[i].sensitivity[0] + 2.0 * sign * found.curve[i].sensitivity[1]);
    let sensitivity = Panel::new(Axis::new("angle", "deg"), Axis::new("h", "V s/rad"))
        .with(Series::line("before", SeriesRole::Reference, points(&|i| before.sensitivity(angle(i)))))
        .with(Series::line("fitted", SeriesRole::Model, points(&|i| fitted.sensitivity(angle(i)))))
        .with(Series::points("splines", SeriesRole::Estimate, points(&|i| found.curve[i].sensitivity[0])))
        .with(Series::line("±2 standard errors", SeriesRole::Bound, side(1.0)))
        .with(Series::line("", SeriesRole::Bound, side(-1.0)));
    let capacitance = Panel::new(Axis::new("angle", "deg"), Axis::new("C − C(θ_th)", "F"))
        .with(Series::line(
            "before",
            SeriesRole::Reference,
            points(&|i| before.capacitance_change(angle(i), transimpedance)),
        ))
        .with(Series::line(
            "fitted",
            SeriesRole::Model,
            points(&|i| fitted.capacitance_change(angle(i), transimpedance)),
        ))
        .with(Series::points("splines", SeriesRole::Estimate, points(&|i| found.curve[i].capacitance[0])));
    Figure::new("comb_curve", "The comb's curve", caption).with(sensitivity).with(capacitance.sharing_x())
}
