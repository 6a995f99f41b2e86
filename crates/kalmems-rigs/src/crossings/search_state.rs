//! What is kept of a segment from one part to the next: the search for crossings, and those that were found.

use super::crossing::{self, LevelCrossing};
use super::delivery::CrossingDelivery;
use super::search::{self, CrossingSearch, SearchTally, SearchedSignal, SignalRows};
use super::settings::DetectorSettings;
use crate::config::CrossingApplication;
use crate::estimate::{EstimateError, SignalSegment};
use crate::spikes::{BEFORE, without_spikes};
use kalmems_core::detect::DetectError;

/// Rows of a segment around the new ones that are needed.
#[derive(Clone, Copy, Debug)]
pub struct RowsNeeded {
    /// Before them: where the drive is interpolated, the search goes on, and a motion is taken back to a crossing.
    pub before: usize,
    /// After them: one for the slope of the drive, and more where a filter is told of crossings before they can be known.
    pub after: usize,
}

/// Rows that the drive is interpolated through, and the one before them for its slope.
const INTERPOLATED: usize = 6;

impl RowsNeeded {
    /// For this detector, and filters that are told as these say, in a recording of this interval in s.
    pub fn by(
        detector: Option<&DetectorSettings>,
        deliveries: impl Iterator<Item = CrossingDelivery>,
        interval_s: f64,
    ) -> Self {
        let Some(detector) = detector else { return Self::of_rows(0) };
        let window = detector.window(interval_s);
        let known_after = window.look_ahead();
        let (mut before, mut after) = (window.look_back() + BEFORE, 1);
        for delivery in deliveries {
            #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // positive, saturating
            let told_after = match (delivery.applied, delivery.lag_s) {
                (CrossingApplication::Late, None) => continue,
                (CrossingApplication::Late, Some(lag_s)) => (lag_s / interval_s) as usize,
                (CrossingApplication::InPlace, _) => 0,
            };
            // A zero is within the reach of its fit from the steepest slope.
            before = before.max(told_after.saturating_add(2 * window.fit + BEFORE));
            after = after.max((known_after + window.fit).saturating_sub(told_after) + 1);
        }
        Self { after, ..Self::of_rows(before) }
    }

    /// For so many rows before the new ones.
    pub fn of_rows(before: usize) -> Self {
        Self { before: before.saturating_add(INTERPOLATED), after: 1 }
    }

    /// What both need.
    pub fn and(self, other: Self) -> Self {
        Self { before: self.before.max(other.before), after: self.after.max(other.after) }
    }

    /// What to ask for where the interval may be a little other than is thought.
    pub fn with_a_margin(self) -> Self {
        let more = |rows: usize| rows.saturating_add(rows / 4);
        Self { before: more(self.before), after: more(self.after) }
    }
}

/// The search for crossings and what it found, carried from one part of a segment to the next.
pub struct SearchState {
    /// Where crossings are looked for.
    search: Option<CrossingSearch>,
    /// The crossings that a filter may be told of.
    pub crossings: Vec<LevelCrossing>,
    /// Rows of the segment before the new ones of the present part.
    rows: usize,
    /// The usual interval in s, as the beginning of the segment showed it: how many samples a search needs depends on it.
    pub interval_s: f64,
}

impl SearchState {
    /// At the beginning of a segment, or where another run left it with these [`numbers`](Self::numbers), of a part with so many
    /// rows before its new ones; `sought` says for an interval in s what is looked for, and how.
    pub fn of(
        sought: impl Fn(f64) -> Option<(SearchedSignal, DetectorSettings)>,
        segment: &SignalSegment,
        numbers: &[f64],
    ) -> Result<Self, DetectError> {
        let begun = |interval_s: f64| -> Result<Self, DetectError> {
            let search = sought(interval_s)
                .map(|(sought, detector)| CrossingSearch::new(sought, &detector))
                .transpose()?;
            Ok(Self { search, crossings: Vec::new(), rows: 0, interval_s })
        };
        match numbers {
            [rows, interval_s, rest @ ..] => {
                #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a count of rows
                let rows = *rows as usize;
                let begun = Self { rows, ..begun(*interval_s)? };
                Ok(begun.resumed(rest, rows.saturating_sub(segment.fresh.start)))
            }
            _ => begun(segment.interval_s),
        }
    }

    /// With what another run found, of rows of which `first` is the first one there is.
    fn resumed(mut self, numbers: &[f64], first: usize) -> Self {
        if let Some((search, rest)) = numbers.split_first_chunk::<{ search::NUMBERS }>() {
            self.search = self.search.map(|fresh| fresh.resumed(search, first));
            let (crossings, _) = rest.as_chunks::<{ crossing::NUMBERS }>();
            self.crossings = crossings.iter().map(LevelCrossing::of_numbers).collect();
        }
        self
    }

    /// What another run needs to go on from here.
    pub fn numbers(&self) -> Vec<f64> {
        let search = self.search.iter().flat_map(CrossingSearch::numbers);
        let crossings = self.crossings.iter().flat_map(LevelCrossing::numbers);
        [self.rows as f64, self.interval_s].into_iter().chain(search).chain(crossings).collect()
    }

    /// Which row of the segment the first one of a part is.
    pub fn first(&self, segment: &SignalSegment) -> usize {
        self.rows.saturating_sub(segment.fresh.start)
    }

    /// Refuses a part with fewer rows around the new ones than are needed.
    pub fn require_around(&self, needed: RowsNeeded, segment: &SignalSegment) -> Result<(), EstimateError> {
        let RowsNeeded { before, after } = needed;
        let held_after = segment.time_s.len() - segment.fresh.end;
        let found =
            [(segment.fresh.start, before, self.first(segment) > 0), (held_after, after, !segment.ends)];
        match found.into_iter().find(|(held, needed, more)| *more && held < needed) {
            Some((held, needed, _)) => {
                Err(EstimateError::FewAround { place: segment.place.clone(), held, needed })
            }
            None => Ok(()),
        }
    }

    /// Looks for crossings in the rows of a part, and keeps them; how many there are, and what was found until now. The rows are
    /// all that are there, or, while the segment goes on, fewer at the end.
    pub fn look(
        &mut self,
        segment: &SignalSegment,
        time_s: &[f64],
        signal: &[f64],
    ) -> Option<(usize, SearchTally)> {
        let first = self.first(segment);
        self.crossings.retain(|crossing| crossing.index >= first);
        let search = self.search.as_mut()?;
        let mut found = search.take(
            &SignalRows { time_s, volts: &without_spikes(signal, search.noise()), first },
            segment.ends,
        );
        let count = found.len();
        self.crossings.append(&mut found);
        Some((count, search.tally()))
    }

    /// Goes on behind a part.
    pub fn pass(&mut self, segment: &SignalSegment) {
        self.rows += segment.fresh.len();
    }
}
