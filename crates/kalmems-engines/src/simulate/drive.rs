//! What drives a device, at any time.

use super::waveform::Waveform;
use crate::config::{PowerCut, Quantity};
use crate::signal::{cubic_between, sample_slopes, usual_interval};
use kalmems_core::Portable;
use kalmems_core::{Nodes, Scalar};
use std::f64::consts::{PI, TAU};

/// A drive over time: a voltage in V, or an input of a device of one's own in its SI unit, as the numbers below are then.
#[derive(Clone, Debug, PartialEq)]
pub enum Drive {
    /// The same at all times.
    Constant {
        /// In V.
        level: f64,
    },
    /// offset + amplitude·sin(2πft + phase).
    Sine {
        /// In V.
        offset: f64,
        /// In V.
        amplitude: f64,
        /// f.
        frequency_hz: f64,
        /// In rad.
        phase_rad: f64,
    },
    /// `high` for the first part of each period, then `low`.
    Square {
        /// In V.
        low: f64,
        /// In V.
        high: f64,
        /// Periods per second.
        frequency_hz: f64,
        /// The part of each period that is high, between 0 and 1.
        duty: f64,
    },
    /// A sine whose frequency goes from one to another, linearly in time, and then stays.
    Sweep {
        /// In V.
        offset: f64,
        /// In V.
        amplitude: f64,
        /// The frequency at 0 s.
        from_hz: f64,
        /// The frequency at the end.
        to_hz: f64,
        /// When it is reached.
        duration_s: f64,
    },
    /// offset + Σ amplitude·sin(2πft + phase): several axes driven at once through one electrode.
    Tones {
        /// In V.
        offset: f64,
        /// The sines.
        tones: Vec<Tone>,
    },
    /// Another drive whose power is off at times: it goes and comes back as e^{−t/τ}.
    Interrupted {
        /// The drive.
        drive: Box<Drive>,
        /// When.
        off: Interruptions,
    },
    /// A level that jumps.
    Steps {
        /// The level before the first jump.
        first: f64,
        /// When it jumps in s, rising, and the level from then on.
        steps: Vec<(f64, f64)>,
    },
    /// One drive until a time, and another from then on.
    Switched {
        /// The time.
        at_s: f64,
        /// The drive until then.
        before: Box<Drive>,
        /// The drive from then on.
        after: Box<Drive>,
    },
    /// Another drive that is later.
    Late {
        /// The drive.
        drive: Box<Drive>,
        /// By how much; negative for one that is earlier.
        by_s: f64,
    },
    /// The rate of another drive, per s.
    Rate {
        /// The drive, which does not jump.
        of: Box<Drive>,
    },
    /// Samples, with a cubic between them. Before the first and after the last they count as held.
    Recorded {
        /// When, rising.
        time_s: Vec<f64>,
        /// In V, as many.
        volts: Vec<f64>,
    },
}

/// Times without power: [first + k·every, first + k·every + lasting) for k = 0, 1, …
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interruptions {
    /// When the first begins.
    pub first_s: f64,
    /// How long each is; infinite where power stays off.
    pub lasting_s: f64,
    /// From one to the next; infinite where there is one alone.
    pub every_s: f64,
    /// τ, with which the voltage follows: short against both.
    pub transient_s: f64,
}

impl From<&PowerCut> for Interruptions {
    fn from(cut_off: &PowerCut) -> Self {
        Self {
            first_s: cut_off.at.as_ref().map_or(0.0, Quantity::si),
            lasting_s: cut_off.lasting.as_ref().map_or(f64::INFINITY, Quantity::si),
            every_s: cut_off.every.as_ref().map_or(f64::INFINITY, Quantity::si),
            transient_s: cut_off.transient.si(),
        }
    }
}

impl Interruptions {
    /// How much of the voltage is there, from 0 to 1, and how fast that changes in 1/s.
    fn share(&self, time_s: f64) -> (f64, f64) {
        let since = time_s - self.first_s;
        if since < 0.0 {
            return (1.0, 0.0);
        }
        let into = if self.every_s.is_finite() {
            since - self.every_s * (since / self.every_s).floor()
        } else {
            since
        };
        let left = |since_switch: f64| Scalar::exp(-since_switch / self.transient_s);
        if into < self.lasting_s {
            let left = left(into);
            (left, -left / self.transient_s)
        } else {
            let left = left(into - self.lasting_s);
            (1.0 - left, left / self.transient_s)
        }
    }

