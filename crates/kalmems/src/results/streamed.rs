//! What was estimated while samples arrived, as a page at the end.

use super::tracks::{BAND, SignalInnovations, Tracks, VALUE, is_shown, of_state, state_unit};
use crate::config::Experiment;
use crate::estimate::{SegmentEstimate, Trajectory, TrajectoryKind};
use crate::stream::StreamSummary;
use crate::topics::{explained, link};
use kalmems_figures::{Axis, Figure, NoticeSeverity, Page, PagePart, PageSection, Panel, Series, SeriesRole};

/// What a page shows of a stream, in memory that does not grow with it.
#[derive(Clone, Debug, Default)]
pub(crate) struct StreamTracks {
    tracks: Tracks,
    answers: Vec<Answer>,
}

/// What is known of an answer before any sample.
#[derive(Clone, Debug)]
struct Answer {
    name: String,
    /// Label, unit and key of each state that is shown.
    states: Vec<(String, &'static str, String)>,
    /// Label, unit and key of its innovations by each signal; a smoother has its filter's.
    innovations: Vec<(String, &'static str, String)>,
}

impl StreamTracks {
    /// Takes what the filters say of the next samples.
    pub(crate) fn take(&mut self, estimate: &SegmentEstimate, wanted: Option<&str>) {
        if self.answers.is_empty() {
            let of = |trajectory: &Trajectory| {
                let shown = trajectory.states.iter().filter(|state| is_shown(trajectory, state, wanted));
                let states = shown.map(|state| {
                    let (unit, _) = state_unit(trajectory, state);
                    (state.name.replace('_', " "), unit, of_state(trajectory, state.name))
                });
                let has_own = trajectory.kind == TrajectoryKind::Filtered;
                let own = has_own.then(|| SignalInnovations::of(trajectory, estimate)).into_iter().flatten();
                let innovations = own.map(|one| (one.label(), one.unit.0, one.key)).collect();
                Answer { name: trajectory.name.clone(), states: states.collect(), innovations }
            };
            self.answers = estimate.trajectories.iter().map(of).collect();
        }
        self.tracks.answers(estimate, wanted);
    }

    fn panel(&self, (label, unit): (&str, &str), key: &str, name: &str, role: SeriesRole) -> Option<Panel> {
        let track = self.tracks.get(key)?;
        Some(
            Panel::new(Axis::new("time", "s"), Axis::new(label, unit))
                .with(Series::of_track("±3σ", role, track, BAND))
                .with(Series::of_track(name, SeriesRole::Estimate, track, VALUE)),
        )
    }

    fn figure(id: &str, title: &str, caption: &str, panels: impl Iterator<Item = Panel>) -> Figure {
        let panels = panels.enumerate().map(|(k, panel)| if k > 0 { panel.sharing_x() } else { panel });
        panels.fold(Figure::new(id, title, caption), Figure::with)
    }

    /// The page. How long samples took on their way is none of it, as it differs from run to run.
    pub(crate) fn page(&self, experiment: &Experiment, summary: &StreamSummary) -> Page {
        let verdict = PageSection::new("Verdict").part(PagePart::Verdict);
        let mut verdict = summary.answer.iter().fold(verdict, PageSection::paragraph);
        for (severity, text) in reasons(summary) {
            verdict = verdict.notice(severity, text);
        }
        let states = self.answers.iter().flat_map(|answer| {
            answer.states.iter().filter_map(|(label, unit, key)| {
                self.panel((label, unit), key, &answer.name, SeriesRole::Estimate)
            })
        });
        let motion = Self::figure("stream", "Motion", "What each filter said when the samples came.", states);
        let innovations = self.answers.iter().flat_map(|answer| {
            answer.innovations.iter().filter_map(|(label, unit, key)| {
                self.panel((label, unit), key, &answer.name, SeriesRole::Bound)
            })
        });
        let caption =
            "The signal minus what the filter predicted for it, with three standard deviations on each side.";
        let innovations = Self::figure("innovations", "Innovations", caption, innovations);
        let counts =
            serde_json::to_string_pretty(summary).unwrap_or_else(|e| format!("cannot be written: {e}"));
        let toml = experiment.to_toml().unwrap_or_else(|e| format!("cannot be written: {e}"));
        let made = PageSection::made("stream", env!("CARGO_PKG_VERSION"), "")
            .preformatted("What came of it, as JSON", counts)
            .preformatted("The experiment as it was understood", toml);
        let subtitle = experiment.description.clone().unwrap_or_default();
        let notes = summary.diagnosis.iter().map(ToString::to_string).collect();
        let page = Page::new(format!("{}: a stream", experiment.name), subtitle)
            .with(verdict.notes(notes))
            .with(PageSection::new("Motion").figure(motion))
            .with(PageSection::new("Innovations").part(PagePart::Evidence).figure(innovations))
            .with(made);
        explained(page)
    }
}

/// What a reader must know of a stream.
fn reasons(summary: &StreamSummary) -> Vec<(NoticeSeverity, String)> {
    let mut reasons = Vec::new();
    if let Some(broken) = &summary.broken {
        reasons.push((
            NoticeSeverity::Failure,
            format!("The connection broke after {} samples: {}.", broken.samples, broken.why),
        ));
    }
    for (count, what) in [
        (summary.not_estimated, "samples could not be estimated"),
        (summary.received.order.dropped, "samples never came"),
        (summary.noise_only, "times the signal was noise only"),
    ] {
        if count > 0 {
            reasons.push((NoticeSeverity::Warning, format!("{count} {what}{}.", link("findings"))));
        }
    }
    let severity = if reasons.is_empty() { NoticeSeverity::Ok } else { NoticeSeverity::Note };
    let stopped = if summary.interrupted { "; it was stopped" } else { "" };
    let text =
        format!("{} samples were estimated, with {} events{stopped}.", summary.estimated, summary.events);
    reasons.push((severity, text));
    reasons
}
