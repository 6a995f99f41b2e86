//! The pictures of a motion along a line.

use super::figures::{CYCLES, channel, label, role, shown, stacked, time_axis};
use crate::report::{Axis, Figure, Panel, Role, Series};
use crate::workflow::{RecordingOutcome, SegmentOutcome};

/// The last cycles, and the errors where there is a reference.
pub fn figures(recording: &RecordingOutcome, segment: &SegmentOutcome, prefix: &str) -> Vec<Figure> {
    let mut figures = vec![motion(recording, segment, prefix)];
    if segment.positions.iter().any(Option::is_some) {
        figures.push(position_error(segment, prefix));
    }
    figures
}

/// Signal and position over the last cycles.
fn motion(recording: &RecordingOutcome, segment: &SegmentOutcome, prefix: &str) -> Figure {
    let estimate = &segment.estimate;
    let end = estimate.segment.time.at(estimate.segment.time.len().saturating_sub(1));
    let start = end - CYCLES / estimate.motion.frequency_hz;
    let Some(trajectory) = shown(segment) else { return Figure::new(prefix, "", "") };
    let from = trajectory.time_s.partition_point(|t| *t < start);
    let window = |values: &[f64], scale: f64| -> Vec<(f64, f64)> {
        let values = values.get(from..).unwrap_or_default().iter().map(|v| v * scale);
        trajectory.time_s[from..].iter().copied().zip(values).collect()
    };
    let signal = channel(&recording.recording, &estimate.signal_column, segment);
    let predicted: Vec<f64> = signal.iter().zip(&trajectory.innovation).map(|(y, r)| y - r).collect();
    let mut panels = vec![
        Panel::new(time_axis(), Axis::new("capacitance", "fF"))
            .with(Series::points("measured", Role::Measured, window(&signal, 1e15)))
            .with(Series::line(
                format!("predicted, {}", trajectory.name),
                Role::Estimate,
                window(&predicted, 1e15),
            )),
    ];
    if let Some(position) = trajectory.state("position") {
        let mut panel = Panel::new(time_axis(), Axis::new("position", "µm"));
        let references = recording.reference.as_ref().map(|r| r.segment(&estimate.segment.label));
        if let Some(reference) = references.and_then(Result::ok).and_then(|all| all.into_iter().next()) {
            let samples = reference.time_s.iter().copied().zip(reference.angle.iter().map(|p| p * 1e6));
            let samples = samples.filter(|(t, _)| (start..=end).contains(t));
            panel = panel.with(Series::line("reference", Role::Reference, samples));
        }
        panels.push(panel.with(Series::line(&trajectory.name, Role::Estimate, window(&position.mean, 1e6))));
    }
    let caption = "The last cycles of the recording. Top: the recorded capacitance and what the filter predicted for \
                   each sample before it saw it. Bottom: the distance from the electrode, and the reference.";
    stacked(Figure::new(format!("{prefix}motion"), "Signal and position", caption), panels)
}

/// The error of the position after the settling time, filter by filter.
fn position_error(segment: &SegmentOutcome, prefix: &str) -> Figure {
    let caption = "Estimate minus reference after the settling time, with three of the estimator's own standard \
                   deviations on each side. Each panel has its own scale.";
    let pairs = segment.estimate.trajectories.iter().zip(&segment.positions);
    let panels = pairs.filter_map(|(trajectory, errors)| {
        let series = &errors.as_ref()?.error;
        let error = series.time_s.iter().zip(&series.error).map(|(t, e)| (*t, e * 1e9));
        let mut panel = Panel::new(time_axis(), Axis::new("position error", "nm")).with(Series::line(
            label(trajectory, segment, None),
            role(trajectory),
            error,
        ));
        if !series.sd.is_empty() {
            let band = series.time_s.iter().zip(&series.sd).map(|(t, sd)| (*t, -3e9 * sd, 3e9 * sd));
            panel = panel.with(Series::band("±3σ", Role::Bound, band));
        }
        Some(panel)
    });
    stacked(
        Figure::new(format!("{prefix}position_error"), "Error of the position", caption),
        panels.collect(),
    )
}
