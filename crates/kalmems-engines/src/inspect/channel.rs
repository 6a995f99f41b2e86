//! A channel whose values come in stretches.

use super::spectrum::{self, Periodogram, SegmentLines};
use super::statistics::ValueMoments;
use super::{InspectedChannel, SegmentSummary, quantity};
use crate::recording::{RecordingColumn, Stretch};

/// What is known of a channel so far.
pub(super) struct ChannelDraft {
    column: String,
    unit: String,
    si_unit: String,
    moments: ValueMoments,
    /// Whether the present segment is complete so far, and its spectrum where it is longer than a stretch.
    complete: bool,
    present: Periodogram,
    /// Whether there was a uniform segment, and the longest of them that is complete: its rows and its spectrum.
    uniform: bool,
    longest: Option<(usize, Option<SegmentLines>)>,
}

impl ChannelDraft {
    pub(super) fn new(column: &RecordingColumn) -> Self {
        Self {
            column: column.header.column.clone(),
            unit: column.header.unit_text.clone(),
            si_unit: quantity::si_unit(&column.header),
            moments: ValueMoments::default(),
            complete: true,
            present: Periodogram::default(),
            uniform: false,
            longest: None,
        }
    }

    /// Takes the new rows of a stretch; `segment` is the segment up to their end.
    pub(super) fn take(&mut self, stretch: &Stretch, column: &RecordingColumn, segment: &SegmentSummary) {
        let values = column.values.get(stretch.fresh.clone()).unwrap_or_default();
        self.moments.add(values);
        if stretch.begins {
            self.complete = true;
            self.present = Periodogram::default();
        }
        self.complete &= values.iter().all(|value| value.is_finite());
        let whole = stretch.begins && stretch.ends;
        if !whole && self.complete && segment.uniform {
            self.present.add(values);
        }
        if !stretch.ends {
            return;
        }
        self.uniform |= segment.uniform;
        let longer = self.longest.as_ref().is_none_or(|(rows, _)| segment.rows > *rows);
        if segment.uniform && self.complete && longer {
            let interval = stretch.recording.segments().first().and_then(|s| s.time.interval_s());
            let rate = interval.map_or(f64::NAN, f64::recip);
            let spectrum = if whole {
                spectrum::spectrum(values, rate, &segment.label)
            } else {
                self.present.spectrum(rate, &segment.label)
            };
            self.longest = Some((segment.rows, spectrum));
        }
    }

    pub(super) fn finish(self) -> InspectedChannel {
        let reason = match &self.longest {
            _ if !self.uniform => Some("no segment has a uniform time"),
            None => Some("values are missing in every uniform segment"),
            Some((_, None)) => Some("the segments are too short"),
            Some((_, Some(_))) => None,
        };
        InspectedChannel {
            column: self.column,
            unit: self.unit,
            si_unit: self.si_unit,
            statistics: self.moments.statistics(),
            spectrum: self.longest.and_then(|(_, spectrum)| spectrum),
            no_spectrum: reason.map(str::to_owned),
        }
    }
}
