//! The pictures of the identification.

use super::crests::expected;
use super::gaps::GapFit;
use super::sweep::{StageSweepPoint, SweepFit};
use super::waveform::unknown;
use crate::micro_stage::hardware::StageHardware;
use kalmems_core::Portable;
use kalmems_figures::{Axis, Figure, Panel, Series, SeriesRole};
use kalmems_models::capacitance::TiltingPlate;
use std::f64::consts::TAU;

/// Points of a drawn curve.
const CURVE: u32 = 200;

/// Points of a signal without visible noise: so few that each is seen above the fitted line.
const DOTS: usize = 60;

/// The response over frequency, and in the plane with its circle. `origin` says what the points are: measured, or simulated.
pub fn sweep(points: &[StageSweepPoint], fitted: &SweepFit, origin: &str) -> Figure {
    let p = &fitted.response.fit.parameters;
    let [low, high] = [points.first(), points.last()].map(|p| p.map_or(0.0, |p| p.frequency_hz));
    let middle = (low * high).sqrt();
    let model = |f: f64| {
        let s = f / p[1];
        let (a, b) = (1.0 - s * s, 2.0 * p[2] * s);
        let scale = p[0] / (a * a + b * b);
        let others = p[4] + p[5] * (middle / f).powi(2);
        let (re, im) = (scale * a + others, -scale * b);
        // The rate is 2πjf times the angle.
        let turn = TAU * f;
        let (sine, cosine) = (-turn * p[3]).portable_sin_cos();
        let (re, im) = (-turn * im, turn * re);
        (re * cosine - im * sine, re * sine + im * cosine)
    };
    let along = |value: &dyn Fn(f64, f64) -> f64| -> Vec<(f64, f64)> {
        (0..=CURVE)
            .map(|k| {
                let f = low + (high - low) * f64::from(k) / f64::from(CURVE);
                let (re, im) = model(f);
                (f, value(re, im))
            })
            .collect()
    };
    let measured = |value: &dyn Fn(f64, f64) -> f64| -> Vec<(f64, f64)> {
        points.iter().map(|p| (p.frequency_hz, value(p.re, p.im))).collect()
    };
    let size = |re: f64, im: f64| re.portable_hypot(im);
    let phase = |re: f64, im: f64| im.portable_atan2(re).to_degrees();
    let ([x, y], radius) = fitted.circle();
    let circle: Vec<(f64, f64)> = (0..=CURVE)
        .map(|k| {
            let (sine, cosine) = (TAU * f64::from(k) / f64::from(CURVE)).portable_sin_cos();
            (x + radius * cosine, y + radius * sine)
        })
        .collect();
    let plane: Vec<(f64, f64)> = points.iter().map(|p| (p.re, p.im)).collect();
    let caption = "The angular rate per volt of drive, the vibrometer's stated delay taken off: amplitude and phase over the \
                   drive's frequency with the fitted response, and the same points in the complex plane with the fitted \
                   circle.";
    Figure::new("resonance", "Tilting mode: response to the drive", caption)
        .with(
            Panel::new(Axis::new("frequency", "Hz"), Axis::new("amplitude", "rad/s/V"))
                .with(Series::line("fitted", SeriesRole::Model, along(&size)))
                .with(Series::points(origin, SeriesRole::Measured, measured(&size))),
        )
        .with(
            Panel::new(Axis::new("frequency", "Hz"), Axis::new("phase", "deg"))
                .with(Series::line("fitted", SeriesRole::Model, along(&phase)))
                .with(Series::points(origin, SeriesRole::Measured, measured(&phase)))
                .sharing_x(),
        )
        .with(
            Panel::new(Axis::new("real part", "rad/s/V"), Axis::new("imaginary part", "rad/s/V"))
                .with(Series::line("circle", SeriesRole::Model, circle))
                .with(Series::points(origin, SeriesRole::Measured, plane)),
        )
}

/// Waveforms with their fit, and how the crest-to-trough distance depends on the gap.
pub fn gaps(hardware: &StageHardware, fitted: &GapFit) -> Vec<Figure> {
    let mut figures = Vec::new();
    if let Some(figure) = waveforms(hardware, fitted) {
        figures.push(figure);
    }
    if let Some(figure) = crest_distance(hardware, fitted) {
        figures.push(figure);
    }
    figures
}

