//! One vibration as several channels of one instrument show it.

use crate::identify::Whiteness;
use crate::signal::{PortableComplex, fit_sine, fit_sine_at, least_squares};
use kalmems_core::Portable;
use realfft::num_complex::Complex64;
use statrs::distribution::{ChiSquared, ContinuousCDF};
use std::f64::consts::TAU;

/// Periods that a record must have.
pub const FEWEST_PERIODS: f64 = 4.0;

/// Samples that a record must have.
pub const FEWEST_SAMPLES: usize = 32;

/// Pieces in which a record's phase is looked at.
const PIECES: usize = 8;

/// What a wandering clock may take from an amplitude, as a part of it.
const LARGEST_LOSS: f64 = 1e-4;

/// Simultaneous samples of up to three axes.
#[derive(Clone, Debug, PartialEq)]
pub struct AxisSignals {
    /// When they were taken, on the instrument's own clock, in s.
    pub time_s: Vec<f64>,
    /// The values of x, y and z; NaN where there is none.
    pub axes: [Option<Vec<f64>>; 3],
}

/// A vibration at one frequency: y(t) = offset + Re(phasor·e^{jω(t − t_m)}) for each axis, t_m the middle of the record.
#[derive(Clone, Debug, PartialEq)]
pub struct VibrationTone {
    /// The frequency on the instrument's own clock in Hz.
    pub frequency_hz: f64,
    /// Its standard deviation.
    pub frequency_deviation_hz: f64,
    /// How many periods the record has.
    pub periods: f64,
    /// The axis with the largest amplitude.
    pub main: usize,
    /// What each axis shows.
    pub axes: [Option<Component>; 3],
    /// By what part the amplitude is too small because the frequency wanders within the record; 0 where noise explains
    /// what is seen.
    pub wander_loss: f64,
}

/// The vibration in one channel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Component {
    /// Amplitude and phase in the middle of the record, in the channel's unit.
    pub phasor: Complex64,
    /// The standard deviation of either part of it.
    pub deviation: f64,
    /// The mean.
    pub offset: f64,
    /// Its standard deviation.
    pub offset_deviation: f64,
    /// The root mean square of what sine and harmonics leave.
    pub residual: f64,
    /// The amplitude of the second and third harmonic together, as a part of the amplitude.
    pub distortion: f64,
    /// Whether what is left is white.
    pub white: bool,
}

/// Why a record shows no vibration that could be measured.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ToneError {
    /// Too little of it.
    #[error(
        "found {samples} samples over {periods:.1} periods; expected at least {FEWEST_SAMPLES} samples and \
         {FEWEST_PERIODS} periods: take a longer record"
    )]
    Short {
        /// Samples with a number.
        samples: usize,
        /// Periods.
        periods: f64,
    },
    /// No sine.
    #[error(
        "no sine is found in it: the largest leaves {part:.0} % of its amplitude; expected a vibration at one frequency: \
         check the column, and that the stage was driven"
    )]
    NoSine {
        /// The residual by the amplitude in %.
        part: f64,
    },
    /// A sweep takes all samples.
    #[error(
        "{samples} of its samples are missing; expected a sweep without a gap: repeat it, or give the parts before and after as records"
    )]
    Missing {
        /// Samples without a number.
        samples: usize,
    },
    /// Nothing of the reference is seen.
    #[error(
        "in no band does the sensor follow the reference; expected a sweep or noise that begins and ends at rest: check the columns, and that it was driven"
    )]
    NoBand,
    /// The converter was at its end.
    #[error(
        "axis {axis} is clipped: {samples} of its samples are at {level:.6}; expected a range above the largest rate: drive \
         less, or choose the instrument's next range"
    )]
    Clipped {
        /// `x`, `y` or `z`.
        axis: &'static str,
        /// How many samples.
        samples: usize,
        /// Where.
        level: f64,
    },
    /// The frequency is not one.
    #[error(
        "its frequency wanders against {frequency_hz:.3} Hz by {wander_rad:.3} rad within the record, which takes {ppm:.0} ppm \
         of the amplitude: the clocks drift apart; take shorter records, or let instrument and drive settle"
    )]
    Wanders {
        /// The mean frequency.
        frequency_hz: f64,
        /// The root mean square of the phase about a straight line.
        wander_rad: f64,
        /// What is lost.
        ppm: f64,
    },
}

/// The names of the axes.
pub const AXES: [&str; 3] = ["x", "y", "z"];

