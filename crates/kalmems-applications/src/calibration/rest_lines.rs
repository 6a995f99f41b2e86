//! Lines in a record at rest, which are fitted part by part and subtracted.

use super::rest_spectrum::RestLine;
use crate::signal::{Sine, fit_sine_near};
use kalmems_core::Portable;
use std::f64::consts::PI;

/// The shortest part in cycles that is fitted by itself; over a shorter one the sine of the part before goes on.
const FEWEST_CYCLES: f64 = 30.0;
/// The strongest one of lines that are nearer to one another than so many widths of a line in a part is fitted alone.
const APART: f64 = 2.0;

/// The lines of a channel, the strongest first, with the sine of the last part. Times are in samples, and frequencies in cycles per sample.
#[derive(Clone, Debug, Default)]
pub(super) struct RestLines {
    lines: Vec<(RestLine, Option<Sine>)>,
    /// The longest part that was fitted.
    longest: f64,
}

impl RestLines {
    pub fn of(lines: Vec<RestLine>) -> Self {
        Self { lines: lines.into_iter().map(|line| (line, None)).collect(), longest: 0.0 }
    }

    pub const fn is_empty(&self) -> bool {
        self.lines.is_empty()
    }

    pub fn each(&self) -> impl Iterator<Item = &RestLine> {
        self.lines.iter().map(|(line, _)| line)
    }

    /// Takes the lines off the samples of one part; those that are missing are not finite.
    pub fn subtract(&mut self, times: &[f64], values: &mut [f64]) {
        let [Some(first), Some(last)] = [times.first(), times.last()] else { return };
        let span = last - first;
        let mut taken: Vec<f64> = Vec::new();
        for (RestLine { frequency, .. }, sine) in &mut self.lines {
            if taken.iter().any(|other| (other - *frequency).abs() * span < APART) {
                continue;
            }
            taken.push(*frequency);
            if (*frequency * span >= FEWEST_CYCLES || sine.is_none())
                && let Some(found) = fit_sine_near(times, values, *frequency)
            {
                self.longest = self.longest.max(span);
                *sine = Some(found);
            }
            let Some(sine) = sine else { continue };
            for (time, value) in times.iter().zip(values.iter_mut()) {
                *value -= sine.at(*time) - sine.offset;
            }
        }
    }

    /// What comes next is another record.
    pub fn end_record(&mut self) {
        self.lines.iter_mut().for_each(|(_, sine)| *sine = None);
    }

    /// The part of the Allan variance of white noise, at an averaging time of so many samples, that went with the lines: the amplitude, phase and
    /// frequency of each are three numbers of a part of N samples, and two numbers at f have 4m/N·sin⁴(πfm)/(πfm)² of it.
    pub fn share(&self, factor: usize) -> f64 {
        let m = factor as f64;
        let each = self.lines.iter().map(|(line, _)| {
            let x = PI * line.frequency * m;
            6.0 * m / self.longest * x.portable_sin().powi(4) / (x * x)
        });
        if self.longest > 0.0 { each.sum::<f64>().min(0.5) } else { 0.0 }
    }
}
