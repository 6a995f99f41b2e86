//! The pictures of an estimate.

use super::evidence::evidence;
use super::long_estimate::{FilterFigures, PartFigures};
use super::passings::passings;
use super::twins::{not_drawn, twin};
use crate::estimate::{Trajectory, TrajectoryKind};
use crate::evaluate::MotionErrors;
use crate::recording::SampledRecording;
use crate::results::Verdict;
use crate::results::marks::with_lock;
use crate::results::metrics::consistency;
use crate::results::summary::named;
use crate::results::summary::shown as shown_unit;
use crate::results::tracks::{
    BAND, INPUT, SIGNAL, Tracks, VALUE, of_error, of_prediction, of_reference, of_state, signal_unit,
    state_unit,
};
use crate::results::verdict::{angles_of, words_with};
use crate::units::kind;
use crate::workflow::{RecordingOutcome, SegmentOutcome};
use kalmems_figures::{Axis, Figure, Panel, Series, SeriesRole};
use statrs::distribution::{ChiSquared, ContinuousCDF};
use std::ops::Range;

/// Cycles of the motion that the close-up shows.
const CYCLES: f64 = 4.0;

/// All pictures of one segment; `prefix` keeps the names of several segments apart, and `trusted` is the key of the filter whose motion is shown,
/// where one of them is to be trusted more than others.
pub fn figures(
    recording: &RecordingOutcome,
    segment: &SegmentOutcome,
    prefix: &str,
    trusted: Option<&str>,
) -> Vec<Figure> {
    let drawn =
        SegmentFigures::of(recording, segment, &Tracks::of(recording, segment, prefix), prefix, trusted);
    drawn.pictured().cloned().collect()
}

/// The figures of a segment, by what they are for.
#[derive(Clone, Debug, Default)]
pub(super) struct SegmentFigures {
    /// What the device did.
    pub(super) answer: Vec<Figure>,
    /// How far from a reference that is, and whether the filters are consistent.
    pub(super) judged: Vec<Figure>,
    /// What the innovations look like: on a page alone.
    pub(super) innovations: Vec<Figure>,
    /// The parameters that are states.
    pub(super) parameters: Vec<Figure>,
}

impl SegmentFigures {
    /// The figures of a segment, or of the last part of one of which all has passed through the tracks.
    pub(super) fn of(
        recording: &RecordingOutcome,
        segment: &SegmentOutcome,
        tracks: &Tracks,
        prefix: &str,
        trusted: Option<&str>,
    ) -> Self {
        let mut judged = Vec::new();
        if segment.values.iter().any(|values| !values.is_empty()) {
            judged.push(value_error((recording, segment), tracks, prefix));
        }
        if segment.errors.iter().any(Option::is_some) {
            judged.push(angle_error(segment, tracks, prefix));
            judged.push(phase_error(segment, prefix));
        }
        judged.push(nis(segment, prefix));
        let own = segment.estimate.trajectories.iter().filter(|t| t.kind == TrajectoryKind::Filtered);
        let own = own.filter(|t| !t.parameters.is_empty());
        Self {
            answer: answer((recording, segment), tracks, prefix, trusted),
            judged,
            innovations: evidence(segment, tracks, prefix, trusted),
            parameters: own.map(|t| parameters(segment, tracks, t, prefix)).collect(),
        }
    }

    /// Those that are kept as pictures beside the page.
    pub(super) fn pictured(&self) -> impl Iterator<Item = &Figure> {
        self.answer.iter().chain(&self.judged).chain(&self.parameters)
    }
}

/// The parameters that are states of a filter, over time: on all of their way, and after the settling time, where they move by
/// far less.
fn parameters(segment: &SegmentOutcome, tracks: &Tracks, trajectory: &Trajectory, prefix: &str) -> Figure {
    let settled = trajectory.scored_after(segment.estimate.start_s, segment.estimate.skip_s);
    let caption = "The parameters that are states, as deviations from what the device table says, with three standard deviations on \
                   each side; of each all of its way, and what comes after the settling time.";
    let name = format!("{prefix}parameters_{}", trajectory.key);
    let mut figure = Figure::new(name, format!("Parameters as states, {}", trajectory.name), caption);
    for state in trajectory.parameters.iter().filter_map(|prior| trajectory.state(prior.name)) {
        let (unit, factor) = state_unit(trajectory, state);
        let key = of_state(trajectory, state.name);
        let panel = |samples: Range<usize>, label: String| {
            let each =
                samples.map(|k| (trajectory.time_s[k], factor * state.mean[k], 3.0 * factor * state.sd[k]));
            let (band, mean): (Vec<_>, Vec<_>) =
                each.map(|(t, mean, by)| ((t, mean - by, mean + by), (t, mean))).unzip();
            Panel::new(time_axis(), Axis::new(label, unit))
                .with(tracks.whole(&key, BAND, Series::band("±3σ", SeriesRole::Estimate, band)))
                .with(tracks.whole(&key, VALUE, Series::line(words(state.name), SeriesRole::Estimate, mean)))
        };
        figure = figure.with(panel(0..trajectory.time_s.len(), words(state.name)));
        if settled.start > 0 && !settled.is_empty() {
            figure = figure.with(panel(settled.clone(), format!("{}, settled", words(state.name))));
        }
    }
    figure
}

