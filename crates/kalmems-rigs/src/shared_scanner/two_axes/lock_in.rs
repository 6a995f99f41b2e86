//! Where both axes are, from the first milliseconds of the signal alone.

use crate::estimate::Swing;
use crate::fit::{ByDual, FitError, FitSettings, ResidualLaw, fit};
use crate::signal::least_squares;
use kalmems_core::Portable;
use kalmems_core::{Covariance, Dual, Mat, Over};
use kalmems_models::capacitance::GaussianComb;
use kalmems_models::readout::TwoAxisComb;
use std::f64::consts::{PI, TAU};

/// The motion of both axes over a window, as sines whose amplitude and phase drift linearly.
///
/// θ(t) = (A + g·τ)·sin(π·f·t′ + φ + δ·τ) for each axis: half the drive's frequency f, t′ from the first sample, τ
/// from the middle of the window. The signal is even in each angle, so that φ and φ + π are one answer: which of them
/// is the motion is known from elsewhere.
#[derive(Clone, Debug)]
pub struct TwoAxisBatchStart {
    /// A of x and y at the middle of the window, in rad. Positive.
    pub amplitude_rad: [f64; 2],
    /// φ of x and y, in rad, up to π.
    pub phase_rad: [f64; 2],
    /// The standard deviations of the amplitudes in rad, as the fit has them.
    pub amplitude_sd_rad: [f64; 2],
    /// The standard deviations of the phases in rad.
    pub phase_sd_rad: [f64; 2],
    /// The signal at no capacitance in V: the readout's offset, as the window has it.
    pub offset_v: f64,
    /// The root mean square of what is left, in V; the noise where the motion is such sines.
    pub residual_rms_v: f64,
    /// The state [θ_x, θ̇_x, θ_y, θ̇_y] at the first sample.
    pub mean: [f64; 4],
    /// Its covariance: that of the fit, and 2 % of each axis's motion for what such sines leave out.
    pub covariance: Covariance<f64, 4>,
}

/// Why a window does not tell the start.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum StartError {
    /// There is too little of it.
    #[error(
        "{samples} samples of the signal within {cycles:.1} cycles of the slower axis; expected at least 100 in 6 cycles; \
         take a longer recording"
    )]
    TooShort {
        /// Finite samples.
        samples: usize,
        /// Cycles of the slower motion.
        cycles: f64,
    },
    /// The lines of both axes cannot be distinguished in it.
    #[error(
        "the window does not tell the lines of the two axes apart; lengthen it, or move the drives apart"
    )]
    Inseparable,
    /// An axis does not move, or too little.
    #[error(
        "axis {axis}: its line in the signal is {line_v:.2e} V, and its standard deviation {sd_v:.1e} V; expected five times \
         that; the axis stands still, or the window is too short"
    )]
    NoMotion {
        /// `x` or `y`.
        axis: char,
        /// The amplitude of the line.
        line_v: f64,
        /// Its standard deviation.
        sd_v: f64,
    },
    /// The line of an axis is larger than its comb can make it.
    #[error(
        "axis {axis}: its line in the signal is {line_v:.3} V, and its comb makes {most_v:.3} V at most; check gain and \
         capacitances"
    )]
    TooLarge {
        /// `x` or `y`.
        axis: char,
        /// The amplitude of the line.
        line_v: f64,
        /// What the comb can make.
        most_v: f64,
    },
    /// The fit leaves too much.
    #[error(
        "the motion of two sines leaves {residual_v:.3} V of the signal's {signal_v:.3} V; the motion changes within the \
         window, or model and gain are wrong"
    )]
    Unexplained {
        /// The root mean square of what is left.
        residual_v: f64,
        /// That of the signal about its mean.
        signal_v: f64,
    },
    /// The fit does not settle.
    #[error(transparent)]
    Fit(#[from] FitError),
}

/// What a sine with linear drift may leave out of a motion, relative to it: harmonics and products of the drives.
/// It is also why the filter may use the window's samples again: this is far more than the window tells.
const LEFT_OUT: f64 = 0.02;

/// Amplitude, phase and their drifts of one axis.
const PER_AXIS: usize = 4;
/// Those of both, and the offset.
const UNKNOWNS: usize = 2 * PER_AXIS + 1;
/// Harmonics of each drive that the lock-in takes.
const HARMONICS: u8 = 3;
/// Columns of the lock-in: a mean, and the harmonics of each axis.
const COLUMNS: usize = 13;
/// How many times the width of a line, which is one over the window's length, the lines of a lock-in are apart at least.
const LINE_WIDTHS: f64 = 4.0;

