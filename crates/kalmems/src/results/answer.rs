//! What an estimate says of the motion, in one sentence.

use super::summary::{budget_table, parameters_table, segment_name, shown, summary_table};
use super::{EstimatorMetrics, Metrics, RecordingMetrics, SegmentMetrics};
use crate::estimate::{SegmentEstimate, StateSeries, Trajectory};
use crate::evaluate::{ComparisonExtent, Grade, ValueState, mean_phase_shift};
use crate::inspect::quantity;
use crate::signal::{Extreme, Sine, extremes_of_angle, extremes_of_rate, fit_sine_near};
use crate::units::kind;
use kalmems_models::constants::STANDARD_GRAVITY;
use serde::Serialize;
use std::ops::Range;

/// What a filter says of one quantity after the settling time, and how well it claims to know it; in SI.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct QuantityAnswer {
    /// The quantity, by its name among the states.
    pub quantity: &'static str,
    /// Its SI unit as column names have it.
    pub unit: &'static str,
    /// How it moves.
    #[serde(flatten)]
    pub motion: AnsweredMotion,
    /// The root mean square of its claimed standard deviations; `None` of a method that claims none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub known_to: Option<f64>,
    /// Whether the signals do not tell its sign and nothing states it: the opposite answer, its peaks half a cycle later, is as good.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub sign_is_arbitrary: bool,
    /// Whether the drive has one peak in a cycle, so that the other sign has its peaks elsewhere.
    #[serde(skip)]
    peaks_tell_sign: bool,
    #[serde(skip)]
    is_angle: bool,
    #[serde(skip)]
    samples: f64,
}

/// How a quantity moves.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum AnsweredMotion {
    /// As a steady sine.
    Oscillation {
        /// The mean in SI.
        mean: f64,
        /// The amplitude in SI.
        amplitude: f64,
        /// Its frequency in Hz.
        frequency_hz: f64,
        /// The part of its cycle, in degrees, by which its peaks come after those of the drive, where that is a steady sine of the same frequency
        /// or of twice this.
        #[serde(skip_serializing_if = "Option::is_none")]
        after_drive_deg: Option<f64>,
    },
    /// In any other way.
    Course {
        /// The mean in SI.
        mean: f64,
        /// Its smallest value.
        lowest: f64,
        /// Its largest value.
        highest: f64,
    },
}

/// Samples that a sine is fitted to at most, evenly from all there are.
const FITTED: usize = 2048;

/// The root mean square of what a sine leaves, in amplitudes of it, up to which a motion is one.
const STEADY: f64 = 0.1;

impl QuantityAnswer {
    /// What a trajectory says between these samples of what its device is for: its first value that is no angle, or its angles.
    pub(super) fn all_of(
        trajectory: &Trajectory,
        scored: &Range<usize>,
        values: &[ValueState],
        estimate: &SegmentEstimate,
    ) -> Vec<Self> {
        let is_meant = |name: &str, is_angle: bool| match values.first() {
            Some(value) => value.name == name,
            None => is_angle,
        };
        let of = |(place, state): (usize, &StateSeries)| {
            let is_angle = state.kind.name == kind::ANGLE.name;
            // What follows from the states, such as a phase, is no angle of the device.
            let is_own = place < trajectory.own_states;
            let mean = state.mean.get(scored.clone()).filter(|_| is_meant(state.name, is_angle && is_own))?;
            let time_s = trajectory.time_s.get(scored.clone())?;
            let finite = || mean.iter().copied().filter(|value| value.is_finite());
            let samples = finite().count() as f64;
            let rate = values.first().map_or_else(
                || trajectory.states.get(place + 1).filter(|next| next.kind.name == kind::ANGULAR_RATE.name),
                |value| trajectory.state(value.rate?),
            );
            let rate = rate.and_then(|rate| rate.mean.get(scored.clone()));
            let motion = oscillation(time_s, mean, rate, estimate).or_else(|| {
                let [lowest, highest] =
                    [finite().fold(f64::INFINITY, f64::min), finite().fold(f64::NEG_INFINITY, f64::max)];
                let mean = finite().sum::<f64>() / samples;
                (samples > 0.0).then_some(AnsweredMotion::Course { mean, lowest, highest })
            })?;
            let sds = state.sd.get(scored.clone()).unwrap_or_default();
            let (count, squares) = sds
                .iter()
                .filter(|sd| sd.is_finite())
                .fold((0.0, 0.0), |(count, squares), sd| (count + 1.0, squares + sd * sd));
            let known_to = (count > 0.0).then(|| f64::sqrt(squares / count));
            let peaks_tell_sign =
                estimate.drive.is_some_and(|drive| drive.frequency_hz < 1.5 * motion.frequency_hz());
            Some(Self {
                quantity: state.name,
                unit: state.unit,
                motion,
                known_to,
                sign_is_arbitrary: (trajectory.hides_sign(place) || trajectory.hides_turn(place))
                    && trajectory.period(place).is_none(),
                peaks_tell_sign,
                is_angle,
                samples,
            })
        };
        trajectory.states.iter().enumerate().filter_map(of).collect()
    }