    /// Whether power is off, whatever of the voltage is left.
    pub fn is_off(&self, time_s: f64) -> bool {
        self.share(time_s).1 < 0.0
    }
}

/// One sine of several.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tone {
    /// In V.
    pub amplitude: f64,
    /// f.
    pub frequency_hz: f64,
    /// In rad, of the sine at 0 s.
    pub phase_rad: f64,
}

impl Tone {
    /// Its share of the voltage.
    fn at(&self, time_s: f64) -> f64 {
        self.amplitude * sine_of_cycles(self.frequency_hz * time_s + self.phase_rad / TAU)
    }
}

/// sin 2πx.
fn sine_of_cycles(x: f64) -> f64 {
    Scalar::sin(TAU * (x - x.floor()))
}

/// The time at which a drive that jumps is asked for its value. The time of a sample, a multiple of an interval, is rounded: one that falls on the jump
/// up to rounding has the value behind it, which moves the device from there on.
fn past_rounding(time_s: f64) -> f64 {
    time_s + 4.0 * f64::EPSILON * time_s.abs()
}

impl Drive {
    /// The voltage.
    pub fn at(&self, time_s: f64) -> f64 {
        match self {
            Self::Constant { level } => *level,
            Self::Sine { offset, amplitude, frequency_hz, phase_rad } => {
                offset + amplitude * sine_of_cycles(frequency_hz * time_s + phase_rad / TAU)
            }
            Self::Square { low, high, frequency_hz, duty } => {
                let cycles = frequency_hz * past_rounding(time_s);
                if cycles - cycles.floor() < *duty { *high } else { *low }
            }
            Self::Sweep { offset, amplitude, from_hz, to_hz, duration_s } => {
                let (swept, stays) = (time_s.max(0.0).min(*duration_s), (time_s - duration_s).max(0.0));
                let mean_hz = from_hz + 0.5 * (to_hz - from_hz) * swept / duration_s;
                let before = from_hz * time_s.min(0.0);
                offset + amplitude * sine_of_cycles(mean_hz * swept + to_hz * stays + before)
            }
            Self::Tones { offset, tones } => tones.iter().fold(*offset, |sum, tone| sum + tone.at(time_s)),
            Self::Interrupted { drive, off } => drive.at(time_s) * off.share(time_s).0,
            Self::Steps { first, steps } => {
                let passed = steps.partition_point(|(at_s, _)| *at_s <= past_rounding(time_s));
                passed.checked_sub(1).map_or(*first, |last| steps[last].1)
            }
            Self::Switched { at_s, before, after } => {
                if past_rounding(time_s) < *at_s {
                    before.at(time_s)
                } else {
                    after.at(time_s)
                }
            }
            Self::Late { drive, by_s } => drive.at(time_s - by_s),
            Self::Rate { of } => of.slope(time_s).unwrap_or(f64::NAN),
            Self::Recorded { time_s: times, volts } => match times.partition_point(|t| *t <= time_s) {
                0 => volts.first().copied().unwrap_or(f64::NAN),
                to if to == times.len() => volts.last().copied().unwrap_or(f64::NAN),
                to => cubic_between(times, |k| volts[k], to, time_s),
            },
        }
    }

    /// How fast the voltage changes, in V/s; `None` for a drive that jumps or is known at samples alone.
    pub fn slope(&self, time_s: f64) -> Option<f64> {
        let cosine = |amplitude: f64, frequency_hz: f64, cycles: f64| {
            TAU * frequency_hz * amplitude * sine_of_cycles(cycles + 0.25)
        };
        let tone = |amplitude: f64, frequency_hz: f64, phase_rad: f64| {
            cosine(amplitude, frequency_hz, frequency_hz * time_s + phase_rad / TAU)
        };
        match self {
            Self::Constant { .. } => Some(0.0),
            Self::Sine { amplitude, frequency_hz, phase_rad, .. } => {
                Some(tone(*amplitude, *frequency_hz, *phase_rad))
            }
            Self::Sweep { amplitude, from_hz, to_hz, duration_s, .. } => {
                let (swept, stays) = (time_s.max(0.0).min(*duration_s), (time_s - duration_s).max(0.0));
                let change = (to_hz - from_hz) * swept / duration_s;
                let cycles = (from_hz + 0.5 * change) * swept + to_hz * stays + from_hz * time_s.min(0.0);
                Some(cosine(*amplitude, from_hz + change, cycles))
            }
            Self::Tones { tones, .. } => {
                Some(tones.iter().map(|t| tone(t.amplitude, t.frequency_hz, t.phase_rad)).sum())
            }
            Self::Interrupted { drive, off } => {
                let (share, change) = off.share(time_s);
                drive.slope(time_s).map(|slope| slope * share + drive.at(time_s) * change)
            }
            Self::Late { drive, by_s } => drive.slope(time_s - by_s),
            Self::Square { .. }
            | Self::Steps { .. }
            | Self::Switched { .. }
            | Self::Rate { .. }
            | Self::Recorded { .. } => None,
        }
    }