pub(super) fn time_axis() -> Axis {
    Axis::new("time", "s")
}

/// Stacks panels over one time axis.
pub(super) fn stacked(mut figure: Figure, panels: Vec<Panel>) -> Figure {
    for (i, panel) in panels.into_iter().enumerate() {
        figure = figure.with(if i == 0 { panel } else { panel.sharing_x() });
    }
    figure
}

/// The filter that a close-up shows: the trusted one, or else the first that takes notice of the signal.
fn shown<'a>(segment: &'a SegmentOutcome, trusted: Option<&str>) -> Option<&'a Trajectory> {
    let trajectories = &segment.estimate.trajectories;
    let filtered = || trajectories.iter().filter(|t| t.kind == TrajectoryKind::Filtered);
    let is_trusted = |t: &&Trajectory| trusted == Some(t.key.as_str());
    filtered().find(is_trusted).or_else(|| filtered().next()).or(trajectories.first())
}

/// The smoothed answer of a filter, where there is one: it comes after its filter.
fn smoothed<'a>(segment: &'a SegmentOutcome, filter: &Trajectory) -> Option<&'a Trajectory> {
    let trajectories = &segment.estimate.trajectories;
    let place = trajectories.iter().position(|t| t.key == filter.key)?;
    trajectories.get(place + 1).filter(|t| t.kind == TrajectoryKind::Smoothed)
}

/// The last cycles, and the whole motion where the recording shows that angles were passed.
fn answer(
    (recording, segment): (&RecordingOutcome, &SegmentOutcome),
    tracks: &Tracks,
    prefix: &str,
    trusted: Option<&str>,
) -> Vec<Figure> {
    let whole = shown(segment, trusted).and_then(|filter| passings(recording, segment, filter, prefix));
    std::iter::once(motion((recording, segment), tracks, prefix, trusted)).chain(whole).collect()
}