    /// Takes what a later part of the segment says in.
    pub(super) fn pool(&mut self, later: &Self) {
        let (own, others) = (self.samples, later.samples);
        let mean_of = |a: f64, b: f64| (a * own + b * others) / (own + others);
        self.motion = match (self.motion, later.motion) {
            (
                AnsweredMotion::Oscillation { mean, amplitude, frequency_hz, after_drive_deg },
                AnsweredMotion::Oscillation {
                    mean: later_mean,
                    amplitude: later_amplitude,
                    frequency_hz: later_hz,
                    after_drive_deg: later_deg,
                },
            ) => AnsweredMotion::Oscillation {
                mean: mean_of(mean, later_mean),
                amplitude: mean_of(amplitude, later_amplitude),
                frequency_hz: mean_of(frequency_hz, later_hz),
                after_drive_deg: after_drive_deg.zip(later_deg).map(|(a, b)| {
                    // The shorter way round.
                    let turn = (b - a) - 360.0 * ((b - a) / 360.0).round();
                    (a + turn * others / (own + others)).rem_euclid(360.0)
                }),
            },
            (a, b) => {
                let ([mean, low, high], [later_mean, later_low, later_high]) = (a.course(), b.course());
                AnsweredMotion::Course {
                    mean: mean_of(mean, later_mean),
                    lowest: low.min(later_low),
                    highest: high.max(later_high),
                }
            }
        };
        self.known_to = self.known_to.zip(later.known_to).map(|(a, b)| mean_of(a * a, b * b).sqrt());
        self.samples += others;
    }

    /// The sentence, with the filter and its grade: `angle: amplitude 8.922 deg at 15.675 kHz, ± 0.008 deg (one standard deviation, claimed by EKF:
    /// passes)`.
    pub fn sentence(&self, filter: &str, grade: Grade) -> String {
        let (unit, factor) = shown_for_people(self.unit, self.is_angle);
        let sd = self.known_to.map(|sd| sd * factor);
        let shown = |value: f64| quantity(to_the_last_digit(value * factor, sd), &unit);
        let motion = match self.motion {
            AnsweredMotion::Oscillation { mean, amplitude, frequency_hz, after_drive_deg } => {
                let mut text = format!("amplitude {} at {}", shown(amplitude), quantity(frequency_hz, "Hz"));
                if mean.abs() > 1e-3 * amplitude {
                    text += &format!(" about {}", shown(mean));
                }
                if let Some(degrees) = after_drive_deg {
                    let or_mirrored = if self.sign_is_arbitrary && self.peaks_tell_sign {
                        format!("° or {:.1}", (degrees + 180.0).rem_euclid(360.0))
                    } else {
                        String::new()
                    };
                    text +=
                        &format!(", peaks {degrees:.1}{or_mirrored}° of its cycle after those of the drive");
                }
                text
            }
            AnsweredMotion::Course { mean, lowest, highest } => {
                format!("{} on average, from {} to {}", shown(mean), shown(lowest), shown(highest))
            }
        };
        let known = sd.map_or_else(
            || format!(" ({filter}: {grade})"),
            |sd| {
                let sd = quantity(two_digits(sd), &unit);
                format!(", ± {sd} (one standard deviation, claimed by {filter}: {grade})")
            },
        );
        let sign = if self.sign_is_arbitrary { "; its sign is arbitrary" } else { "" };
        format!("{}: {motion}{known}{sign}", self.quantity)
    }
}

impl AnsweredMotion {
    /// Its frequency in Hz; 0 of what is no oscillation.
    const fn frequency_hz(self) -> f64 {
        match self {
            Self::Oscillation { frequency_hz, .. } => frequency_hz,
            Self::Course { .. } => 0.0,
        }
    }

    /// Mean, smallest and largest value.
    fn course(self) -> [f64; 3] {
        match self {
            Self::Oscillation { mean, amplitude, .. } => [mean, mean - amplitude, mean + amplitude],
            Self::Course { mean, lowest, highest } => [mean, lowest, highest],
        }
    }
}

