//! Mechanics, comb and delay from a free decay that both channels saw.

use crate::fit::{
    ByDual, Fit, FitError, FitSettings, ParameterBounds, ResidualLaw, fit_until, outliers_of_stated,
};
use crate::identify::{Whiteness, fit_free_decay};
use crate::progress::Progress;
use kalmems_core::Portable;
use kalmems_core::{Covariance, Mat, Over, Scalar};
use kalmems_models::capacitance::{CombCurve, CurveShape};
use std::f64::consts::TAU;

/// A free decay: the comb's signal and the reference, sampled together.
#[derive(Clone, Copy, Debug)]
pub struct DecayRecord<'a> {
    /// The interval between samples in s.
    pub interval_s: f64,
    /// The comb's signal in V; not a number where it is missing.
    pub signal: &'a [f64],
    /// The reference's angle in rad as it was recorded, late or not, at the same times; not a number where it is
    /// missing.
    pub angle: &'a [f64],
    /// m of the reference's tan(m·θ), which is what its noise is added to.
    pub multiple: f64,
    /// The shape of the comb's curve.
    pub shape: CurveShape,
}

/// The places of the unknowns in a [`DecayFit`].
pub mod unknown {
    /// ω_n in rad/s.
    pub const NATURAL_RATE: usize = 0;
    /// ζ.
    pub const DAMPING_RATIO: usize = 1;
    /// The angle at the first sample in rad.
    pub const ANGLE: usize = 2;
    /// The part that swings as a sine from the first sample on, in rad.
    pub const SINE: usize = 3;
    /// θ_th in rad.
    pub const THRESHOLD: usize = 4;
    /// N_g in V·s/rad.
    pub const GAIN: usize = 5;
    /// N_θ in 1/rad.
    pub const STEEPNESS: usize = 6;
    /// The offset of the signal in V.
    pub const OFFSET: usize = 7;
    /// How much later than the signal the reference shows the motion, in s.
    pub const DELAY: usize = 8;
    /// The offset of the reference in rad.
    pub const ANGLE_OFFSET: usize = 9;
    /// How many.
    pub const COUNT: usize = 10;
}
use unknown::{
    ANGLE, ANGLE_OFFSET, COUNT, DAMPING_RATIO, DELAY, GAIN, NATURAL_RATE, OFFSET, SINE, STEEPNESS, THRESHOLD,
};

/// What a free decay says.
#[derive(Clone, Debug)]
pub struct DecayFit {
    /// The unknowns in the order of [`unknown`], with their covariance.
    pub fit: Fit<COUNT>,
    /// The standard deviation of the noise of the signal in V, and of the reference in units of tan(m·θ).
    pub deviations: [f64; 2],
    /// Angle in rad and rate in rad/s as fitted, at each sample.
    pub motion: Vec<[f64; 2]>,
    /// Signal in V and reference in rad as fitted, at each sample.
    pub fitted: Vec<[f64; 2]>,
    /// What the signal leaves looks like, and what the reference leaves.
    pub whiteness: [Whiteness; 2],
    /// Samples of the signal, and of the reference, that are none, by what the motion leaves of them.
    pub left_out: [usize; 2],
    shape: CurveShape,
}

impl DecayFit {
    /// The comb's curve as fitted.
    pub fn comb(&self) -> CombCurve<f64> {
        comb(&self.fit.parameters, self.shape)
    }
}

/// Why a free decay says nothing.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum DecayError {
    /// There is too little of it.
    #[error("{cycles:.1} cycles of the motion; expected at least {LEAST_CYCLES} to see a decay")]
    TooShort {
        /// Cycles recorded.
        cycles: f64,
    },
    /// A channel is flat or missing.
    #[error("the {channel} has no finite sample that differs from the others; there is no motion to see")]
    NoMotion {
        /// Which.
        channel: &'static str,
    },
    /// The signal does not follow the reference.
    #[error(
        "no comb at any delay within a quarter of a cycle explains more than {percent:.0} % of the signal by the \
         reference's motion; check that both channels are of this recording, and that the drive is off"
    )]
    Unrelated {
        /// How much the best explains, in per cent of the signal's mean square.
        percent: f64,
    },
    /// The fit did not end.
    #[error(transparent)]
    Fit(#[from] FitError),
}