    /// Its rate over time, per s; `None` for a drive that jumps.
    ///
    /// Of a recorded drive it is known at the samples, with a cubic between them.
    pub fn rate(&self) -> Option<Self> {
        match self {
            Self::Recorded { time_s, volts } => {
                let slopes = sample_slopes(time_s, |k| volts[k], usual_interval(time_s));
                Some(Self::Recorded { time_s: time_s.clone(), volts: slopes })
            }
            Self::Late { drive, by_s } => {
                drive.rate().map(|rate| Self::Late { drive: Box::new(rate), by_s: *by_s })
            }
            other => other.slope(0.0).map(|_| Self::Rate { of: Box::new(other.clone()) }),
        }
    }

    /// Its period in s, where it has one.
    pub fn period_s(&self) -> Option<f64> {
        match self {
            Self::Sine { frequency_hz, .. } | Self::Square { frequency_hz, .. } => Some(1.0 / frequency_hz),
            _ => None,
        }
    }

    /// The mean of V² and the amplitude of its component at a harmonic of the drive, both in V²; `None` for a
    /// drive without a waveform that repeats.
    pub fn square(&self, harmonic: u32) -> Option<(f64, f64)> {
        if let Self::Constant { level } = self {
            return Some((level * level, 0.0));
        }
        Some(match self.waveform()? {
            Waveform::Sine { offset, amplitude } => {
                let component = match harmonic {
                    1 => 2.0 * (offset * amplitude).abs(),
                    2 => 0.5 * amplitude * amplitude,
                    _ => 0.0,
                };
                (offset * offset + 0.5 * amplitude * amplitude, component)
            }
            Waveform::Square { low, high, duty } => {
                let m = f64::from(harmonic);
                let component = (high * high - low * low) * 2.0 / (PI * m) * (PI * m * duty).portable_sin();
                (duty * high * high + (1.0 - duty) * low * low, component.abs())
            }
        })
    }

    /// Calls `each` with the parts of an interval between which the drive jumps: end and drive of each part.
    ///
    /// No integrator follows a jump within its step.
    pub fn parts(&self, from_s: f64, to_s: f64, each: &mut impl FnMut(f64, f64, &Nodes<f64>)) {
        let all = std::slice::from_ref(self);
        each_part(all, from_s, to_s, |start, end| each(start, end, &self.nodes_between(start, end)));
    }

    /// The first time in s after this one at which it jumps.
    fn next_jump_s(&self, after_s: f64) -> Option<f64> {
        match self {
            Self::Square { frequency_hz, duty, .. } => {
                let period = (frequency_hz * after_s).floor();
                let jumps = [period, period + duty, period + 1.0, period + 1.0 + duty];
                jumps.into_iter().map(|n| n / frequency_hz).find(|jump| *jump > after_s)
            }
            Self::Steps { steps, .. } => {
                let passed = steps.partition_point(|(at_s, _)| *at_s <= after_s);
                steps.get(passed).map(|(at_s, _)| *at_s)
            }
            Self::Switched { at_s, before, after } => {
                let earlier = if after_s < *at_s { before.next_jump_s(after_s) } else { None };
                let own = (after_s < *at_s).then_some(*at_s);
                earlier.filter(|jump| jump < at_s).or(own).or_else(|| after.next_jump_s(after_s))
            }
            Self::Late { drive, by_s } => drive.next_jump_s(after_s - by_s).map(|jump| jump + by_s),
            Self::Interrupted { drive, .. } => drive.next_jump_s(after_s),
            Self::Constant { .. }
            | Self::Sine { .. }
            | Self::Sweep { .. }
            | Self::Tones { .. }
            | Self::Rate { .. }
            | Self::Recorded { .. } => None,
        }
    }