impl TwoAxisBatchStart {
    /// From a window of the signal, given the frequencies of the two drives.
    ///
    /// A lock-in at both drives and their harmonics, all at once so that no axis leaks into the other, gives the line
    /// of each axis; the comb's law inverted makes amplitudes of them (see [`line_share`]); nonlinear least squares
    /// over the window then fits the signal itself.
    pub fn of(
        readout: &TwoAxisComb<f64>,
        time_s: &[f64],
        signal: &[f64],
        drives_hz: [f64; 2],
    ) -> Result<Self, StartError> {
        let (window, span) = StartWindow::of(readout, time_s, signal, drives_hz);
        let samples = window.samples();
        let cycles = 0.5 * span * drives_hz[0].min(drives_hz[1]);
        if samples < 100 || cycles < 6.0 {
            return Err(StartError::TooShort { samples, cycles });
        }
        let start = window.lock_in(samples)?;
        let found =
            fit(&ByDual(&window), &FitSettings { tolerance: 1e-10, ..FitSettings::from_start(start) })?;

        let residual_v = (found.sum_of_squares / samples as f64).sqrt();
        let signal_v = spread(signal);
        if residual_v > 0.5 * signal_v {
            return Err(StartError::Unexplained { residual_v, signal_v });
        }
        Ok(window.answer(&found.parameters, &found.covariance, residual_v))
    }
}

/// The swings of x and y that a lock-in at both drives and their harmonics finds in some samples; their signs are those that are
/// nearer to the swings before. `None` where the samples do not tell both.
pub fn swings(
    readout: &TwoAxisComb<f64>,
    (time_s, signal): (&[f64], &[f64]),
    drives_hz: [f64; 2],
    before: &[Swing],
) -> Option<Vec<Swing>> {
    let (window, _) = StartWindow::of(readout, time_s, signal, drives_hz);
    let unknowns = window.lock_in(window.samples()).ok()?;
    let swing = |axis: usize| {
        let [amplitude, phase] = [0, 1].map(|i| unknowns[PER_AXIS * axis + i]);
        let rate = PI * drives_hz[axis];
        let swing = Swing { rest: 0.0, amplitude, rate, phase: phase - rate * window.origin };
        swing.nearest_to(before.get(axis))
    };
    Some(vec![swing(0), swing(1)])
}

/// How long a window of the lock-in has to be in s, so that lines of one drive are told apart from those of the other: the
/// nearest two of them, of the first harmonics, are some widths of a line apart. Infinite where two lines coincide.
pub fn separating_s(drives_hz: [f64; 2]) -> f64 {
    let apart = |of_x: u8, of_y: u8| f64::from(of_x) * drives_hz[0] - f64::from(of_y) * drives_hz[1];
    let harmonics = || 1..=HARMONICS;
    let all = harmonics().flat_map(|of_x| harmonics().map(move |of_y| apart(of_x, of_y).abs()));
    LINE_WIDTHS / all.chain(drives_hz).fold(f64::INFINITY, f64::min)
}

/// The root mean square about the mean, of what is finite.
fn spread(values: &[f64]) -> f64 {
    let finite = || values.iter().filter(|v| v.is_finite());
    let count = finite().count().max(1) as f64;
    let mean = finite().sum::<f64>() / count;
    (finite().map(|v| (v - mean).powi(2)).sum::<f64>() / count).sqrt()
}

/// 2·e^{−z}·I₁(z) with z = ½·(A/θ₀)²: what a sine of amplitude A makes of the comb's C₀ at twice its frequency.
///
/// θ = A·sin ψ gives exp(−(θ/θ₀)²) = e^{−z}·e^{z·cos 2ψ}, whose line at 2ψ is 2·e^{−z}·I₁(z) by the generating function
/// of the modified Bessel functions (Abramowitz and Stegun 9.6.34). It rises up to A ≈ 1.76·θ₀.
pub fn line_share(amplitude_over_width: f64) -> f64 {
    let z = 0.5 * amplitude_over_width * amplitude_over_width;
    // I₁(z) = Σ (z/2)^{2k+1}/(k!·(k+1)!); z stays below 2, where 20 terms are beyond rounding.
    let (mut term, mut sum) = (0.5 * z, 0.0);
    for k in 1..=20 {
        sum += term;
        term *= 0.25 * z * z / f64::from(k * (k + 1));
    }
    2.0 * (-z).portable_exp() * sum
}