/// Drive, signal and angle over the last cycles.
fn motion(
    (recording, segment): (&RecordingOutcome, &SegmentOutcome),
    tracks: &Tracks,
    prefix: &str,
    trusted: Option<&str>,
) -> Figure {
    let estimate = &segment.estimate;
    let end = estimate.segment.time.at(estimate.segment.time.len().saturating_sub(1));
    let start = end - CYCLES / estimate.motion.frequency_hz;
    let and_reference = if recording.reference.is_some() { ", and the reference" } else { "" };
    let caption = format!(
        "The last cycles of the recording. Top: the recorded drive. Middle: the recorded signal and what the filter predicted \
         for each sample before it saw it. Bottom: the angle with three standard deviations on each side, often too narrow to \
         be seen here{and_reference}."
    );
    let mut panels = Vec::new();
    let column = |name: &str| channel(&recording.recording, name, segment);
    let Some(trajectory) = shown(segment, trusted) else { return Figure::new(prefix, "", "") };
    let from = trajectory.time_s.partition_point(|t| *t < start);
    let time = &trajectory.time_s[from..];
    let zip = |values: &[f64]| -> Vec<(f64, f64)> {
        time.iter().copied().zip(values.get(from..).unwrap_or_default().iter().copied()).collect()
    };

    // A device that is not driven has no column of it.
    if !estimate.drive_column.is_empty() {
        let drive = zip(&column(&estimate.drive_column));
        let label = recording.input;
        let panel = Panel::new(time_axis(), Axis::new(label, "V"));
        panels.push(panel.with(tracks.whole(INPUT, VALUE, Series::line(label, SeriesRole::Input, drive))));
    }

    let signal = column(&estimate.signal_column);
    let predicted: Vec<f64> = signal.iter().zip(&trajectory.innovation).map(|(y, r)| y - r).collect();
    let (unit, factor) = signal_unit(estimate);
    let scaled = |values: &[f64]| zip(values).into_iter().map(move |(t, y)| (t, y * factor));
    panels.push(
        Panel::new(time_axis(), Axis::new("signal", unit))
            .with(tracks.whole(
                SIGNAL,
                VALUE,
                Series::points("measured", SeriesRole::Measured, scaled(&signal)),
            ))
            .with(tracks.whole(
                &of_prediction(trajectory),
                VALUE,
                Series::line(
                    format!("predicted, {}", trajectory.name),
                    SeriesRole::Estimate,
                    scaled(&predicted),
                ),
            )),
    );

    let model = segment.estimate.trajectories.iter().find(|t| t.kind == TrajectoryKind::ModelAlone);
    let model = model.filter(|model| model.key != trajectory.key);
    for angle in trajectory.states.iter().filter(|state| state.kind.name == kind::ANGLE.name) {
        let degrees: Vec<f64> = angle.mean.iter().map(|a| a.to_degrees()).collect();
        let mut panel = Panel::new(time_axis(), Axis::new(words(angle.name), "deg"));
        if let Some(reference) = reference_window(recording, segment, angle.name, start, end) {
            let reference = Series::line("reference", SeriesRole::Reference, reference);
            panel = panel.with(tracks.whole(&of_reference(angle.name), VALUE, reference));
        }
        let key = of_state(trajectory, angle.name);
        if !angle.sd.is_empty() {
            let band: Vec<(f64, f64, f64)> = (from..trajectory.time_s.len())
                .map(|k| {
                    let (mean, sd) = (degrees[k], 3.0 * angle.sd[k].to_degrees());
                    (trajectory.time_s[k], mean - sd, mean + sd)
                })
                .collect();
            panel = panel.with(tracks.whole(&key, BAND, Series::band("±3σ", SeriesRole::Estimate, band)));
        }
        let own = Series::line(&trajectory.name, SeriesRole::Estimate, zip(&degrees));
        panel = panel.with(tracks.whole(&key, VALUE, own));
        if let Some(model) = model
            && let Some(angle) = model.state(angle.name)
        {
            let degrees: Vec<f64> = angle.mean.iter().map(|a| a.to_degrees()).collect();
            let own = Series::line(&model.name, SeriesRole::Model, zip(&degrees));
            panel = panel.with(tracks.whole(&of_state(model, angle.name), VALUE, own));
        }
        if let Some(later) = smoothed(segment, trajectory)
            && let Some(angle) = later.state(angle.name)
        {
            let degrees: Vec<f64> = angle.mean.iter().map(|a| a.to_degrees()).collect();
            let own = Series::line(&later.name, SeriesRole::Other, zip(&degrees));
            panel = panel.with(tracks.whole(&of_state(later, angle.name), VALUE, own));
        }
        panels.push(panel);
    }
    let Some(of) = compared(recording, segment) else {
        return stacked(Figure::new(format!("{prefix}motion"), "Drive, signal and angle", caption), panels);
    };
    let caption = format!(
        "The end of the recording: the recorded input, where there is one, the recorded signal with what the filter \
         predicted for each sample before it saw it, and the {of} with three standard deviations on each side{and_reference}."
    );
    panels.push(value_panel((recording, segment), tracks, trajectory, of, (start, end)));
    stacked(Figure::new(format!("{prefix}motion"), format!("Signal and {of}"), caption), panels)
}

/// What the device is for, where that is no angle; the first state, where no filter tells it.
fn compared(recording: &RecordingOutcome, segment: &SegmentOutcome) -> Option<&'static str> {
    let wanted = recording.values.first()?.name;
    let trajectories = &segment.estimate.trajectories;
    if trajectories.iter().any(|trajectory| trajectory.state(wanted).is_some()) {
        return Some(wanted);
    }
    Some(trajectories.first()?.states.first()?.name)
}