const LEAST_CYCLES: f64 = 10.0;

/// Fits of the whole record at most, until the noise that one leaves is the noise that it was weighted by.
const ROUNDS: usize = 5;

/// The share of the signal's mean square that the start has to explain. At a signal-to-noise ratio of one it is half.
const LEAST_EXPLAINED: f64 = 0.1;

/// Fits a free decay by least squares, both channels together.
///
/// θ(t) = e^{−αt}·(a·cos ω_d·t + b·sin ω_d·t) with α = ζω_n and ω_d = ω_n·√(1 − ζ²); the signal is
/// h(θ(t))·θ̇(t) + y₀ with h of a [`CombCurve`], the reference tan(m·(θ(t − τ) + c)). Each channel is weighted by the noise
/// that the fit itself leaves in it: the signal by its samples, the reference by sums of neighbours, since a reference whose delay is stated or whose
/// clock is another has been interpolated, which leaves less noise in a sample and as much in a mean. The standard errors are those of the
/// Cramér–Rao bound if the noise of the signal is white, and that of the reference over more than 16 samples.
///
/// The start is the damped sine of the reference, and the best of a grid of delays within a quarter of a cycle and
/// of steepnesses: beyond, a delay and the motion's other direction are not told apart well. The first quarter of a cycle
/// of the reference is left out, since a late one shows there what was before the decay.
///
/// Samples that are more than 5.33 standard deviations off, by the median of what is left, are left out, and the fit is done anew.
pub fn fit_decay(record: &DecayRecord, progress: &dyn Progress) -> Result<DecayFit, DecayError> {
    let mut found = fit_samples(record, progress)?;
    for _ in 0..ROUNDS {
        let Some((channels, left_out)) = record.without_outliers(&found) else { break };
        if left_out == found.left_out {
            break;
        }
        let [signal, angle] = &channels;
        found = DecayFit { left_out, ..fit_samples(&DecayRecord { signal, angle, ..*record }, progress)? };
    }
    Ok(found)
}

/// The fit of all samples.
fn fit_samples(record: &DecayRecord, progress: &dyn Progress) -> Result<DecayFit, DecayError> {
    let count = record.signal.len().min(record.angle.len());
    for (channel, values) in [("signal", record.signal), ("reference", record.angle)] {
        let mut finite = values.iter().filter(|value| value.is_finite());
        let first = finite.next();
        if first.is_none_or(|first| finite.all(|value| value == first)) {
            return Err(DecayError::NoMotion { channel });
        }
    }
    let (start, quarter) = record.start(count)?;
    let mut law = DecayResiduals { record, tangents: record.tangents(count), quarter, deviations: [1.0; 2] };
    let mut settings = FitSettings::from_start(start);
    settings.bounds[NATURAL_RATE] = around(start[NATURAL_RATE], 1.1);
    settings.bounds[DAMPING_RATIO] = ParameterBounds { low: 0.0, high: 0.5 };
    settings.bounds[STEEPNESS] = around(start[STEEPNESS], 30.0);
    let half = TAU / start[NATURAL_RATE] / 2.0;
    settings.bounds[DELAY] = ParameterBounds { low: -half, high: half };
    settings.tolerance = 1e-12;
    // An exact record leaves nothing, and nothing cannot weigh.
    let least = law.sizes().map(|size| 1e-6 * size);
    let weights = |left: [f64; 2]| [0, 1].map(|i| left[i].max(least[i]));
    law.deviations = weights(law.noise(&start));
    let mut rounds = 0;
    let found = loop {
        let found = fit_until(&ByDual(&law), &settings, progress)?;
        settings.start = found.parameters;
        let next = weights(law.noise(&found.parameters));
        let settled = (0..2).all(|i| (next[i] / law.deviations[i] - 1.0).abs() < 1e-4);
        rounds += 1;
        if rounds == ROUNDS || settled {
            break found;
        }
        law.deviations = next;
    };
    Ok(law.outcome(found))
}

