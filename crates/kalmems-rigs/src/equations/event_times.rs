//! The events of a part of a segment, and which of them a filter is told at which row.

use super::events::{EventSettings, EventTimeSource, FilterEventUse};
use crate::config::CrossingTiming;
use crate::crossings::{CrossingDelivery, LevelCrossing, TOLD_SHARE};
use crate::estimate::{self, PassedMark};
use kalmems_core::Portable;
use std::ops::Range;

/// The times of an event in a part of a segment.
#[derive(Clone)]
pub struct EventTimes<'a> {
    /// What is known of the event.
    pub settings: EventSettings,
    /// When it happened.
    pub found: FoundEvents<'a>,
}

/// When an event happened.
#[derive(Clone)]
pub enum FoundEvents<'a> {
    /// By a channel: the rows that tell of it, and the times in s.
    Recorded(Vec<(usize, f64)>),
    /// By crossings of a signal, and which row of the segment the first one of the part is.
    Crossed(&'a [LevelCrossing], usize),
}

/// How much of an event a filter believes.
#[derive(Clone, Copy, Debug)]
pub enum EventAcceptance {
    /// It is judged by it, and not corrected.
    Judged,
    /// Where its normalised innovation squared is not above this.
    Within(f64),
    /// Where its own gate does not reject it.
    ByGate,
}

/// An event as a filter is told of it.
#[derive(Clone, Copy, Debug)]
pub struct EventMeasurement {
    /// Its place among those of the device.
    pub event: usize,
    /// When it happened, in s.
    pub time_s: f64,
    /// The variance of that in s², and what the expression has beside it, in its unit².
    pub variances: [f64; 2],
    /// What the expression was then.
    pub value: f64,
    /// The variance of the expression, where the file states it for this filter.
    pub variance: Option<f64>,
    /// The reading by which all filters are judged alike, where that is another one.
    pub judged: Option<JudgedReading>,
    /// The measurement that crossed its level then, by its place, and how fast it rose, in its unit per s.
    pub rise: Option<(usize, f64)>,
    /// How much of it a filter believes.
    pub acceptance: EventAcceptance,
}

/// The reading of an event by which a filter is judged.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JudgedReading {
    /// When it was, in s.
    pub time_s: f64,
    /// The variance of that in s².
    pub time_variance: f64,
    /// What the expression was then.
    pub value: f64,
}

