//! Clocks that a file states by single numbers with names: `fs`, `dt`, `t0` and their kin, as variables, attributes or metadata.

use crate::clock::{ChannelClock, ClockRun, ClockedChannels, RegularTimes, SampleStep};
use crate::records::{CellKind, RecordField, RecordLane};

/// Names without case and marks: the sampling rate, the interval, and the time of the first sample.
const RATES: &str =
    "fs samplerate samplingrate samplefrequency samplingfrequency samplefreq acquisitionrate updaterate";
// The last ones are of PicoScope, of Rigol, of Tektronix and Keysight, and of LabVIEW.
const INTERVALS: &str = "dt deltat timestep sampleinterval samplinginterval sampleperiod samplingperiod sampletime \
                         tinterval tinc xincrement xinc wfincrement";
const STARTS: &str = "t0 tstart xstart xorigin timeoffset wfstartoffset";

/// Units behind a name, as powers of ten of a second or of a hertz.
const UNITS: [(&str, i32); 9] =
    [("s", 0), ("ms", -3), ("us", -6), ("ns", -9), ("sec", 0), ("hz", 0), ("khz", 3), ("mhz", 6), ("ghz", 9)];

/// Numbers of a file that may state a clock.
#[derive(Clone, Debug, Default)]
pub(crate) struct StatedNumbers(Vec<(String, f64)>);

impl StatedNumbers {
    /// Keeps a number if its name may state a clock; whether it does.
    pub(crate) fn learn(&mut self, name: &str, number: f64) -> bool {
        let (plain, power) = plain(name);
        let known = [RATES, INTERVALS, STARTS].iter().any(|names| names.split(' ').any(|name| name == plain));
        if known && number.is_finite() && self.0.len() < 64 {
            self.0.push((plain, crate::decimal::Shift::new(power).float(number)));
        }
        known
    }

    /// What they state; nothing where rate and interval contradict each other.
    pub(crate) fn clock(&self) -> ChannelClock {
        let is_of = |names: &str, name: &str| names.split(' ').any(|known| known == name);
        let of = |names: &str| self.0.iter().find(|(name, _)| is_of(names, name)).map(|(_, number)| *number);
        let step = match (of(RATES), of(INTERVALS)) {
            (Some(rate), Some(interval)) if (rate * interval - 1.0).abs() > 1e-6 => None,
            (Some(rate), _) => Some(SampleStep::Rate(rate)),
            (None, interval) => interval.map(SampleStep::Interval),
        };
        ChannelClock { start: None, offset_s: of(STARTS).unwrap_or(0.0), step }
    }

    /// The times of rows by what they state, from the first on.
    pub(crate) fn regular_times(&self) -> Option<RegularTimes> {
        let ChannelClock { offset_s, step, .. } = self.clock();
        let step = step.filter(|step| step.is_sound())?;
        Some(RegularTimes { row: 0, start_s: offset_s, step })
    }
}

/// Gives each column of numbers its clock, where none of them is called a time; says what it did.
pub(crate) fn settle_each(
    clocks: &[ChannelClock],
    fields: &mut Vec<RecordField>,
    lanes: &mut Vec<Box<dyn RecordLane>>,
    stated_by: &'static str,
) -> String {
    let is_time = |field: &RecordField| {
        field.cells.time().is_some()
            || matches!(field.cells, CellKind::Clock(_))
            || names_a_time(&field.column.name)
    };
    if fields.iter().any(is_time) {
        return String::new();
    }
    let of = |(field, clock): (&RecordField, &ChannelClock)| {
        if field.cells.is_numbers() { vec![ClockRun { row: 0, clock: *clock }] } else { Vec::new() }
    };
    let clocks = fields.iter().zip(clocks).map(of).collect();
    ClockedChannels { fields, lanes, clocks, stated_by }.settle()
}

/// Whether a column is called a time, with or without its unit.
pub(crate) fn names_a_time(name: &str) -> bool {
    let lower = name.to_lowercase();
    let first = lower.split(|letter: char| !letter.is_alphanumeric()).next().unwrap_or_default();
    first.starts_with("time") || first == "t"
}

/// A name without case and marks and without the unit behind it, and that unit as a power of ten.
fn plain(name: &str) -> (String, i32) {
    let lower = name.trim().to_lowercase();
    let unit = |last: &str| UNITS.iter().find(|(unit, _)| *unit == last).map(|(_, power)| *power);
    let (stem, power) = match lower.rsplit_once('_').and_then(|(stem, last)| Some((stem, unit(last)?))) {
        Some((stem, power)) => (stem, power),
        None => (lower.as_str(), 0),
    };
    (stem.chars().filter(|letter| letter.is_alphanumeric()).collect(), power)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn clock(numbers: &[(&str, f64)]) -> ChannelClock {
        let mut stated = StatedNumbers::default();
        for (name, number) in numbers {
            stated.learn(name, *number);
        }
        stated.clock()
    }

    #[test]
    fn rates_intervals_and_starts_are_known_by_their_names() {
        for (numbers, step, offset_s) in [
            (&[("fs", 2e3)][..], Some(SampleStep::Rate(2e3)), 0.0),
            (&[("Sample Rate", 2e3), ("t0_ms", 8.0)], Some(SampleStep::Rate(2e3)), 8e-3),
            (&[("dt_us", 4.0), ("wf_start_offset", 0.5)], Some(SampleStep::Interval(4e-6)), 0.5),
            (&[("Tinterval", 1e-6), ("Tstart", -1e-3)], Some(SampleStep::Interval(1e-6)), -1e-3),
            (&[("fs_kHz", 1.0), ("dt", 1e-3)], Some(SampleStep::Rate(1e3)), 0.0),
            (&[("fs", 1e3), ("dt", 2e-3)], None, 0.0),
            (&[("rate", 1e3), ("gain", 2.0)], None, 0.0),
        ] {
            assert_eq!(clock(numbers), ChannelClock { start: None, offset_s, step }, "{numbers:?}");
        }
    }
}