/// A state and its reference between two times.
fn value_panel(
    (recording, segment): (&RecordingOutcome, &SegmentOutcome),
    tracks: &Tracks,
    trajectory: &Trajectory,
    of: &str,
    (start, end): (f64, f64),
) -> Panel {
    let Some(state) = trajectory.state(of) else { return Panel::new(time_axis(), Axis::new(of, "")) };
    let (unit, factor) = shown_unit(state.unit);
    let within = |times: &[f64], values: &[f64]| -> Vec<(f64, f64)> {
        let all = times.iter().zip(values);
        all.filter(|(t, _)| (start..=end).contains(*t)).map(|(t, v)| (*t, v * factor)).collect()
    };
    let mut panel = Panel::new(time_axis(), Axis::new(words(of), unit));
    let own = &segment.estimate.segment;
    let references = recording.reference.as_ref().and_then(|reference| reference.values_of(own).ok());
    let reference = references.iter().flatten().find(|reference| reference.state.name == of);
    if let Some(reference) = reference {
        let line = within(&reference.time_s, &reference.value);
        let own = Series::line("reference", SeriesRole::Reference, line);
        panel = panel.with(tracks.whole(&of_reference(of), VALUE, own));
    }
    let key = of_state(trajectory, of);
    let mean = within(&trajectory.time_s, &state.mean);
    if !state.sd.is_empty() {
        let sd = within(&trajectory.time_s, &state.sd);
        let band = mean.iter().zip(sd).map(|((t, v), (_, sd))| (*t, v - 3.0 * sd, v + 3.0 * sd));
        panel = panel.with(tracks.whole(&key, BAND, Series::band("±3σ", SeriesRole::Estimate, band)));
    }
    panel = panel.with(tracks.whole(&key, VALUE, Series::line(&trajectory.name, SeriesRole::Estimate, mean)));
    if let Some(later) = smoothed(segment, trajectory)
        && let Some(state) = later.state(of)
    {
        let mean = Series::line(&later.name, SeriesRole::Other, within(&later.time_s, &state.mean));
        panel = panel.with(tracks.whole(&of_state(later, of), VALUE, mean));
    }
    panel
}

/// The error of what the device is for after the settling time, filter by filter.
fn value_error(
    (recording, segment): (&RecordingOutcome, &SegmentOutcome),
    tracks: &Tracks,
    prefix: &str,
) -> Figure {
    let of = compared(recording, segment).unwrap_or_default();
    let caption = format!(
        "The {of}, estimate minus reference after the settling time, with three of the filter's own standard deviations \
         on each side. Each panel has its own scale.{}",
        not_drawn(&segment.estimate)
    );
    let pairs = segment.estimate.trajectories.iter().zip(&segment.values);
    let pairs = pairs.filter(|(trajectory, _)| twin(&segment.estimate, trajectory).is_none());
    let panels = pairs.filter_map(|(trajectory, values)| {
        let errors = values.get(of)?;
        let (unit, factor) = shown_unit(errors.unit);
        let series = &errors.error;
        let mut panel = Panel::new(time_axis(), Axis::new("error", unit));
        let sds = series.time_s.iter().zip(&series.sd);
        if !series.sd.is_empty() {
            let band = sds.map(|(t, sd)| (*t, -3.0 * sd * factor, 3.0 * sd * factor));
            let band = Series::band("±3σ", role(trajectory), band);
            panel = panel.with(tracks.whole(&of_error(trajectory, of), BAND, band));
        }
        let points = series.time_s.iter().zip(&series.error).map(|(t, e)| (*t, e * factor));
        let own = Series::line(label(trajectory, segment, None), role(trajectory), points);
        let panel = panel.with(tracks.whole(&of_error(trajectory, of), VALUE, own));
        Some(with_lock(tracks.gaps.shaded(panel), trajectory))
    });
    let title = format!("Error of {}", named(of));
    stacked(Figure::new(format!("{prefix}{of}_error"), title, caption), panels.collect())
}

fn channel(recording: &SampledRecording, name: &str, segment: &SegmentOutcome) -> Vec<f64> {
    recording.column(name).map(|column| column.of(&segment.estimate.segment).to_vec()).unwrap_or_default()
}

/// The reference's angle between two times, in s and degrees.
fn reference_window(
    recording: &RecordingOutcome,
    segment: &SegmentOutcome,
    angle: &str,
    start: f64,
    end: f64,
) -> Option<Vec<(f64, f64)>> {
    let references = recording.reference.as_ref()?.angles_of(&segment.estimate.segment).ok()?;
    let reference = references.iter().find(|reference| reference.states[0] == angle)?;
    let samples = reference.time_s.iter().zip(&reference.angle);
    Some(samples.filter(|(t, _)| (start..=end).contains(*t)).map(|(t, a)| (*t, a.to_degrees())).collect())
}