impl AxisSignals {
    /// The sine that all axes share: its frequency from the axis that moves most, by a fit with four parameters, and at
    /// that frequency amplitude, phase and offset of each, beside the second and third harmonic where sampling keeps
    /// them apart.
    ///
    /// Noise is that of the residuals where these are white; otherwise it is their spectrum beside the line. Values as
    /// large as `full_scale` are clipped; without it, a value that repeats at the extremes far more often than a sine's
    /// crest would.
    pub fn tone(&self, full_scale: Option<f64>) -> Result<VibrationTone, ToneError> {
        let count = self.time_s.len();
        let present = || (0..3).filter_map(|axis| Some((axis, self.axes[axis].as_ref()?)));
        let spread = |values: &[f64]| {
            let finite: Vec<f64> = values.iter().copied().filter(|v| v.is_finite()).collect();
            let mean = finite.iter().sum::<f64>() / finite.len().max(1) as f64;
            finite.iter().map(|v| (v - mean).powi(2)).sum::<f64>()
        };
        let main = present().max_by(|a, b| spread(a.1).total_cmp(&spread(b.1)));
        let short = |periods| ToneError::Short { samples: count, periods };
        let (main, values) = main.ok_or_else(|| short(0.0))?;
        if count < FEWEST_SAMPLES || values.iter().filter(|v| v.is_finite()).count() < FEWEST_SAMPLES {
            return Err(short(0.0));
        }
        let span = self.time_s[count - 1] - self.time_s[0];
        let interval = span / (count - 1) as f64;
        let sine = fit_sine(&self.time_s, values, interval).ok_or(ToneError::NoSine { part: 100.0 })?;
        let periods = sine.frequency_hz * span;
        if periods < FEWEST_PERIODS {
            return Err(short(periods));
        }
        if sine.residual_rms.is_nan() || sine.residual_rms > 0.2 * sine.amplitude {
            return Err(ToneError::NoSine { part: 100.0 * sine.residual_rms / sine.amplitude });
        }
        for (axis, values) in present() {
            if let Some((samples, level)) = clipped(values, full_scale) {
                return Err(ToneError::Clipped { axis: AXES[axis], samples, level });
            }
        }
        let axes = self.components(sine.frequency_hz);
        let Some(found) = axes[main] else { return Err(ToneError::NoSine { part: 100.0 }) };
        let amplitude = found.phasor.portable_norm();
        let wander = self.wander(values, sine.frequency_hz, amplitude, found.residual);
        let wander_loss = 0.5 * wander.powi(2);
        if wander_loss > LARGEST_LOSS {
            return Err(ToneError::Wanders {
                frequency_hz: sine.frequency_hz,
                wander_rad: wander,
                ppm: 1e6 * wander_loss,
            });
        }
        // Rife and Boorstyn's bound, IEEE Transactions on Information Theory 20, 591, 1974: 12/T² times the phase's variance.
        let frequency_deviation_hz =
            3.0_f64.sqrt() * found.deviation / (std::f64::consts::PI * span * amplitude);
        Ok(VibrationTone {
            frequency_hz: sine.frequency_hz,
            frequency_deviation_hz,
            periods,
            main,
            axes,
            wander_loss,
        })
    }

    /// What each axis shows at a frequency that is known from elsewhere; none where it cannot be told.
    pub fn components(&self, frequency_hz: f64) -> [Option<Component>; 3] {
        let interval = match self.time_s.as_slice() {
            [first, .., last] => (last - first) / (self.time_s.len() - 1) as f64,
            _ => return [None; 3],
        };
        std::array::from_fn(|axis| component(&self.time_s, self.axes[axis].as_ref()?, frequency_hz, interval))
    }

    /// The root mean square by which the phases of the record's pieces leave a straight line, less what noise makes of
    /// it; 0 where noise alone explains it 999 times in 1000.
    fn wander(&self, values: &[f64], frequency_hz: f64, amplitude: f64, noise: f64) -> f64 {
        let size = values.len() / PIECES;
        let span = self.time_s[values.len() - 1] - self.time_s[0];
        if size < FEWEST_SAMPLES || frequency_hz * span < 3.0 * PIECES as f64 {
            return 0.0;
        }
        let mut phases = Vec::new();
        for piece in 0..PIECES {
            let rows = piece * size..(piece + 1) * size;
            let Some(sine) = fit_sine_at(&self.time_s[rows.clone()], &values[rows], frequency_hz) else {
                return 0.0;
            };
            let before = phases.last().copied().unwrap_or(sine.phase_rad);
            phases.push(sine.phase_rad + TAU * ((before - sine.phase_rad) / TAU).round());
        }
        let position = |k: usize| k as f64 - 0.5 * (PIECES - 1) as f64;
        let mean = phases.iter().sum::<f64>() / PIECES as f64;
        let slope = phases.iter().enumerate().map(|(k, p)| position(k) * (p - mean)).sum::<f64>()
            / (0..PIECES).map(|k| position(k).powi(2)).sum::<f64>();
        let freedom = (PIECES - 2) as f64;
        let left: f64 =
            phases.iter().enumerate().map(|(k, p)| (p - mean - slope * position(k)).powi(2)).sum();
        let expected = 2.0 * noise.powi(2) / (size as f64 * amplitude.powi(2));
        let limit = ChiSquared::new(freedom).map_or(f64::INFINITY, |law| law.inverse_cdf(0.999));
        if left <= expected * limit { 0.0 } else { (left / freedom - expected).max(0.0).sqrt() }
    }
}

