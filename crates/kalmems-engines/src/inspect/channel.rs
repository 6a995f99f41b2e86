//! A channel whose values come in stretches.

use super::course::{ChannelCourse, SuccessiveDifferences, frequency, part_frequencies, sweep};
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
    differences: SuccessiveDifferences,
    /// Whether the present segment is complete so far, and its spectrum where it is longer than a stretch.
    complete: bool,
    present: Periodogram,
    /// Whether there was a uniform segment, and the longest of them that is complete: its rows and its spectrum.
    uniform: bool,
    longest: Option<(usize, Option<SegmentLines>)>,
    /// The frequencies of the parts of the present segment, and of the longest.
    parts: Vec<Option<f64>>,
    longest_parts: Vec<Option<f64>>,
}

impl ChannelDraft {
    pub(super) fn new(column: &RecordingColumn) -> Self {
        Self {
            column: column.header.column.clone(),
            unit: column.header.unit_text.clone(),
            si_unit: quantity::si_unit(&column.header),
            moments: ValueMoments::default(),
            differences: SuccessiveDifferences::default(),
            complete: true,
            present: Periodogram::default(),
            uniform: false,
            longest: None,
            parts: Vec::new(),
            longest_parts: Vec::new(),
        }
    }

    /// Takes the new rows of a stretch; `segment` is the segment up to their end.
    pub(super) fn take(&mut self, stretch: &Stretch, column: &RecordingColumn, segment: &SegmentSummary) {
        let values = column.values.get(stretch.fresh.clone()).unwrap_or_default();
        self.moments.add(values);
        self.differences.add(values);
        if stretch.begins {
            self.complete = true;
            self.present = Periodogram::default();
            self.parts.clear();
        }
        self.complete &= values.iter().all(|value| value.is_finite());
        let whole = stretch.begins && stretch.ends;
        if !whole && self.complete && segment.uniform {
            self.present.add(values);
            self.parts.push(frequency(values, rate(stretch)));
        }
        if !stretch.ends {
            return;
        }
        self.uniform |= segment.uniform;
        let longer = self.longest.as_ref().is_none_or(|(rows, _)| segment.rows > *rows);
        if segment.uniform && self.complete && longer {
            let rate = rate(stretch);
            self.longest_parts =
                if whole { part_frequencies(values, rate) } else { std::mem::take(&mut self.parts) };
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
        let statistics = self.moments.statistics();
        let roughness = statistics.standard_deviation.and_then(|sd| self.differences.roughness(sd));
        InspectedChannel {
            column: self.column,
            unit: self.unit,
            si_unit: self.si_unit,
            course: ChannelCourse { roughness, swept: sweep(&self.longest_parts) },
            statistics,
            spectrum: self.longest.and_then(|(_, spectrum)| spectrum),
            no_spectrum: reason.map(str::to_owned),
        }
    }
}

/// Samples per unit of time in a stretch.
fn rate(stretch: &Stretch) -> f64 {
    let interval = stretch.recording.segments().first().and_then(|segment| segment.time.interval_s());
    interval.map_or(f64::NAN, f64::recip)
}