/// A/θ₀ where the line is largest.
const LARGEST: f64 = 1.757;

/// A/θ₀ that makes this share; `None` where none does.
fn amplitude_of(share: f64) -> Option<f64> {
    let (mut low, mut high) = (0.0, LARGEST);
    if share.is_nan() || share >= line_share(high) {
        return None;
    }
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if line_share(middle) < share { low = middle } else { high = middle }
    }
    Some(0.5 * (low + high))
}

struct StartWindow<'a> {
    readout: &'a TwoAxisComb<f64>,
    time_s: &'a [f64],
    signal: &'a [f64],
    /// The time of the first sample.
    origin: f64,
    /// The middle of the window, from there.
    middle: f64,
    drives_hz: [f64; 2],
}

impl<'a> StartWindow<'a> {
    /// All of these samples, and how long they last in s.
    fn of(
        readout: &'a TwoAxisComb<f64>,
        time_s: &'a [f64],
        signal: &'a [f64],
        drives_hz: [f64; 2],
    ) -> (Self, f64) {
        let origin = time_s.first().copied().unwrap_or(0.0);
        let span = time_s.last().map_or(0.0, |last| last - origin);
        (Self { readout, time_s, signal, origin, middle: 0.5 * span, drives_hz }, span)
    }

    /// How many of them have a signal.
    fn samples(&self) -> usize {
        self.signal.iter().filter(|y| y.is_finite()).count()
    }

    fn combs(&self) -> [GaussianComb<f64>; 2] {
        [self.readout.x, self.readout.y]
    }

    /// Unknowns to start from.
    fn lock_in(&self, samples: usize) -> Result<[f64; UNKNOWNS], StartError> {
        let basis = |t: f64| {
            let mut columns = [1.0; COLUMNS];
            for (axis, drive_hz) in self.drives_hz.iter().enumerate() {
                for harmonic in 1..=HARMONICS {
                    let (s, c) =
                        (TAU * drive_hz * f64::from(harmonic) * (t - self.origin)).portable_sin_cos();
                    let at = 1 + 6 * axis + 2 * usize::from(harmonic - 1);
                    (columns[at], columns[at + 1]) = (c, s);
                }
            }
            columns
        };
        let lines = least_squares(self.time_s, self.signal, basis).ok_or(StartError::Inseparable)?;
        let left: Vec<f64> = (self.time_s.iter().zip(self.signal))
            .map(|(t, y)| y - basis(*t).iter().zip(&lines).map(|(b, line)| b * line).sum::<f64>())
            .collect();
        let sd_v = spread(&left) * (2.0 / samples as f64).sqrt();
        let mut unknowns = [0.0; UNKNOWNS];
        let mut moved = 0.0;
        for (axis, comb) in self.combs().iter().enumerate() {
            let name = ['x', 'y'][axis];
            let [c, s] = [lines[1 + 6 * axis], lines[2 + 6 * axis]];
            let line_v = c.portable_hypot(s);
            if line_v < 5.0 * sd_v {
                return Err(StartError::NoMotion { axis: name, line_v, sd_v });
            }
            let full = self.readout.gain * comb.nominal;
            let most_v = full.abs() * line_share(LARGEST);
            let relative = amplitude_of(line_v / full.abs());
            let amplitude =
                relative.ok_or(StartError::TooLarge { axis: name, line_v, most_v })? * comb.angular_width;
            // The line is full·share·cos 2ψ with 2ψ = 2π·f·t′ + 2φ; of gain below 0 it is turned round.
            let turned = if full < 0.0 { PI } else { 0.0 };
            let phase = 0.5 * ((-s).portable_atan2(c) - turned);
            unknowns[PER_AXIS * axis] = amplitude;
            unknowns[PER_AXIS * axis + 1] = phase;
            moved += full * mean_share(amplitude / comb.angular_width) + self.readout.gain * comb.bias;
        }
        unknowns[UNKNOWNS - 1] = lines[0] - moved;
        Ok(unknowns)
    }