fn around(value: f64, factor: f64) -> ParameterBounds {
    ParameterBounds { low: value / factor, high: value * factor }
}

/// Angle and rate of the decay t after the first sample.
fn swing<S: Over<f64>>(p: &[S; COUNT], t: S) -> [S; 2] {
    let decay = p[DAMPING_RATIO] * p[NATURAL_RATE];
    let rate = p[NATURAL_RATE] * (S::of(1.0) - p[DAMPING_RATIO].sq()).sqrt();
    let envelope = (-(decay * t)).exp();
    let turned = rate * t;
    let (cosine, sine) = (turned.cos(), turned.sin());
    let angle = p[ANGLE] * cosine + p[SINE] * sine;
    let turning = p[SINE] * cosine - p[ANGLE] * sine;
    [envelope * angle, envelope * (rate * turning - decay * angle)]
}

fn comb<S: Scalar>(p: &[S; COUNT], shape: CurveShape) -> CombCurve<S> {
    CombCurve { centre: p[THRESHOLD], gain: p[GAIN], steepness: p[STEEPNESS], shape }
}

fn tangent<S: Scalar>(angle: S) -> S {
    angle.sin() / angle.cos()
}

impl DecayRecord<'_> {
    /// Both channels without what a fit leaves far more of than of the rest, and how many samples these are; `None` where they are many.
    fn without_outliers(&self, found: &DecayFit) -> Option<([Vec<f64>; 2], [usize; 2])> {
        // A late reference shows there what was before the decay.
        let quarter_s = 0.25 * TAU / found.fit.parameters[NATURAL_RATE];
        let of = |channel: usize, values: &[f64]| {
            let left = found.fitted.iter().zip(values).enumerate().map(|(k, (fitted, value))| {
                let is_used = channel == 0 || k as f64 * self.interval_s >= quarter_s;
                if is_used { value - fitted[channel] } else { f64::NAN }
            });
            let is_out = outliers_of_stated(&left.collect::<Vec<f64>>(), 0.0)?;
            let count = is_out.iter().filter(|is_out| **is_out).count();
            let kept =
                values.iter().zip(is_out).map(|(value, is_out)| if is_out { f64::NAN } else { *value });
            Some((kept.collect(), count))
        };
        let (signal, of_signal) = of(0, self.signal)?;
        let (angle, of_angle) = of(1, self.angle)?;
        Some(([signal, angle], [of_signal, of_angle]))
    }

    /// What the reference's noise is added to.
    fn tangents(&self, count: usize) -> Vec<f64> {
        self.angle[..count].iter().map(|angle| tangent(self.multiple * angle)).collect()
    }

    /// Where the fit starts, and a quarter of a cycle in samples.
    fn start(&self, count: usize) -> Result<([f64; COUNT], usize), DecayError> {
        let time_s: Vec<f64> = (0..count).map(|k| k as f64 * self.interval_s).collect();
        let decay = fit_free_decay(&time_s, &self.angle[..count])?;
        let [offset, cosine, sine, rate, damped] = decay.fit.parameters;
        let natural = (damped * damped + rate * rate).sqrt();
        let cycle_s = TAU / natural;
        let cycles = count as f64 * self.interval_s / cycle_s;
        if cycles < LEAST_CYCLES {
            return Err(DecayError::TooShort { cycles });
        }
        let mut p = [0.0; COUNT];
        (p[NATURAL_RATE], p[DAMPING_RATIO], p[ANGLE_OFFSET]) = (natural, rate / natural, offset);
        (p[ANGLE], p[SINE]) = (cosine, sine);
        let mut best = (f64::INFINITY, p);
        for i in -DELAYS..=DELAYS {
            p[DELAY] = 0.25 * cycle_s * f64::from(i) / f64::from(DELAYS);
            // The reference at t shows the motion at t − τ: the motion at 0 is shown at τ.
            (p[ANGLE], p[SINE]) = (cosine, sine);
            let [angle, speed] = swing(&p, p[DELAY]);
            (p[ANGLE], p[SINE]) = (angle, (speed + rate * angle) / damped);
            for j in 0..STEEPNESSES {
                let around = cosine.portable_hypot(sine);
                p[STEEPNESS] = 100_f64.portable_powf(f64::from(j) / f64::from(STEEPNESSES - 1)) / around;
                if let Some((cost, [gain, level])) = self.linear(&p, count)
                    && cost < best.0
                {
                    (p[GAIN], p[OFFSET]) = (gain, level);
                    best = (cost, p);
                }
            }
        }
        let explained = 1.0 - best.0;
        if explained.is_nan() || explained < LEAST_EXPLAINED {
            return Err(DecayError::Unrelated { percent: 100.0 * explained.max(0.0) });
        }
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // below a tenth of the record
        let quarter = (0.25 * cycle_s / self.interval_s).ceil() as usize;
        Ok((best.1, quarter))
    }

    /// The share of the signal's mean square that the best gain and offset leave, and these, over some of the samples.
    fn linear(&self, p: &[f64; COUNT], count: usize) -> Option<(f64, [f64; 2])> {
        let unit = CombCurve { gain: 1.0, ..comb(p, self.shape) };
        // Σ of 1, x, y, x², x·y, y².
        let mut sums = [0.0; 6];
        for k in (0..count).step_by(count.div_ceil(SEARCH)) {
            let y = self.signal[k];
            if y.is_finite() {
                let [angle, rate] = swing(p, k as f64 * self.interval_s);
                let x = unit.sensitivity(angle) * rate;
                for (sum, term) in sums.iter_mut().zip([1.0, x, y, x * x, x * y, y * y]) {
                    *sum += term;
                }
            }
        }
        let [n, x, y, xx, xy, yy] = sums;
        let spread = xx - x * x / n;
        let gain = (xy - x * y / n) / spread;
        let all = yy - y * y / n;
        let left = (all - gain * gain * spread) / all;
        (left.is_finite() && gain.is_finite()).then_some((left, [gain, (y - gain * x) / n]))
    }
}