/// Harmonics that are fitted beside the sine.
const HARMONICS: [f64; 2] = [2.0, 3.0];

/// A sine of known frequency with its harmonics, and the noise about them.
fn component(time_s: &[f64], values: &[f64], frequency_hz: f64, interval: f64) -> Option<Component> {
    let middle = time_s.first()?.midpoint(*time_s.last()?);
    let turn = |t: f64| TAU * frequency_hz * (t - middle);
    let basis = |t: f64| {
        let mut row = [1.0; 7];
        (row[2], row[1]) = turn(t).portable_sin_cos();
        for (k, order) in HARMONICS.iter().enumerate() {
            (row[4 + 2 * k], row[3 + 2 * k]) = (order * turn(t)).portable_sin_cos();
        }
        row
    };
    let found = if apart(frequency_hz * interval, time_s.len()) {
        least_squares(time_s, values, basis)?
    } else {
        let [offset, c, s] = least_squares(time_s, values, |t| {
            let (s, c) = turn(t).portable_sin_cos();
            [1.0, c, s]
        })?;
        [offset, c, s, 0.0, 0.0, 0.0, 0.0]
    };
    let model = |t: f64| basis(t).iter().zip(&found).map(|(b, f)| b * f).sum::<f64>();
    let residuals: Vec<f64> = time_s.iter().zip(values).map(|(t, v)| v - model(*t)).collect();
    let finite = || residuals.iter().filter(|r| r.is_finite());
    let count = finite().count() as f64;
    let variance = finite().map(|r| r * r).sum::<f64>() / (count - 8.0).max(1.0);
    let white = Whiteness::of(&residuals).is_white();
    let (at_line, at_rest) = if white {
        (variance, variance)
    } else {
        (beside(&residuals, frequency_hz * interval), beside(&residuals, 0.0).max(variance))
    };
    let phasor = Complex64::new(found[1], -found[2]);
    Some(Component {
        phasor,
        deviation: (2.0 * at_line / count).sqrt(),
        offset: found[0],
        offset_deviation: (at_rest / count).sqrt(),
        residual: variance.sqrt(),
        distortion: found[3..].iter().map(|f| f * f).sum::<f64>().sqrt() / phasor.portable_norm(),
        white,
    })
}

/// Whether sampling keeps line, harmonics and mean apart, by two widths of a line.
fn apart(cycles_per_sample: f64, count: usize) -> bool {
    let folded = |order: f64| {
        let cycles = order * cycles_per_sample;
        (cycles - cycles.round()).abs()
    };
    let lines = [0.0, folded(1.0), folded(HARMONICS[0]), folded(HARMONICS[1]), 0.5];
    let width = 2.0 / count as f64;
    (0..lines.len()).all(|i| (0..i).all(|j| (lines[i] - lines[j]).abs() > width))
}

/// The mean of |Σ r·e^{−jω}|²/N over lines on both sides of a frequency, which for white noise is its variance.
fn beside(residuals: &[f64], cycles_per_sample: f64) -> f64 {
    let count = residuals.len() as f64;
    let line = |cycles: f64| {
        let (mut re, mut im) = (0.0, 0.0);
        for (k, r) in residuals.iter().enumerate().filter(|(_, r)| r.is_finite()) {
            let (s, c) = (TAU * cycles * k as f64).portable_sin_cos();
            re += r * c;
            im += r * s;
        }
        (re * re + im * im) / count
    };
    // The nearest ones lost their part to the fit.
    let offsets = [-5.0, -4.0, -3.0, -2.0, 2.0, 3.0, 4.0, 5.0];
    offsets.iter().map(|offset| line(cycles_per_sample + offset / count)).sum::<f64>() / offsets.len() as f64
}

/// How many samples are clipped, and where.
///
/// Without a known end of the range: of a sine of amplitude A in steps of q, a part acos(1 − q/A)/π is on its highest
/// step. Three times as many, and more than eight, are too many.
fn clipped(values: &[f64], full_scale: Option<f64>) -> Option<(usize, f64)> {
    let finite = || values.iter().copied().filter(|v| v.is_finite());
    let (low, high) = (finite().reduce(f64::min)?, finite().reduce(f64::max)?);
    if let Some(limit) = full_scale {
        let samples = finite().filter(|v| v.abs() >= limit * (1.0 - 1e-9)).count();
        return (samples > 0).then_some((samples, limit));
    }
    let count = finite().count() as f64;
    let at = |level: f64| {
        let samples = finite().filter(|v| *v == level).count();
        let step = finite().map(|v| (v - level).abs()).filter(|d| *d > 0.0).reduce(f64::min).unwrap_or(0.0);
        let part = (1.0 - (2.0 * step / (high - low)).min(2.0)).portable_acos() / std::f64::consts::PI;
        (samples > 8 && samples as f64 > 3.0 * part * count).then_some((samples, level))
    };
    at(high).or_else(|| at(low))
}