/// Cycles that are drawn.
const CYCLES: f64 = 2.0;

fn waveforms(hardware: &StageHardware, fitted: &GapFit) -> Option<Figure> {
    let fit = fitted.fit.as_ref()?;
    let largest = fitted.records.iter().max_by(|a, b| a.drive.amplitude.total_cmp(&b.drive.amplitude))?;
    let start = *largest.time_s.first()?;
    let end = largest.time_s.partition_point(|t| *t < start + CYCLES / largest.drive.frequency_hz);
    let time = || largest.time_s[..end].iter().copied();
    let caption = "Signals of the record with the largest drive, without what the drive alone makes of them: measured, and \
                   with the fitted gap and gain under the motion that the vibrometer shows. Of the samples so few are drawn that \
                   each can be seen on the line.";
    let mut figure = Figure::new("waveforms", "Signals at the largest drive", caption);
    for (place, (electrode, _)) in fitted.electrodes.iter().enumerate() {
        let channel = &hardware.channels[*electrode];
        let p = &fit.parameters;
        let plate = TiltingPlate { gap: p[unknown::gap(place)], ..channel.current.plate };
        let rate = TAU * largest.angle.frequency_hz;
        let modelled = |t: f64| {
            let phase = rate * (t + p[unknown::DELAY]) + largest.angle.phase_rad;
            let (sine, cosine) = phase.portable_sin_cos();
            let size = largest.angle.amplitude;
            p[unknown::gain(place)] * plate.slope(size * cosine) * (-size * rate * sine)
                + p[unknown::offset(place)]
        };
        let signals = fitted
            .signals_without_drive(largest, &fitted.electrodes.iter().map(|(e, _)| *e).collect::<Vec<_>>());
        let fitted_wave: Vec<(f64, f64)> = time().map(|t| (t, modelled(t))).collect();
        let every = end.div_ceil(DOTS).max(1);
        let measured: Vec<(f64, f64)> =
            time().zip(signals.get(place)?.iter().copied()).step_by(every).collect();
        let mut panel =
            Panel::new(Axis::new("time", "s"), Axis::new(format!("signal {}", channel.name), "V"))
                .with(Series::points("measured", SeriesRole::Measured, measured))
                .with(Series::line("fitted", SeriesRole::Model, fitted_wave));
        if place > 0 {
            panel = panel.sharing_x();
        }
        figure = figure.with(panel);
    }
    Some(figure)
}

/// Figure 3.12 of the dissertation: the distance over the gap, and where the records are.
fn crest_distance(hardware: &StageHardware, fitted: &GapFit) -> Option<Figure> {
    let (electrode, by) = fitted.electrodes.iter().find(|(_, by)| by.crests.is_some())?;
    let channel = &hardware.channels[*electrode];
    let caption = "How much later the trough is than the crest of a signal, as a part of the cycle, over the gap, for the motion \
                   of each record; the points are the records at the gap that was found by this distance.";
    let gap = by.crests?.gap.value;
    let mut panel = Panel::new(Axis::new("gap", "m"), Axis::new("crest to trough, of the cycle", "%"));
    let sign = channel.current.gain.signum();
    let at = |record: &super::WaveRecord, gap: f64| {
        100.0 * expected(&TiltingPlate { gap, ..channel.current.plate }, &record.angle, sign)[0]
    };
    for record in &fitted.records {
        let curve: Vec<(f64, f64)> = (0..=40)
            .map(|k| gap * (0.8 + 0.4 * f64::from(k) / 40.0))
            .map(|gap| (gap, at(record, gap)))
            .collect();
        panel =
            panel.with(Series::line(format!("{:.2} V", record.drive.amplitude), SeriesRole::Model, curve));
    }
    let points: Vec<(f64, f64)> = fitted.records.iter().map(|record| (gap, at(record, gap))).collect();
    panel = panel.with(Series::points("found", SeriesRole::Estimate, points));
    Some(
        Figure::new("crest_distance", format!("Crest to trough of {} over the gap", channel.name), caption)
            .with(panel),
    )
}