    /// The drive over a time within which it does not jump: at its ends it is what it is within.
    fn nodes_between(&self, from_s: f64, to_s: f64) -> Nodes<f64> {
        let middle_s = from_s.midpoint(to_s);
        match self {
            Self::Square { .. } | Self::Steps { .. } => Nodes::held(self.at(middle_s)),
            Self::Switched { at_s, before, after } => {
                let drive = if middle_s < *at_s { before } else { after };
                drive.nodes_between(from_s, to_s)
            }
            Self::Late { drive, by_s } => drive.nodes_between(from_s - by_s, to_s - by_s),
            Self::Interrupted { drive, off } => {
                let Nodes { start, middle, end } = drive.nodes_between(from_s, to_s);
                let share = |time_s: f64| off.share(time_s).0;
                Nodes {
                    start: start * share(from_s),
                    middle: middle * share(middle_s),
                    end: end * share(to_s),
                }
            }
            Self::Constant { .. }
            | Self::Sine { .. }
            | Self::Sweep { .. }
            | Self::Tones { .. }
            | Self::Rate { .. }
            | Self::Recorded { .. } => {
                Nodes { start: self.at(from_s), middle: self.at(middle_s), end: self.at(to_s) }
            }
        }
    }
}

/// Calls `each` with the parts of an interval between which one of these drives jumps: begin and end of each part.
fn each_part(drives: &[Drive], from_s: f64, to_s: f64, mut each: impl FnMut(f64, f64)) {
    // A part shorter than rounding is none.
    let tiny = 1e-9 * (to_s - from_s);
    let mut start = from_s;
    while start < to_s {
        let jumps = drives.iter().filter_map(|drive| drive.next_jump_s(start + tiny));
        let end = jumps.fold(to_s, f64::min);
        let end = if end < to_s - tiny { end } else { to_s };
        each(start, end);
        start = end;
    }
}