    /// Swing and phase of one axis at a time from the first sample: its angle is swing·sin(phase).
    fn swing<S: Over<f64>>(&self, unknowns: &[S; UNKNOWNS], axis: usize, time_s: f64) -> [S; 2] {
        let at = PER_AXIS * axis;
        // The drifts are counted from the middle to the end of the window, so that all unknowns are angles.
        let part = time_s / self.middle - 1.0;
        let turns = 0.5 * self.drives_hz[axis] * time_s;
        let swing = unknowns[at] + unknowns[at + 2] * part;
        let phase = unknowns[at + 1] + unknowns[at + 3] * part + TAU * (turns - turns.floor());
        [swing, phase]
    }

    /// Angle and rate of one axis at a time from the first sample.
    fn motion<S: Over<f64>>(&self, unknowns: &[S; UNKNOWNS], axis: usize, time_s: f64) -> [S; 2] {
        let at = PER_AXIS * axis;
        let [swing, phase] = self.swing(unknowns, axis, time_s);
        let (sine, cosine) = (phase.sin(), phase.cos());
        let growing = unknowns[at + 2] * self.middle.recip();
        let turning = unknowns[at + 3] * self.middle.recip() + PI * self.drives_hz[axis];
        [swing * sine, growing * sine + swing * turning * cosine]
    }

    fn answer(
        &self,
        unknowns: &[f64; UNKNOWNS],
        covariance: &Covariance<f64, UNKNOWNS>,
        residual_rms_v: f64,
    ) -> TwoAxisBatchStart {
        let mut canonical = *unknowns;
        for axis in 0..2 {
            let at = PER_AXIS * axis;
            if canonical[at] < 0.0 {
                canonical[at] = -canonical[at];
                canonical[at + 2] = -canonical[at + 2];
            }
            canonical[at + 1] = canonical[at + 1].rem_euclid(PI);
        }
        let varied = Dual::<f64, UNKNOWNS>::variables(&canonical);
        let [x, y] = [0, 1].map(|axis| self.motion(&varied, axis, 0.0));
        let state = [x[0], x[1], y[0], y[1]];
        let slopes = state.map(Dual::gradient);
        let spread = Mat::<f64, 4, 4>::from_fn(|i, j| {
            let mut sum = 0.0;
            for (k, a) in slopes[i].iter().enumerate() {
                for (l, b) in slopes[j].iter().enumerate() {
                    sum += a * covariance.get(k, l) * b;
                }
            }
            let amplitude = canonical[PER_AXIS * (i / 2)];
            let size = if i % 2 == 0 { amplitude } else { amplitude * PI * self.drives_hz[i / 2] };
            sum + if i == j { (LEFT_OUT * size).powi(2) } else { 0.0 }
        });
        let sd = |k: usize| covariance.get(k, k).max(0.0).sqrt();
        TwoAxisBatchStart {
            amplitude_rad: [canonical[0], canonical[PER_AXIS]],
            phase_rad: [canonical[1], canonical[PER_AXIS + 1]],
            amplitude_sd_rad: [sd(0), sd(PER_AXIS)],
            phase_sd_rad: [sd(1), sd(PER_AXIS + 1)],
            offset_v: canonical[UNKNOWNS - 1],
            residual_rms_v,
            mean: state.map(Dual::value),
            covariance: Covariance::from_lower(spread),
        }
    }
}

/// e^{−z}·I₀(z), the mean of exp(−(θ/θ₀)²).
fn mean_share(amplitude_over_width: f64) -> f64 {
    let z = 0.5 * amplitude_over_width * amplitude_over_width;
    let (mut term, mut sum) = (1.0, 0.0);
    for k in 1..=20 {
        sum += term;
        term *= 0.25 * z * z / f64::from(k * k);
    }
    (-z).portable_exp() * sum
}

impl ResidualLaw<UNKNOWNS> for &StartWindow<'_> {
    fn residuals<S: Over<f64>>(&self, unknowns: &[S; UNKNOWNS], each: &mut impl FnMut(S)) {
        for (time, y) in self.time_s.iter().zip(self.signal).filter(|(_, y)| y.is_finite()) {
            let time = time - self.origin;
            let [x, of_y] = [0, 1].map(|axis| {
                let [swing, phase] = self.swing(unknowns, axis, time);
                swing * phase.sin()
            });
            let capacitance = self.readout.x.capacitance(x) + self.readout.y.capacitance(of_y);
            each(capacitance * self.readout.gain + unknowns[UNKNOWNS - 1] - *y);
        }
    }
}