/// The error of the angle after the settling time, filter by filter.
fn angle_error(segment: &SegmentOutcome, tracks: &Tracks, prefix: &str) -> Figure {
    let caption = format!(
        "Estimate minus reference after the settling time, with three of the filter's own standard deviations on each side. \
         Each panel has its own scale.{}",
        not_drawn(&segment.estimate)
    );
    let panels = with_errors(segment).map(|(trajectory, errors)| {
        let series = &errors.error;
        let mut panel = Panel::new(time_axis(), Axis::new(format!("{} error", words(errors.of)), "deg"));
        let error = series.time_s.iter().zip(&series.error).map(|(t, e)| (*t, e.to_degrees()));
        let key = of_error(trajectory, errors.of);
        let own = Series::line(label(trajectory, segment, Some(errors.of)), role(trajectory), error);
        panel = panel.with(tracks.whole(&key, VALUE, own));
        if !series.sd.is_empty() {
            let band = series.time_s.iter().zip(&series.sd).map(|(t, sd)| {
                let sd = 3.0 * sd.to_degrees();
                (*t, -sd, sd)
            });
            panel = panel.with(tracks.whole(&key, BAND, Series::band("±3σ", role(trajectory), band)));
        }
        with_lock(tracks.gaps.shaded(panel), trajectory)
    });
    stacked(Figure::new(format!("{prefix}angle_error"), "Error of the angle", caption), panels.collect())
}

/// The error of each peak's timing, filter by filter.
fn phase_error(segment: &SegmentOutcome, prefix: &str) -> Figure {
    let caption = "The error of the phase shift at each angle peak, in degrees of the motion's cycle: when the \
                   estimated angle turns round, against when the reference does. Each panel has its own scale.";
    let panels = with_errors(segment).map(|(trajectory, errors)| {
        let points = errors.phase.iter().map(|p| (p.time_s, p.error_deg));
        Panel::new(time_axis(), Axis::new(errors.of.replace("angle", "phase error").replace('_', " "), "deg"))
            .with(Series::points(label(trajectory, segment, Some(errors.of)), role(trajectory), points))
            .with(Series::level("", SeriesRole::Bound, 0.0))
    });
    stacked(
        Figure::new(format!("{prefix}phase_error"), "Error of the phase shift", caption),
        panels.collect(),
    )
}

/// A state's name for people: `angle_x` as "angle x".
fn words(name: &str) -> String {
    name.replace('_', " ")
}

/// Each filter that is drawn with its errors, angle by angle.
fn with_errors(segment: &SegmentOutcome) -> impl Iterator<Item = (&Trajectory, &MotionErrors)> {
    let pairs = segment.estimate.trajectories.iter().zip(&segment.errors);
    let pairs = pairs.filter(|(trajectory, _)| twin(&segment.estimate, trajectory).is_none());
    pairs.flat_map(|(t, e)| e.iter().flat_map(MotionErrors::each).map(move |e| (t, e)))
}

/// The NIS averaged over each cycle of the motion, with the interval that it should keep to.
fn nis(segment: &SegmentOutcome, prefix: &str) -> Figure {
    let estimate = &segment.estimate;
    let interval = estimate.segment.time.interval_s().unwrap_or(1.0);
    let samples = estimate.trajectories.iter().map(|trajectory| trajectory.time_s.len()).max().unwrap_or(1);
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    // a positive count, or as many as there are
    let window =
        ((1.0 / (estimate.motion.frequency_hz * interval)).round().max(1.0) as usize).min(samples.max(1));
    let caption = format!(
        "The normalised innovation squared over the whole recording, averaged over each cycle of the motion \
         ({window} samples), and the interval that holds 95 % of such averages if the filter is right. Above it \
         the filter claims to know more than it does; below it, less. Points are single samples that were rejected as \
         outliers.{}",
        not_drawn(estimate)
    );
    // A smoother's innovations are its filter's.
    let filters = estimate.trajectories.iter().filter(|t| t.kind == TrajectoryKind::Filtered);
    let filters = filters.filter(|trajectory| twin(estimate, trajectory).is_none());
    let panels = filters.map(|trajectory| {
        let mut panel = Panel::new(time_axis(), Axis::new("mean NIS", "1").log());
        if let Ok(chi) = ChiSquared::new(window as f64) {
            let bound = |p: f64| chi.inverse_cdf(p) / window as f64;
            let ends = [trajectory.time_s.first(), trajectory.time_s.last()];
            let band = ends.into_iter().flatten().map(|t| (*t, bound(0.025), bound(0.975)));
            panel = panel.with(Series::band("95 % of χ²", SeriesRole::Bound, band));
        }
        let means = windowed(&trajectory.time_s, &trajectory.nis, window);
        panel = panel.with(Series::line(label(trajectory, segment, None), role(trajectory), means));
        if trajectory.rejected.is_empty() {
            return panel;
        }
        let rejected = trajectory.rejected.iter().map(|one| (one.time_s, one.size().powi(2)));
        panel.with(Series::points("rejected", SeriesRole::Measured, rejected))
    });
    stacked(Figure::new(format!("{prefix}nis"), "Consistency", caption), panels.collect())
}