/// The sine that these samples follow near the frequency of the motion, where they follow one.
fn oscillation(
    time_s: &[f64],
    mean: &[f64],
    rate: Option<&[f64]>,
    estimate: &SegmentEstimate,
) -> Option<AnsweredMotion> {
    let every = mean.len().div_ceil(FITTED).max(1);
    let thinned = |values: &[f64]| values.iter().step_by(every).copied().collect::<Vec<f64>>();
    let sine = fit_sine_near(&thinned(time_s), &thinned(mean), estimate.motion.frequency_hz)
        .filter(|sine| sine.residual_rms < STEADY * sine.amplitude)?;
    let peaks = || {
        rate.map_or_else(
            || extremes_of_angle(time_s, mean, sine.frequency_hz),
            |rate| extremes_of_rate(time_s, rate),
        )
    };
    let after_drive_deg =
        estimate.drive.as_ref().and_then(|drive| after_drive_deg(peaks, sine.frequency_hz, drive));
    Some(AnsweredMotion::Oscillation {
        mean: sine.offset,
        amplitude: sine.amplitude,
        frequency_hz: sine.frequency_hz,
        after_drive_deg,
    })
}

/// The part of a motion's cycle, in degrees, from a peak of its drive to the next of its own peaks, on average; where the drive has as many
/// peaks as the motion, or as many as its turning points.
fn after_drive_deg(peaks: impl Fn() -> Vec<Extreme>, motion_hz: f64, drive: &Sine) -> Option<f64> {
    let ratio = drive.frequency_hz / motion_hz;
    let cycles = ratio.round();
    if !(1.0..=2.0).contains(&cycles) || (ratio - cycles).abs() > 1e-3 {
        return None;
    }
    let mut peaks = peaks();
    // Minima are half a cycle of such a drive from it.
    peaks.retain(|peak| peak.maximum || cycles > 1.0);
    mean_phase_shift(&peaks, ComparisonExtent { from_s: f64::NEG_INFINITY, motion_hz, drive: Some(drive) })
}

/// The unit in which a sentence has a quantity, and how many of it one of the SI unit is: of those that take a prefix in SI, angles in degrees and
/// accelerations in standard gravities.
pub(crate) fn shown_for_people(unit: &'static str, is_angle: bool) -> (String, f64) {
    let (unit, factor) = match unit {
        _ if is_angle => ("deg", 1_f64.to_degrees()),
        "m_per_s2" => ("g", STANDARD_GRAVITY.recip()),
        "F" | "m" | "m_per_s" => (unit, 1.0),
        unit => shown(unit),
    };
    (unit.replace("_per_", "/").replace('_', " "), factor)
}

/// A value to the second digit of its standard deviation, and that with two digits, both with the unit.
pub(crate) fn value_and_sd(value: f64, sd: f64, unit: &str) -> [String; 2] {
    [quantity(to_the_last_digit(value, Some(sd)), unit), quantity(two_digits(sd), unit)]
}

/// A value to the second digit of its standard deviation: further ones say nothing.
fn to_the_last_digit(value: f64, sd: Option<f64>) -> f64 {
    let Some(sd) = sd.filter(|sd| *sd > 0.0 && sd.is_finite()) else { return value };
    let exponent = format!("{sd:.1e}").rsplit('e').next().and_then(|text| text.parse::<i32>().ok());
    let step = exponent.and_then(|exponent| format!("1e{}", exponent - 1).parse::<f64>().ok());
    step.map_or(value, |step| (value / step).round() * step)
}

fn two_digits(value: f64) -> f64 {
    format!("{value:.1e}").parse().unwrap_or(value)
}

/// Segments whose answers are said.
const SAID: usize = 4;

/// The answers of a result, a sentence each, of the filter of each segment that comes first by its grade; where there are many segments, of the first.
pub(super) fn answers(metrics: &Metrics) -> Vec<String> {
    let segments =
        || metrics.recordings.iter().flat_map(|one| one.segments.iter().map(move |segment| (one, segment)));
    let count = segments().count();
    let of = |(recording, segment): (&RecordingMetrics, &SegmentMetrics)| {
        let best = segment.best().filter(|best| best.grade < Some(Grade::NoEstimate));
        let place = if count > 1 { segment_name(&recording.name, segment) + ": " } else { String::new() };
        let said = best.into_iter().flat_map(|best| best.answer.iter().map(move |one| (best, one)));
        let sentence = |(best, one): (&EstimatorMetrics, &QuantityAnswer)| {
            let grade = best.grade.unwrap_or(Grade::NoEstimate);
            format!("{place}{}", one.sentence(&best.name, grade))
        };
        said.map(sentence).collect::<Vec<String>>()
    };
    let mut said: Vec<String> = segments().take(SAID).flat_map(of).collect();
    if count > SAID {
        said.push(format!("{} further segments: `metrics.json`, key `answer`", count - SAID));
    }
    said
}