/// Delays of the search on each side of none.
const DELAYS: i32 = 24;

/// Steepnesses of the search: from one to a hundred amplitudes of the motion.
const STEEPNESSES: i32 = 16;

/// Samples of the reference that are added up to see its noise, and the fewest such sums.
const NEIGHBOURS: usize = 16;
const FEWEST_SUMS: f64 = 50.0;

/// Samples that the search looks at.
const SEARCH: usize = 2048;

/// The residuals of both channels.
struct DecayResiduals<'a> {
    record: &'a DecayRecord<'a>,
    tangents: Vec<f64>,
    /// Samples of the reference that are left out.
    quarter: usize,
    deviations: [f64; 2],
}

impl DecayResiduals<'_> {
    /// The signal at a sample, in V.
    fn signal_at<S: Over<f64>>(&self, p: &[S; COUNT], k: usize) -> S {
        let [angle, rate] = swing(p, S::of(k as f64 * self.record.interval_s));
        comb(p, self.record.shape).sensitivity(angle) * rate + p[OFFSET]
    }

    /// The reference's tangent at a sample.
    fn reference_at<S: Over<f64>>(&self, p: &[S; COUNT], k: usize) -> S {
        let [angle, _] = swing(p, S::of(k as f64 * self.record.interval_s) - p[DELAY]);
        tangent((angle + p[ANGLE_OFFSET]) * self.record.multiple)
    }

    /// The root mean square of each channel.
    fn sizes(&self) -> [f64; 2] {
        [self.record.signal, &self.tangents].map(|channel| {
            let finite = channel.iter().filter(|value| value.is_finite());
            let (sum, count) = finite.fold((0.0, 0.0), |(sum, n), value| (sum + value * value, n + 1.0));
            f64::sqrt(sum / f64::max(count, 1.0))
        })
    }

    /// The root mean square of what is left in each channel.
    fn left(&self, p: &[f64; COUNT]) -> [f64; 2] {
        let mut sums = [[0.0; 2]; 2];
        for (k, (y, seen)) in self.record.signal.iter().zip(&self.tangents).enumerate() {
            if y.is_finite() {
                sums[0][0] += (y - self.signal_at(p, k)).powi(2);
                sums[0][1] += 1.0;
            }
            if k >= self.quarter && seen.is_finite() {
                sums[1][0] += (seen - self.reference_at(p, k)).powi(2);
                sums[1][1] += 1.0;
            }
        }
        // The unknowns are shared between the channels: half of them each.
        sums.map(|[sum, count]| (sum / (count - 0.5 * COUNT as f64).max(1.0)).sqrt())
    }

    /// What counts as the noise of a sample: of the reference the root mean square of sums over neighbours, as if it were white.
    fn noise(&self, p: &[f64; COUNT]) -> [f64; 2] {
        let [signal, by_samples] = self.left(p);
        let (mut square, mut count) = (0.0, 0.0);
        for (block, seen) in
            self.tangents.chunks_exact(NEIGHBOURS).enumerate().skip(self.quarter / NEIGHBOURS + 1)
        {
            let each =
                seen.iter().enumerate().map(|(k, seen)| seen - self.reference_at(p, block * NEIGHBOURS + k));
            let sum: f64 = each.sum();
            if sum.is_finite() {
                square += sum * sum / NEIGHBOURS as f64;
                count += 1.0;
            }
        }
        let by_sums = f64::sqrt(square / f64::max(count, 1.0));
        [signal, if count >= FEWEST_SUMS { by_sums } else { by_samples }]
    }

    fn outcome(&self, mut fit: Fit<COUNT>) -> DecayFit {
        let p = &fit.parameters;
        let multiple = self.record.multiple;
        let count = self.tangents.len();
        // The fit takes what it leaves for the noise; what interpolation took of the reference's noise is missing there.
        let ([_, of_sample], [_, counted]) = (self.left(p), self.noise(p));
        let lost = if counted > 0.0 { (of_sample / counted).powi(2) } else { 1.0 };
        let (signal, reference) = (count as f64, count.saturating_sub(self.quarter) as f64);
        let expected = (signal + lost * reference) / (signal + reference);
        let covariance = Mat::from_fn(|i, j| fit.covariance.get(i, j) / expected);
        let motion: Vec<[f64; 2]> = (0..count).map(|k| swing(p, k as f64 * self.record.interval_s)).collect();
        let fitted: Vec<[f64; 2]> = (0..count)
            .map(|k| [self.signal_at(p, k), self.reference_at(p, k).portable_atan() / multiple])
            .collect();
        let left = |channel: usize| -> Vec<f64> {
            (0..count)
                .map(|k| match channel {
                    0 => self.record.signal[k] - fitted[k][0],
                    _ if k < self.quarter => f64::NAN,
                    _ => self.tangents[k] - tangent(multiple * fitted[k][1]),
                })
                .collect()
        };
        let whiteness = [0, 1].map(|channel| Whiteness::of(&left(channel)));
        let deviations = self.left(p);
        fit.covariance = Covariance::from_lower(covariance);
        DecayFit { deviations, fit, motion, fitted, whiteness, left_out: [0; 2], shape: self.record.shape }
    }
}

impl ResidualLaw<COUNT> for &DecayResiduals<'_> {
    fn residuals<S: Over<f64>>(&self, p: &[S; COUNT], each: &mut impl FnMut(S)) {
        let DecayResiduals { record, tangents, quarter, deviations } = self;
        for (k, (y, seen)) in record.signal.iter().zip(tangents).enumerate() {
            if y.is_finite() {
                each((self.signal_at(p, k) - *y) * deviations[0].recip());
            }
            if k >= *quarter && seen.is_finite() {
                each((self.reference_at(p, k) - *seen) * deviations[1].recip());
            }
        }
    }
}
