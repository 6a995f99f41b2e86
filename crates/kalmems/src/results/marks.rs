//! What a reader must see on a time axis beside the curves: where there are no samples, and when a filter lost the signal.

use crate::estimate::{LockEvent, Trajectory};
use crate::signal::GAP;
use kalmems_figures::{Panel, Series, SeriesRole, Shape};

/// Gaps that are marked; a recording with more of them has no picture that could show them.
const MOST: usize = 500;

/// Where a segment has no samples of its signal, as its samples pass.
#[derive(Clone, Debug, Default)]
pub(super) struct SignalGaps {
    spans: Vec<[f64; 2]>,
    last_s: Option<f64>,
}

impl SignalGaps {
    /// Takes the next samples, which are usually `interval_s` apart; a sample that is not a number is none.
    pub(super) fn take(&mut self, samples: impl Iterator<Item = (f64, f64)>, interval_s: f64) {
        for (time_s, _) in samples.filter(|(_, value)| value.is_finite()) {
            let before = self.last_s.replace(time_s);
            if let Some(before) = before.filter(|before| time_s - before > GAP * interval_s)
                && self.spans.len() < MOST
                && interval_s > 0.0
            {
                self.spans.push([before, time_s]);
            }
        }
    }

    /// The panel with its gaps shaded from its lowest to its highest value.
    pub(super) fn shaded(&self, panel: Panel) -> Panel {
        let Some([low, high]) = extent(&panel).filter(|_| !self.spans.is_empty()) else { return panel };
        // What is not a number between two gaps keeps them apart.
        let corners: Vec<(f64, f64, f64)> = (self.spans.iter())
            .flat_map(|[from, to]| [(*from, low, high), (*to, low, high), (*to, f64::NAN, f64::NAN)])
            .collect();
        panel.with(Series::band("no samples", SeriesRole::Measured, corners))
    }
}

/// The panel with points where the filter lost the signal, found it again or went over to another branch; `of` is the angle that is shown.
pub(super) fn with_lock(panel: Panel, trajectory: &Trajectory) -> Panel {
    let mut panel = panel;
    let events = &trajectory.lock.events;
    let times = |of: fn(&LockEvent) -> Option<f64>| -> Vec<(f64, f64)> {
        events.iter().filter_map(of).map(|time_s| (time_s, 0.0)).collect()
    };
    let lost = times(|event| match event {
        LockEvent::Lost { time_s, .. } | LockEvent::Stopped { time_s, .. } => Some(*time_s),
        _ => None,
    });
    let flipped =
        times(|event| if let LockEvent::Flipped { time_s, .. } = event { Some(*time_s) } else { None });
    let regained = times(|event| match event {
        LockEvent::Regained { time_s, .. } | LockEvent::StartedAgain { time_s, .. } => Some(*time_s),
        _ => None,
    });
    let all = [("signal lost", lost), ("signal found again", regained), ("other branch", flipped)];
    for (label, points) in all {
        if !points.is_empty() {
            panel = panel.with(Series::points(label, SeriesRole::Model, points));
        }
    }
    with_lost(panel, trajectory)
}

/// The panel with the time shaded in which the signal is lost or the filter settles again.
fn with_lost(panel: Panel, trajectory: &Trajectory) -> Panel {
    let ends = trajectory.time_s.first().zip(trajectory.time_s.last());
    let (Some((first_s, last_s)), Some([low, high])) = (ends, extent(&panel)) else { return panel };
    let spans = trajectory.lock.lost_spans.iter().take(MOST);
    let spans = spans.map(|[from_s, to_s]| [from_s.max(*first_s), to_s.min(*last_s)]);
    let spans: Vec<[f64; 2]> = spans.filter(|[from_s, to_s]| from_s < to_s).collect();
    if spans.is_empty() {
        return panel;
    }
    panel.with(Series::spans("no estimate", SeriesRole::Model, &spans, [low, high]))
}

/// The lowest and the highest value of a panel's series; nothing where there is none.
fn extent(panel: &Panel) -> Option<[f64; 2]> {
    let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
    let mut see = |a: f64, b: f64| (low, high) = (low.min(a), high.max(b));
    for series in &panel.series {
        match series.shape() {
            Shape::Line(runs) => runs.iter().flatten().for_each(|p| see(p[1], p[1])),
            Shape::Points(points) => points.iter().for_each(|p| see(p[1], p[1])),
            Shape::Band(runs) => runs.iter().flatten().for_each(|p| see(p[1], p[2])),
            Shape::Level(value) => see(*value, *value),
            Shape::Map(_) => {}
        }
    }
    (low <= high).then_some([low, high])
}

#[cfg(test)]
mod tests {
    use super::*;
    use kalmems_figures::Axis;

    #[test]
    fn gaps_are_shaded_over_the_height_of_a_panel_and_missing_values_count() {
        let mut gaps = SignalGaps::default();
        let value = |k: u32| if (20..30).contains(&k) { f64::NAN } else { f64::from(k % 2) };
        let samples = (0..100).filter(|k| !(50..60).contains(k)).map(|k| (f64::from(k), value(k)));
        let (first, second): (Vec<_>, Vec<_>) = samples.partition(|(t, _)| *t < 55.0);
        // In parts as they come.
        gaps.take(first.into_iter(), 1.0);
        gaps.take(second.into_iter(), 1.0);
        assert_eq!(gaps.spans, [[19.0, 30.0], [49.0, 60.0]]);
        let panel = || Panel::new(Axis::new("time", "s"), Axis::new("signal", "V"));
        let own =
            Series::line("signal", SeriesRole::Measured, (0..100).map(|k| (f64::from(k), f64::from(k % 7))));
        let shaded = gaps.shaded(panel().with(own));
        let Shape::Band(runs) = shaded.series[1].shape() else { panic!("no band") };
        assert_eq!(runs.len(), 2);
        assert_eq!(runs[0], [[19.0, 0.0, 6.0], [30.0, 0.0, 6.0]]);
        assert!(gaps.shaded(panel()).series.is_empty());
        assert!(
            SignalGaps::default()
                .shaded(panel().with(Series::level("", SeriesRole::Bound, 1.0)))
                .series
                .len()
                == 1
        );
    }
}