/// What a run prints: its answers, and below them its tables in lines of at most so many characters.
pub fn summary_text(metrics: &Metrics, with_durations: bool, columns: usize) -> String {
    let tables =
        [Some(summary_table(metrics, with_durations)), parameters_table(metrics), budget_table(metrics)];
    let answers = metrics.answer.join("\n");
    let answers = (!answers.is_empty()).then(|| answers + "\n");
    let tables = tables.into_iter().flatten().map(|table| table.to_text_within(columns));
    answers.into_iter().chain(tables).collect::<Vec<String>>().join("\n")
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    /// Turning points of cos(2πft + φ), maxima first.
    fn peaks(frequency_hz: f64, phase_rad: f64) -> Vec<Extreme> {
        let of = |half: u32| Extreme {
            time_s: (f64::from(half) * 0.5 - phase_rad / TAU) / frequency_hz,
            maximum: half.is_multiple_of(2),
        };
        (4..40).map(of).collect()
    }

    fn drive(frequency_hz: f64, phase_rad: f64) -> Sine {
        Sine { offset: 0.0, amplitude: 1.0, frequency_hz, phase_rad, residual_rms: 0.0 }
    }

    #[test]
    fn peaks_are_counted_from_those_of_the_drive_in_cycles_of_the_motion() {
        let found = |phase_rad: f64, drive: Sine| after_drive_deg(|| peaks(100.0, phase_rad), 100.0, &drive);
        let close = |a: Option<f64>, b: f64| (a.unwrap() - b).abs() < 1e-9;
        assert!(close(found(-TAU / 4.0, drive(100.0, 0.0)), 90.0));
        assert!(close(found(TAU / 4.0, drive(100.0, 0.0)), 270.0));
        // Two peaks of the drive in a cycle of the motion.
        assert!(close(found(-TAU / 4.0 - 0.1, drive(200.0, -0.2)), 90.0));
        assert!(close(found(TAU / 4.0, drive(200.0, 0.0)), 90.0));
        assert_eq!(found(0.0, drive(130.0, 0.0)), None);
    }

    #[test]
    fn parts_are_pooled_by_their_samples() {
        let part = |amplitude: f64, degrees: f64, known_to: f64, samples: f64| QuantityAnswer {
            quantity: "angle",
            unit: "rad",
            motion: AnsweredMotion::Oscillation {
                mean: 0.0,
                amplitude,
                frequency_hz: 1e3,
                after_drive_deg: Some(degrees),
            },
            known_to: Some(known_to),
            sign_is_arbitrary: false,
            peaks_tell_sign: true,
            is_angle: true,
            samples,
        };
        let mut own = part(0.1, 350.0, 1e-3, 300.0);
        own.pool(&part(0.2, 10.0, 3e-3, 100.0));
        let AnsweredMotion::Oscillation { amplitude, after_drive_deg, .. } = own.motion else {
            panic!("{own:?}")
        };
        assert!((amplitude - 0.125).abs() < 1e-12 && (after_drive_deg.unwrap() - 355.0).abs() < 1e-9);
        let said = own.sentence("EKF", Grade::Passes);
        assert_eq!(
            said,
            "angle: amplitude 7.162 deg at 1 kHz, peaks 355.0° of its cycle after those of the drive, ± 0.099 deg (one standard deviation, \
             claimed by EKF: passes)"
        );
        // Half a cycle later by a drive of the same frequency; by one of twice that the turning points are at the same times.
        own.sign_is_arbitrary = true;
        let arbitrary = said.replace("355.0°", "355.0° or 175.0°") + "; its sign is arbitrary";
        assert_eq!(own.sentence("EKF", Grade::Passes), arbitrary);
        own.peaks_tell_sign = false;
        assert_eq!(own.sentence("EKF", Grade::Passes), said + "; its sign is arbitrary");
        let alone = |value: f64, sd: f64| to_the_last_digit(value, Some(sd));
        assert!((alone(-137.284, 14.2) + 137.0).abs() < 1e-9 && (alone(0.033_079, 0.1) - 0.03).abs() < 1e-12);
        assert!((alone(8.91994, 0.00996) - 8.92).abs() < 1e-9 && alone(1.0 / 3.0, 0.0) == 1.0 / 3.0);
        // 75 % with 1e-3, 25 % with 3e-3: √(0.75 + 2.25)·1e-3.
        assert!((own.known_to.unwrap() - 3_f64.sqrt() * 1e-3).abs() < 1e-12);
    }
}
