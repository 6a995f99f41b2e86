//! What the rig keeps of a segment from one part to the next: its search for crossings, and those that were found.

use super::crossings::{self, Crossing};
use super::search::{self, Rows, Search, Sought, Tally};
use super::settings::Settings;
use crate::config::Applied;
use crate::estimate::driven::DrivenSegment;
use crate::estimate::{EstimateError, SignalSegment};
use kalmems_core::detect::DetectError;

/// Rows of a segment around the new ones that are needed.
#[derive(Clone, Copy, Debug)]
pub struct Needed {
    /// Before them: where the drive is interpolated, the search goes on, and a motion is taken back to a crossing.
    pub before: usize,
    /// After them: one for the slope of the drive, and more where a filter is told of crossings before they can be known.
    pub after: usize,
}

/// Rows that the drive is interpolated through, and the one before them for its slope.
const INTERPOLATED: usize = 5;

impl Needed {
    /// In a recording of this interval in s.
    pub fn by(settings: &Settings, interval_s: f64) -> Self {
        let Some(detector) = settings.detector() else { return Self { before: INTERPOLATED, after: 1 } };
        let window = detector.window(interval_s);
        let known_after = window.look_ahead();
        let (mut before, mut after) = (window.look_back(), 1);
        for threshold in settings.filters.iter().filter_map(|filter| filter.threshold) {
            #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // positive, saturating
            let told_after = match (threshold.applied, threshold.lag_s) {
                (Applied::Late, None) => continue,
                (Applied::Late, Some(lag_s)) => (lag_s / interval_s) as usize,
                (Applied::InPlace, _) => 0,
            };
            // A zero is within the reach of its fit from the steepest slope.
            before = before.max(told_after.saturating_add(2 * window.fit));
            after = after.max((known_after + window.fit).saturating_sub(told_after) + 1);
        }
        Self { before: before.saturating_add(INTERPOLATED), after }
    }

    /// What to ask for where the interval may be a little other than is thought.
    pub fn with_a_margin(self) -> Self {
        let more = |rows: usize| rows.saturating_add(rows / 4);
        Self { before: more(self.before), after: more(self.after) }
    }
}

/// What is kept.
pub struct Kept {
    /// Where crossings are looked for.
    search: Option<Search>,
    /// The crossings that a filter may be told of.
    pub crossings: Vec<Crossing>,
    /// Rows of the segment before the new ones of the present part.
    rows: usize,
    /// The usual interval in s, as the beginning of the segment showed it: how many samples a search needs hangs on it.
    interval_s: f64,
}

impl Kept {
    /// At the beginning of a segment, or where another run left it with these [`numbers`](Self::numbers), of a part with so many
    /// rows before its new ones.
    pub fn of(settings: &Settings, segment: &SignalSegment, numbers: &[f64]) -> Result<Self, DetectError> {
        match numbers {
            [rows, interval_s, rest @ ..] => {
                #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a count of rows
                let rows = *rows as usize;
                let begun = Self { rows, ..Self::begun(settings, *interval_s)? };
                Ok(begun.resumed(rest, rows.saturating_sub(segment.fresh.start)))
            }
            _ => Self::begun(settings, segment.interval_s),
        }
    }

    fn begun(settings: &Settings, interval_s: f64) -> Result<Self, DetectError> {
        let hardware = &settings.hardware;
        let sought = Sought {
            interval_s,
            noise_variance: hardware.noise_variance,
            offset: hardware.readout.offset,
            comb: hardware.readout.comb,
            resonator: hardware.mirror.resonator,
        };
        let search = settings.detector().map(|detector| Search::new(sought, &detector)).transpose()?;
        Ok(Self { search, crossings: Vec::new(), rows: 0, interval_s })
    }

    /// With what another run found, of rows of which `first` is the first one there is.
    fn resumed(mut self, numbers: &[f64], first: usize) -> Self {
        if let Some((search, rest)) = numbers.split_first_chunk::<{ search::NUMBERS }>() {
            self.search = self.search.map(|fresh| fresh.resumed(search, first));
            let (crossings, _) = rest.as_chunks::<{ crossings::NUMBERS }>();
            self.crossings = crossings.iter().map(Crossing::of_numbers).collect();
        }
        self
    }

    /// What another run needs to go on from here.
    pub fn numbers(&self) -> Vec<f64> {
        let search = self.search.iter().flat_map(Search::numbers);
        let crossings = self.crossings.iter().flat_map(Crossing::numbers);
        [self.rows as f64, self.interval_s].into_iter().chain(search).chain(crossings).collect()
    }

    /// Which row of the segment the first one of a part is.
    pub fn first(&self, segment: &SignalSegment) -> usize {
        self.rows.saturating_sub(segment.fresh.start)
    }

    /// Refuses a part with fewer rows around the new ones than are needed.
    pub fn require_around(&self, settings: &Settings, segment: &SignalSegment) -> Result<(), EstimateError> {
        let Needed { before, after } = Needed::by(settings, self.interval_s);
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

    /// Looks for crossings in the rows of a part, as far as the drive's slope is known in them, and keeps them; how many there
    /// are, and what was found until now.
    pub fn look(
        &mut self,
        segment: &SignalSegment,
        data: &DrivenSegment,
        volts: &[f64],
    ) -> Option<(usize, Tally)> {
        let first = self.first(segment);
        self.crossings.retain(|crossing| crossing.index >= first);
        let search = self.search.as_mut()?;
        // The slope at the last row hangs on the next one, but at the end of a segment.
        let until = if segment.ends { volts.len() } else { volts.len().saturating_sub(1) };
        let rows = Rows { time_s: &data.time_s[..until], volts: &volts[..until], first };
        let mut found = search.take(&rows, segment.ends);
        let count = found.len();
        self.crossings.append(&mut found);
        Some((count, search.tally()))
    }

    /// Goes on behind a part.
    pub fn pass(&mut self, segment: &SignalSegment) {
        self.rows += segment.fresh.len();
    }
}
