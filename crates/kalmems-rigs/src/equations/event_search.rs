//! What is kept of the events of a segment from one part to the next, and when they happened in a part.

use super::EquationColumns;
use super::event_times::{EventTimes, FoundEvents};
use super::events::{EventSettings, EventTimeSource};
use super::input_part::InputPart;
use super::names;
use super::settings::EquationSettings;
use super::waveform::EquationWaveform;
use crate::config::{ConfigFault, Experiment, Key};
use crate::crossings::{CrossingWaveform, RowsNeeded, SearchState, SearchedSignal, judge_crossings};
use crate::estimate::driven::SegmentDrive;
use crate::estimate::{EstimateError, SignalSegment};
use crate::signal::SLOPE_REACH;
use crate::units::kind;
use std::borrow::Cow;
use std::sync::Arc;

/// The searches for the events that a signal shows, in the order of the settings; none for one that is recorded.
pub struct EventSearches(Vec<Option<EventSearch>>);

/// One of them.
struct EventSearch {
    kept: SearchState,
    /// What inputs add to the signal, which is taken off.
    input_part: Option<InputPart>,
    /// Whether the device swings through the event, so that its signal has to cross the level.
    is_passed: bool,
}

impl EquationSettings {
    /// The rows that events need around the new ones in a recording of this interval in s.
    pub fn needed(&self, interval_s: f64) -> RowsNeeded {
        let of = |(place, event): (usize, &EventSettings)| self.needed_by(place, event, interval_s);
        self.events
            .iter()
            .enumerate()
            .map(of)
            .reduce(RowsNeeded::and)
            .unwrap_or(RowsNeeded { before: 0, after: 0 })
    }

    fn needed_by(&self, place: usize, event: &EventSettings, interval_s: f64) -> RowsNeeded {
        let uses = self.filters.iter().flat_map(|filter| &filter.events);
        event.needed(uses.filter(|used| used.event == place).map(|used| used.delivery), interval_s)
    }
}

impl EventSearches {
    /// At the beginning of a segment, or as another run left them, which has written these numbers; `variances` are those of a sample of
    /// each measurement.
    pub fn of(
        settings: &EquationSettings,
        variances: &[Option<f64>],
        segment: &SignalSegment,
        mut written: &[f64],
    ) -> Result<Self, EstimateError> {
        let mut searches = Vec::new();
        for event in &settings.events {
            let EventTimeSource::Signal { measure, level, falls, detector } = event.source else {
                searches.push(None);
                continue;
            };
            let noise_variance = variances.get(measure).copied().flatten().unwrap_or(0.0);
            // Of a device that does not oscillate, crossings follow each other as far apart as its detector tells them apart.
            let passes_hz = settings
                .own
                .natural_hz()
                .map_or(detector.separation_s.recip(), |natural_hz| 2.0 * natural_hz);
            let of = (event.event, measure);
            let line = |interval_s| EquationWaveform::of(&settings.own, of, interval_s);
            let sought = |interval_s| {
                let line = line(interval_s).map(|line| Arc::new(line) as Arc<dyn CrossingWaveform>);
                let sought = SearchedSignal { interval_s, noise_variance, level, falls, passes_hz, line };
                Some((sought, detector))
            };
            let kept = SearchState::of(sought, segment, next_search(&mut written));
            let kept = kept.map_err(|why| EstimateError::Detector { place: segment.place.clone(), why })?;
            let is_passed = line(segment.interval_s).is_some();
            let input_part = InputPart::of(&settings.own, measure);
            searches.push(Some(EventSearch { kept, input_part, is_passed }));
        }
        Ok(Self(searches))
    }