impl EventTimes<'_> {
    /// What a filter is told, or judged by, at which row.
    fn push_measurements(
        &self,
        used: Option<&FilterEventUse>,
        (time_s, interval_s): (&[f64], f64),
        told: &mut Vec<(usize, EventMeasurement)>,
    ) {
        let settings = &self.settings;
        let one = |time_s: f64, variance: f64, judged: JudgedReading| EventMeasurement {
            event: settings.event,
            time_s,
            variances: [variance + settings.time_variance, settings.variance],
            value: used.map_or(settings.judged, |used| used.value),
            variance: used.and_then(|used| used.variance),
            judged: Some(judged).filter(|judged| {
                let taken = JudgedReading {
                    time_s,
                    time_variance: variance + settings.time_variance,
                    value: used.map_or(settings.judged, |used| used.value),
                };
                *judged != taken || used.is_some_and(|used| used.variance.is_some())
            }),
            rise: None,
            acceptance: used.map_or(EventAcceptance::Judged, |used| {
                used.gate_nis.map_or(EventAcceptance::ByGate, EventAcceptance::Within)
            }),
        };
        match &self.found {
            FoundEvents::Recorded(rows) => {
                let judged = |time_s| self.judged(time_s, 0.0);
                told.extend(rows.iter().map(|(row, at_s)| (*row, one(*at_s, 0.0, judged(*at_s)))));
            }
            FoundEvents::Crossed(crossings, first) => {
                let timing = used.map_or(CrossingTiming::default(), |used| used.timing);
                let delivery = used.map_or(CrossingDelivery::default(), |used| used.delivery);
                told.extend(crossings.iter().filter_map(|crossing| {
                    let at = crossing.at(timing)?;
                    let row = delivery.row(at.time_s, (crossing.known_at, *first), (time_s, interval_s))?;
                    let by = crossing.at(CrossingTiming::default()).or(crossing.fallback).unwrap_or(at);
                    let rise = self.measure().map(|measure| (measure, at.volts_per_s));
                    let judged = self.judged(by.time_s, by.sd_s * by.sd_s);
                    Some((row, EventMeasurement { rise, ..one(at.time_s, at.sd_s * at.sd_s, judged) }))
                }));
            }
        }
    }

    fn judged(&self, time_s: f64, variance: f64) -> JudgedReading {
        let EventSettings { time_variance, judged, .. } = self.settings;
        JudgedReading { time_s, time_variance: variance + time_variance, value: judged }
    }

    /// The measurement that shows it, where one does.
    fn measure(&self) -> Option<usize> {
        match self.settings.source {
            EventTimeSource::Signal { measure, .. } => Some(measure),
            EventTimeSource::Channel { .. } => None,
        }
    }

    /// What is said of these rows beside the filters, each with the row at which it is known; of the last ones of a segment what they
    /// would have told as well. With them how many are not told, as their time is hardly better known than that of any crossing; of a device
    /// that passes at such a frequency, in Hz.
    pub fn passings(
        &self,
        fresh: &Range<usize>,
        ends: bool,
        passes_hz: Option<f64>,
    ) -> (Vec<(usize, estimate::RecordedPassing)>, usize) {
        let one = |row, time_s, sd_s: f64, is_fallback| {
            let event = PassedMark::Event(self.settings.name);
            let of = self.settings.passed_angle.map_or(event, PassedMark::Angle);
            let sd_s = sd_s.portable_hypot(self.settings.time_variance.sqrt());
            (row, estimate::RecordedPassing { of, time_s, sd_s, is_fallback })
        };
        match &self.found {
            FoundEvents::Recorded(rows) => {
                (rows.iter().map(|(row, at_s)| one(*row, *at_s, 0.0, false)).collect(), 0)
            }
            FoundEvents::Crossed(crossings, first) => {
                let largest_s = passes_hz.map_or(0.0, |hz| TOLD_SHARE * 0.5 / hz / 3.0_f64.sqrt());
                let of = |crossing: &LevelCrossing| {
                    let row = crossing.known_at.checked_sub(*first)?;
                    let is_new = fresh.contains(&row) || (ends && row >= fresh.end);
                    let by = crossing.fallback.or(crossing.zero).filter(|_| is_new)?;
                    Some(one(row, by.time_s, by.sd_s, crossing.fallback.is_some()))
                };
                let all: Vec<_> = crossings.iter().filter_map(of).collect();
                let count = all.len();
                let is_told = |(_, passing): &(usize, estimate::RecordedPassing)| {
                    !passing.is_fallback || passing.sd_s <= largest_s
                };
                let told: Vec<_> = all.into_iter().filter(is_told).collect();
                let refused = count - told.len();
                (told, refused)
            }
        }
    }
}

/// What a filter is told of all events, row by row; events before the first row of the segment are not.
pub fn event_measurements(
    events: &[EventTimes<'_>],
    uses: &[FilterEventUse],
    (time_s, interval_s): (&[f64], f64),
) -> Vec<(usize, EventMeasurement)> {
    let mut told = Vec::new();
    for (place, event) in events.iter().enumerate() {
        let used = uses.iter().find(|used| used.event == place);
        event.push_measurements(used, (time_s, interval_s), &mut told);
    }
    let first_s = time_s.first().copied().unwrap_or(f64::NAN);
    told.retain(|(row, told)| *row < time_s.len() && told.time_s >= first_s);
    told.sort_by(|(a, first), (b, second)| a.cmp(b).then(first.time_s.total_cmp(&second.time_s)));
    told
}