/// The same as [`Drive::parts`] for several drives at once, whose nodes are written to `nodes`: begin and end of each part, and all
/// drives over it, 0 of those that are not `wanted`.
pub fn parts_of_all(
    (drives, wanted): (&[Drive], &[bool]),
    (from_s, to_s): (f64, f64),
    nodes: &mut [Vec<f64>; 3],
    each: &mut impl FnMut(f64, f64, &Nodes<&[f64]>),
) {
    each_part(drives, from_s, to_s, |start, end| {
        nodes.iter_mut().for_each(Vec::clear);
        for (drive, wanted) in drives.iter().zip(wanted) {
            let of = if *wanted { drive.nodes_between(start, end) } else { Nodes::held(0.0) };
            for (list, value) in nodes.iter_mut().zip([of.start, of.middle, of.end]) {
                list.push(value);
            }
        }
        let [first, middle, last] = &*nodes;
        each(start, end, &Nodes { start: first, middle, end: last });
    });
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    /// Mean and component of V² by a sum over a fine grid.
    fn by_sum(drive: &Drive, harmonic: u32) -> (f64, f64) {
        let period = drive.period_s().unwrap();
        let (mut mean, mut cosine, mut sine) = (0.0, 0.0, 0.0);
        let n = 20_000;
        for i in 0..n {
            let part = (f64::from(i) + 0.5) / f64::from(n);
            let square = drive.at(part * period).powi(2);
            let (s, c) = (TAU * f64::from(harmonic) * part).sin_cos();
            mean += square / f64::from(n);
            cosine += 2.0 * square * c / f64::from(n);
            sine += 2.0 * square * s / f64::from(n);
        }
        (mean, cosine.hypot(sine))
    }

    #[test]
    fn the_components_of_the_square_are_those_of_a_sum() {
        let sine = Drive::Sine { offset: 30.0, amplitude: -20.0, frequency_hz: 3e4, phase_rad: 0.3 };
        let square = Drive::Square { low: 10.0, high: 60.0, frequency_hz: 3e4, duty: 0.3 };
        for drive in [sine, square] {
            for harmonic in 1..5 {
                let (ours, summed) = (drive.square(harmonic).unwrap(), by_sum(&drive, harmonic));
                assert_relative_eq!(ours.0, summed.0, max_relative = 1e-6);
                assert_relative_eq!(ours.1, summed.1, max_relative = 1e-6, epsilon = 1e-6);
            }
        }
    }

    #[test]
    fn a_sweep_has_its_stated_frequency() {
        let sweep =
            Drive::Sweep { offset: 1.0, amplitude: 2.0, from_hz: 100.0, to_hz: 60.0, duration_s: 2.0 };
        // Rising zeros are where the phase is whole: n = 100·t − 10·t² up to 2 s, then 160 + 60·(t − 2).
        for n in 0..160 {
            let t = 5.0 - (25.0 - 0.1 * f64::from(n)).sqrt();
            assert!((sweep.at(t) - 1.0).abs() < 1e-9 && sweep.at(t + 1e-4) > 1.0, "{n}");
        }
        assert_relative_eq!(sweep.at(2.0 + 0.25 / 60.0), 3.0, max_relative = 1e-9);
    }

    #[test]
    fn the_slope_is_that_of_differences() {
        let sine = Drive::Sine { offset: 30.0, amplitude: -20.0, frequency_hz: 3e4, phase_rad: 0.3 };
        let sweep =
            Drive::Sweep { offset: 1.0, amplitude: 2.0, from_hz: 3.2e4, to_hz: 3.1e4, duration_s: 1e-3 };
        for drive in [sine, sweep] {
            for i in 0..200 {
                let (t, h) = (7e-6 * f64::from(i) + 1e-6, 1e-9);
                let difference = (drive.at(t + h) - drive.at(t - h)) / (2.0 * h);
                assert!((drive.slope(t).unwrap() - difference).abs() < 2.0, "{drive:?} {t}");
            }
        }
        assert_eq!(Drive::Constant { level: 3.0 }.slope(0.1), Some(0.0));
        assert_eq!(Drive::Square { low: 0.0, high: 1.0, frequency_hz: 1.0, duty: 0.5 }.slope(0.1), None);
    }

    #[test]
    fn power_goes_and_comes_back_as_an_exponential() {
        let sine = Drive::Sine { offset: 30.0, amplitude: 30.0, frequency_hz: 1250.0, phase_rad: 0.3 };
        let off = Interruptions { first_s: 1e-3, lasting_s: 2e-3, every_s: 5e-3, transient_s: 2e-5 };
        let drive = Drive::Interrupted { drive: Box::new(sine.clone()), off };
        assert_eq!(drive.at(0.9e-3), sine.at(0.9e-3));
        for cycle in [0.0, 5e-3, 10e-3] {
            let kept = |t: f64| drive.at(cycle + t) / sine.at(cycle + t);
            assert_relative_eq!(kept(1e-3 + 3e-5), (-1.5_f64).exp(), max_relative = 1e-9);
            assert_relative_eq!(kept(3e-3 + 3e-5), 1.0 - (-1.5_f64).exp(), max_relative = 1e-9);
            assert!(kept(2.9e-3) < 1e-9 && (kept(5.9e-3) - 1.0).abs() < 1e-9);
            assert!(off.is_off(cycle + 1.1e-3) && !off.is_off(cycle + 3.1e-3));
            for t in [1.01e-3, 2e-3, 3.01e-3, 4e-3] {
                let (t, h) = (cycle + t, 1e-9);
                let difference = (drive.at(t + h) - drive.at(t - h)) / (2.0 * h);
                assert_relative_eq!(drive.slope(t).unwrap(), difference, max_relative = 1e-4, epsilon = 0.1);
            }
        }
        // Once and for all.
        let off = Interruptions {
            first_s: 0.0,
            lasting_s: f64::INFINITY,
            every_s: f64::INFINITY,
            transient_s: 2e-5,
        };
        let drive = Drive::Interrupted { drive: Box::new(sine), off };
        assert!(drive.at(1.0) == 0.0 && drive.at(-1e-6) > 1.0);
    }

    /// 28 000 · 0.5 µs is below 14 ms by rounding.
    #[test]
    fn a_sample_that_falls_on_a_jump_has_the_value_behind_it() {
        let square = Drive::Square { low: 0.0, high: 1.0, frequency_hz: 250.0, duty: 0.5 };
        let jumps = |k: u32| (2e-3 * f64::from(k), f64::from((k + 1) % 2));
        let steps = Drive::Steps { first: 0.0, steps: (0..1000).map(jumps).collect() };
        for jump in 0..1000_u32 {
            let (time_s, expected) = (f64::from(4000 * jump) * 5e-7, f64::from((jump + 1) % 2));
            assert_eq!((square.at(time_s), steps.at(time_s)), (expected, expected), "{jump}");
        }
    }

    #[test]
    fn the_parts_of_a_square_wave_lie_between_its_jumps() {
        let drive = Drive::Square { low: 1.0, high: 5.0, frequency_hz: 10.0, duty: 0.25 };
        let mut parts = Vec::new();
        drive.parts(0.01, 0.26, &mut |from, to, nodes| {
            assert_eq!((nodes.start, nodes.end), (nodes.middle, nodes.middle));
            parts.push((from, to, nodes.middle));
        });
        let ends = [0.01, 0.025, 0.1, 0.125, 0.2, 0.225, 0.26];
        let expected = ends.windows(2).enumerate().map(|(i, e)| (e[0], e[1], [5.0, 1.0][i % 2]));
        assert_eq!(parts.len(), 6);
        for ((from, to, level), (a, b, expected)) in parts.into_iter().zip(expected) {
            assert!((from - a).abs() < 1e-12 && (to - b).abs() < 1e-12 && level == expected);
        }
        // An interval that ends at a jump is one part.
        let mut count = 0;
        drive.parts(0.0, 0.025, &mut |_, _, nodes| {
            assert_eq!(nodes.middle, 5.0);
            count += 1;
        });
        assert_eq!(count, 1);
    }

    #[test]
    fn several_drives_are_cut_at_the_jumps_of_each() {
        let square = Drive::Square { low: 1.0, high: 5.0, frequency_hz: 10.0, duty: 0.25 };
        let steps = Drive::Steps { first: 0.0, steps: vec![(0.05, 2.0), (0.11, -1.0)] };
        let ring_down = Drive::Switched {
            at_s: 0.07,
            before: Box::new(Drive::Tones {
                offset: 1.0,
                tones: vec![Tone { amplitude: 1.0, frequency_hz: 1.0, phase_rad: 0.0 }],
            }),
            after: Box::new(Drive::Constant { level: 3.0 }),
        };
        let late = Drive::Late { drive: Box::new(steps.clone()), by_s: -0.02 };
        let drives = [square, steps, ring_down, late];
        let mut nodes = [const { Vec::new() }; 3];
        let mut found: Vec<(f64, f64, Vec<f64>)> = Vec::new();
        parts_of_all((&drives, &[true; 4]), (0.0, 0.13), &mut nodes, &mut |from, to, nodes| {
            // Within a part no drive jumps, and at its ends each is what it is within.
            for (k, drive) in drives.iter().enumerate() {
                let inside = [from + 1e-9, from.midpoint(to), to - 1e-9].map(|t| drive.at(t));
                for (found, expected) in
                    [nodes.start[k], nodes.middle[k], nodes.end[k]].into_iter().zip(inside)
                {
                    assert!((found - expected).abs() < 1e-7, "{k} {from} {to}: {found} {expected}");
                }
            }
            found.push((from, to, nodes.middle.to_vec()));
        });
        let ends: Vec<f64> = found.iter().map(|(_, to, _)| *to).collect();
        let expected = [0.025, 0.03, 0.05, 0.07, 0.09, 0.1, 0.11, 0.125, 0.13];
        assert_eq!(ends.len(), expected.len(), "{ends:?}");
        assert!(ends.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12), "{ends:?}");
    }

    #[test]
    fn a_sweep_holds_its_first_frequency_before_it_begins() {
        let sweep = Drive::Sweep { offset: 0.0, amplitude: 1.0, from_hz: 10.0, to_hz: 20.0, duration_s: 1.0 };
        let before = Drive::Sine { offset: 0.0, amplitude: 1.0, frequency_hz: 10.0, phase_rad: 0.0 };
        for k in 1..50 {
            let t = -0.013 * f64::from(k);
            assert!((sweep.at(t) - before.at(t)).abs() < 1e-12);
            assert_relative_eq!(sweep.slope(t).unwrap(), before.slope(t).unwrap(), max_relative = 1e-9);
        }
    }

    #[test]
    fn a_recorded_drive_is_cubic_between_and_held_beyond() {
        let time_s: Vec<f64> = (0..100).map(|k| f64::from(k) * 1e-6).collect();
        let sine = Drive::Sine { offset: 90.0, amplitude: 90.0, frequency_hz: 31_350.0, phase_rad: 0.0 };
        let volts = time_s.iter().map(|t| sine.at(*t)).collect();
        let recorded = Drive::Recorded { time_s, volts };
        assert!((recorded.at(50.5e-6) - sine.at(50.5e-6)).abs() < 5e-3);
        assert_eq!(recorded.at(50e-6), sine.at(50e-6));
        assert_eq!((recorded.at(-1.0), recorded.at(1.0)), (sine.at(0.0), sine.at(99e-6)));
    }
}