/// The means of each window of samples at the time of its middle; without a number where a window has none.
fn windowed(time_s: &[f64], values: &[f64], window: usize) -> Vec<(f64, f64)> {
    let chunks = time_s.chunks_exact(window).zip(values.chunks_exact(window));
    chunks
        .map(|(t, v)| {
            let finite = v.iter().filter(|v| v.is_finite());
            let (count, sum) = finite.fold((0_usize, 0.0), |(n, s), v| (n + 1, s + v));
            let mean = if count > 0 { sum / count as f64 } else { f64::NAN };
            (t[window / 2], mean)
        })
        .collect()
}

/// How the filters fared from part to part of a long recording.
pub(super) fn course(parts: &[PartFigures], prefix: &str) -> Figure {
    let caption = "The whole recording, part by part. Top: the mean of the normalised innovation squared, 1 for a filter that \
                   is right. Bottom: the root mean square error of the angle, where there is a reference. The other pictures \
                   show the last part.";
    let names: Vec<&String> =
        parts.first().map_or_else(Vec::new, |p| p.filters.iter().map(|f| &f.0).collect());
    let panel = |label: &str, unit: &str, of: fn(&FilterFigures) -> Option<f64>| {
        let mut panel = Panel::new(time_axis(), Axis::new(label, unit).log());
        let mut any = false;
        for (i, name) in names.iter().enumerate() {
            let points = parts.iter().filter_map(|part| Some((part.time_s, of(part.filters.get(i)?)?)));
            let points: Vec<(f64, f64)> = points.collect();
            any |= !points.is_empty();
            if !points.is_empty() {
                panel = panel.with(Series::line(name.as_str(), SeriesRole::Estimate, points));
            }
        }
        any.then_some(panel)
    };
    let panels = [panel("mean NIS", "1", |f| f.1), panel("angle RMSE", "deg", |f| f.2)];
    let figure = Figure::new(format!("{prefix}course"), "Part by part", caption);
    stacked(figure, panels.into_iter().flatten().collect())
}

/// The filter's name; with a warning where its answer is none for this angle, or for any.
pub(super) fn label(trajectory: &Trajectory, segment: &SegmentOutcome, angle: Option<&str>) -> String {
    let position = segment.estimate.trajectories.iter().position(|t| t.key == trajectory.key);
    let errors = position.and_then(|i| segment.errors.get(i)).and_then(Option::as_ref);
    let consistency = consistency(trajectory, &segment.estimate);
    let stopped = trajectory.failure.is_some();
    match Verdict::of(trajectory.kind, (stopped, &trajectory.lock), errors, consistency.as_ref()) {
        bad @ (Verdict::LostLock | Verdict::Failed | Verdict::WrongSign | Verdict::Astray) => {
            let angles = angles_of(bad, &trajectory.lock, errors);
            match angle {
                Some(angle) if angles.contains(&angle) => format!("{} ({})", trajectory.name, bad.words()),
                Some(_) if !angles.is_empty() => trajectory.name.clone(),
                _ => format!("{} ({})", trajectory.name, words_with(bad, &angles)),
            }
        }
        _ => trajectory.name.clone(),
    }
}

pub(super) fn role(trajectory: &Trajectory) -> SeriesRole {
    if trajectory.kind == TrajectoryKind::ModelAlone { SeriesRole::Model } else { SeriesRole::Estimate }
}

#[cfg(test)]
mod tests {
    use super::windowed;

    #[test]
    fn windows_average_what_is_there() {
        let time: Vec<f64> = (0..7).map(f64::from).collect();
        let means = windowed(&time, &[1.0, f64::NAN, 3.0, f64::NAN, f64::NAN, f64::NAN, 9.0], 3);
        assert_eq!(means[0], (1.0, 2.0));
        assert!(means[1].0 == 4.0 && means[1].1.is_nan() && means.len() == 2);
    }
}