    /// Looks for events in the rows of a part, under these inputs, which bend at some rows; refuses a signal that does not cross its level as that of the device has to. What a
    /// long segment is refused for at its end comes back, for when all of the recording was taken.
    pub fn look(
        &mut self,
        settings: &EquationSettings,
        columns: &EquationColumns<'_>,
        (segment, inputs, bends): (&SignalSegment, &[SegmentDrive<'_>], &[usize]),
    ) -> Result<Option<EstimateError>, EstimateError> {
        let mut refused = None;
        for (place, (search, event)) in self.0.iter_mut().zip(&settings.events).enumerate() {
            let (Some(search), EventTimeSource::Signal { measure, .. }) = (search.as_mut(), event.source)
            else {
                continue;
            };
            let EventSearch { kept, input_part, is_passed } = search;
            kept.require_around(settings.needed_by(place, event, kept.interval_s), segment)?;
            let Some((_, column)) = columns.measured.iter().find(|(known, _)| *known == measure) else {
                continue;
            };
            let kind = names::kind_of(&settings.own.device.measures()[measure]);
            let signal = segment.recording.column_of(column, kind)?.of(segment.segment);
            // The rate of an input at the last rows depends on the next ones, but at the end of a segment.
            let is_rated = input_part.is_some() && !settings.own.device.rated_inputs().is_empty();
            let open = if is_rated && !segment.ends { SLOPE_REACH } else { 0 };
            let until = signal.len().saturating_sub(open);
            let alone: Cow<'_, [f64]> = match input_part {
                Some(part) => {
                    let of = (segment.time_s.as_slice(), inputs, bends);
                    let taken_off = part.taken_off(&settings.own, of, (&signal[..until], kept.interval_s));
                    taken_off.into()
                }
                None => signal.into(),
            };
            let found = kept.look(segment, &segment.time_s[..until], &alone);
            if let Some((_, tally)) = found.filter(|_| *is_passed)
                && let Some(why) = judge_crossings(tally, segment, (&segment.place, column))?
            {
                refused.get_or_insert(why);
            }
        }
        Ok(refused)
    }

    /// When the events happened, as far as it is known in a part.
    pub fn times(
        &self,
        experiment: &Experiment,
        settings: &EquationSettings,
        columns: &EquationColumns<'_>,
        segment: &SignalSegment,
    ) -> Result<Vec<EventTimes<'_>>, EstimateError> {
        let mut times = Vec::new();
        for (event, search) in settings.events.iter().zip(&self.0) {
            let found = match search {
                Some(EventSearch { kept, .. }) => FoundEvents::Crossed(&kept.crossings, kept.first(segment)),
                None => FoundEvents::Recorded(recorded(experiment, event, columns, segment)?),
            };
            times.push(EventTimes { settings: *event, found });
        }
        Ok(times)
    }

    /// Goes on behind a part.
    pub fn pass(&mut self, segment: &SignalSegment) {
        self.0.iter_mut().flatten().for_each(|search| search.kept.pass(segment));
    }

    /// What another run needs to go on from here: of each search how many numbers it has, and these.
    pub fn numbers(&self) -> Vec<f64> {
        let mut all = Vec::new();
        for numbers in self.0.iter().flatten().map(|search| search.kept.numbers()) {
            all.push(numbers.len() as f64);
            all.extend(numbers);
        }
        all
    }
}

/// The numbers of the next search.
fn next_search<'a>(numbers: &mut &'a [f64]) -> &'a [f64] {
    let Some((count, rest)) = numbers.split_first() else { return &[] };
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a count, and saturating
    let (own, rest) = rest.split_at((*count as usize).min(rest.len()));
    *numbers = rest;
    own
}

/// The rows that tell of an event, with the times of it in s: each row says how long before it the event was.
fn recorded(
    experiment: &Experiment,
    event: &EventSettings,
    columns: &EquationColumns<'_>,
    segment: &SignalSegment,
) -> Result<Vec<(usize, f64)>, EstimateError> {
    let Some((_, column)) = columns.events.iter().find(|(place, _)| *place == event.event) else {
        return Ok(Vec::new());
    };
    let ago = segment.recording.column_of(column, &kind::TIME)?.of(segment.segment);
    let within_s = event.known_within_s(segment.interval_s);
    let mut rows = Vec::new();
    for row in segment.fresh.clone() {
        let Some((ago_s, time_s)) = ago.get(row).zip(segment.time_s.get(row)) else { continue };
        if !ago_s.is_finite() {
            continue;
        }
        if !(0.0..=within_s).contains(ago_s) {
            let why = format!(
                "{}: the row at {} s has an event {} s before it; expected 0 to {} s, and no number where there was none; correct \
                 the column `{column}`, or state how late an event may be recorded",
                segment.place,
                super::short(*time_s),
                super::short(*ago_s),
                super::short(within_s)
            );
            let key = Key::from("estimate.events").child(event.name).child("known_within");
            return Err(experiment.error(key, ConfigFault::Value { why }).into());
        }
        rows.push((row, time_s - ago_s));
    }
    Ok(rows)
}
