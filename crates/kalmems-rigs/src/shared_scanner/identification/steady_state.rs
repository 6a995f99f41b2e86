//! Gain and offset of the circuit from a motion that a reference shows.

use crate::fit::{
    ByDual, DerivedNumber, Fit, FitError, FitSettings, ParameterBounds, Shooting, ShootingError, Unknown,
    fit_until,
};
use crate::identify::{AffineFit, Whiteness, fit_affine};
use crate::progress::Progress;
use crate::signal::{GAP, cubic_between, usual_interval};
use kalmems_core::Portable;
use kalmems_core::{Covariance, Nodes, NoiseDensity, Rk4, Scalar};
use kalmems_models::capacitance::GaussianComb;
use kalmems_models::readout::{LowPassOutput, LowPassPair};
use std::borrow::Cow;
use std::f64::consts::TAU;

/// A motion, what was read of it, and the electrodes as they are known.
#[derive(Clone, Copy, Debug)]
pub struct SteadyState<'a> {
    /// When, in s.
    pub time_s: &'a [f64],
    /// The interval between samples in s.
    pub interval_s: f64,
    /// y in V; not a number where it is missing.
    pub signal: &'a [f64],
    /// θ of the reference in rad that the signal shows at these times; not a number where it is missing.
    pub angle: &'a [f64],
    /// C₀, θ₀ and C_b.
    pub comb: GaussianComb<f64>,
    /// The covariance of C₀ and θ₀: zeros where they are taken as given.
    pub comb_covariance: Covariance<f64, 2>,
}

/// What a motion with a reference says of the circuit.
#[derive(Clone, Debug)]
pub struct SteadyStateFit {
    /// y = a·C(θ) + b by least squares, with the errors of the line alone.
    pub affine: AffineFit,
    /// a in V/F, the errors of C₀ and θ₀ included.
    pub gain: DerivedNumber,
    /// b in V, for the C_b that was given, the errors of C₀ and θ₀ included.
    pub offset: DerivedNumber,
    /// a·C₀ in V: what is observable of the gain.
    pub swing: DerivedNumber,
    /// a·C_b + b in V: what is observable of the offset.
    pub level: DerivedNumber,
    /// How a and b move with C₀ and θ₀.
    pub by_comb: [[f64; 2]; 2],
    /// C filtered by the demodulator's two poles, where that explains the signal better.
    pub poles: Option<PolesFit>,
    /// The largest angle in rad.
    pub amplitude: f64,
}

/// y = a·x₂ + b with x₂ behind two equal poles.
#[derive(Clone, Debug)]
pub struct PolesFit {
    /// ω in rad/s, a in V/F, b in V, x₁ and x₂ at the first sample in F.
    pub fit: Fit<5>,
    /// What it leaves looks like.
    pub whiteness: Whiteness,
    /// Measured less fitted in V; not a number where one of the two is missing.
    pub residuals: Vec<f64>,
}

impl PolesFit {
    /// The poles' frequency in Hz.
    pub fn frequency_hz(&self) -> DerivedNumber {
        self.fit.derived(|p| p[0] * (1.0 / TAU))
    }
}

impl SteadyStateFit {
    /// What the affine model leaves, as a part of the rms of the signal about its mean.
    pub fn affine_residual(&self, signal: &[f64]) -> f64 {
        self.affine.residual_deviation / spread(signal)
    }

    /// The residuals of the model with poles.
    pub fn poles_residual(&self, signal: &[f64]) -> Option<f64> {
        self.poles.as_ref().map(|poles| poles.fit.residual_deviation() / spread(signal))
    }
}

fn spread(signal: &[f64]) -> f64 {
    let finite = || signal.iter().filter(|v| v.is_finite());
    let n = finite().count().max(1) as f64;
    let mean = finite().sum::<f64>() / n;
    (finite().map(|v| (v - mean).powi(2)).sum::<f64>() / n).sqrt()
}

/// θ(t − τ) at each time, between the samples by a cubic; not a number where it is not known.
pub(super) fn before<'a>(time_s: &[f64], angle: &'a [f64], delay_s: f64) -> Cow<'a, [f64]> {
    if delay_s == 0.0 {
        return Cow::Borrowed(angle);
    }
    let longest_s = GAP * usual_interval(time_s);
    let at = |t: f64| match time_s.partition_point(|s| *s <= t) {
        to if to > 0 && to < time_s.len() && time_s[to] - time_s[to - 1] <= longest_s => {
            cubic_between(time_s, |k| angle[k], to, t)
        }
        _ => f64::NAN,
    };
    time_s.iter().map(|t| at(t - delay_s)).collect()
}

/// Gain and offset by least squares of y on C(θ), and the demodulator's poles if there are any to be seen.
///
/// The reference's own noise is taken as small against the comb's width: noise of variance σ² makes C larger or smaller by
/// ½·C″·σ². The poles stay out where they do not make the sum of squares smaller by more than chance would: the criterion
/// is Schwarz's (Annals of Statistics 6, 461, 1978), n·ln(S₁/S₂) > 3·ln n. `None` where there is no motion to fit.
pub fn fit_steady_state(
    record: &SteadyState,
    progress: &dyn Progress,
) -> Option<Result<SteadyStateFit, FitError>> {
    let line = |comb: &GaussianComb<f64>| fit_affine(&record.capacitance(comb), record.signal);
    let affine = line(&record.comb)?;
    let amplitude = record.angle.iter().filter(|a| a.is_finite()).fold(0.0_f64, |m, a| m.max(a.abs()));

    // How the line moves with C₀ and θ₀, a hundredth of a deviation or a millionth to each side.
    let comb = record.comb;
    let at = |which: usize, by: f64| match which {
        0 => GaussianComb { nominal: comb.nominal + by, ..comb },
        _ => GaussianComb { angular_width: comb.angular_width + by, ..comb },
    };
    let sizes = [comb.nominal, comb.angular_width];
    let mut slopes = [[0.0; 2]; 4];
    for which in 0..2 {
        let step = 1e-6 * sizes[which];
        let [up, down] = [step, -step].map(|by| line(&at(which, by)).map(|l| numbers(&l, &at(which, by))));
        let (up, down) = (up?, down?);
        for i in 0..4 {
            slopes[i][which] = (up[i] - down[i]) / (2.0 * step);
        }
    }
    let values = numbers(&affine, &comb);
    let own = [
        affine.slope().deviation,
        affine.at(0.0).deviation,
        affine.slope().deviation * comb.nominal,
        affine.at(comb.bias).deviation,
    ];
    let derived = |i: usize| {
        let c = &record.comb_covariance;
        let [by_nominal, by_width] = slopes[i];
        let from_comb = by_nominal * by_nominal * c.get(0, 0)
            + 2.0 * by_nominal * by_width * c.get(0, 1)
            + by_width * by_width * c.get(1, 1);
        DerivedNumber { value: values[i], deviation: (own[i] * own[i] + from_comb).sqrt() }
    };
    let poles = match record.poles(&affine, progress) {
        Ok(poles) => poles,
        Err(PolesError::Fit(error)) => return Some(Err(error)),
        // A line that leaves nothing has no residuals for poles to explain.
        Err(PolesError::Shooting) => None,
    };
    Some(Ok(SteadyStateFit {
        gain: derived(0),
        offset: derived(1),
        swing: derived(2),
        level: derived(3),
        by_comb: [slopes[0], slopes[1]],
        affine,
        poles,
        amplitude,
    }))
}

/// Factors of the width that is believed, beyond which it is not sought, and how many of them are tried first.
const WIDEST: f64 = 1.6;
const WIDTHS: u32 = 12;

/// θ₀ by the motion itself: the width with which the line through signal and capacitance leaves least, the line being the best for each
/// width. Its error is that of a fit of width, swing and level together, 2·s²/S″ of the sum of squares S. `None` where there is no least
/// one within a factor of 1.6 of the width that is believed.
pub fn fit_width(record: &SteadyState) -> Option<DerivedNumber> {
    let believed = record.comb.angular_width;
    let left = |logarithm: f64| -> Option<(f64, f64)> {
        let comb = GaussianComb { angular_width: believed * Scalar::exp(logarithm), ..record.comb };
        let line = fit_affine(&record.capacitance(&comb), record.signal)?;
        let freedom = line.whiteness.samples as f64 - 2.0;
        Some((line.residual_deviation.powi(2) * freedom, freedom - 1.0))
    };
    let step = 2.0 * Scalar::ln(WIDEST) / f64::from(WIDTHS);
    let tried: Option<Vec<(f64, f64)>> = (0..=WIDTHS)
        .map(|k| {
            let logarithm = step * (f64::from(k) - 0.5 * f64::from(WIDTHS));
            Some((logarithm, left(logarithm)?.0))
        })
        .collect();
    let tried = tried?;
    let least = (1..tried.len() - 1).min_by(|a, b| tried[*a].1.total_cmp(&tried[*b].1))?;
    if tried[least].1 > tried[0].1.min(tried[tried.len() - 1].1) {
        return None;
    }
    // Between its neighbours by parabolas through three points, of ever smaller width.
    let (mut at, mut reach) = (tried[least].0, step);
    for _ in 0..STEPS {
        let [below, here, above] = [at - reach, at, at + reach].map(|l| left(l).map(|(sum, _)| sum));
        let (below, here, above) = (below?, here?, above?);
        let bend = below - 2.0 * here + above;
        let by = if bend > 0.0 { 0.5 * reach * (below - above) / bend } else { 0.0 };
        at += by.clamp(-reach, reach);
        reach = (0.5 * reach).max(2.0 * by.abs().min(reach)).max(SMALLEST);
    }
    let (sum, freedom) = left(at)?;
    let beside = [-BEND, BEND].map(|by| left(at + by).map(|(sum, _)| sum));
    let bend = (beside[0]? - 2.0 * sum + beside[1]?) / (BEND * BEND);
    let value = believed * Scalar::exp(at);
    (bend > 0.0).then(|| DerivedNumber { value, deviation: value * (2.0 * sum / freedom / bend).sqrt() })
}

/// Rounds of that, the smallest distance of the points, and that over which the curvature is taken, of the logarithm.
const STEPS: usize = 12;
const SMALLEST: f64 = 1e-4;
const BEND: f64 = 5e-3;

/// a, b, a·C₀ and a·C_b + b.
fn numbers(line: &AffineFit, comb: &GaussianComb<f64>) -> [f64; 4] {
    [line.slope, line.intercept, line.slope * comb.nominal, line.slope * comb.bias + line.intercept]
}

enum PolesError {
    Fit(FitError),
    Shooting,
}

impl From<FitError> for PolesError {
    fn from(error: FitError) -> Self {
        Self::Fit(error)
    }
}

impl From<ShootingError> for PolesError {
    fn from(_: ShootingError) -> Self {
        Self::Shooting
    }
}

impl SteadyState<'_> {
    fn capacitance(&self, comb: &GaussianComb<f64>) -> Vec<f64> {
        self.angle.iter().map(|angle| comb.capacitance(*angle)).collect()
    }

    /// The fit with poles, where it is the better one. Needs the angle throughout.
    fn poles(&self, affine: &AffineFit, progress: &dyn Progress) -> Result<Option<PolesFit>, PolesError> {
        if self.angle.iter().any(|a| !a.is_finite()) {
            return Ok(None);
        }
        let capacitance = self.capacitance(&self.comb);
        let angle_between = |to: usize| {
            let middle = self.time_s[to - 1].midpoint(self.time_s[to]);
            cubic_between(self.time_s, |k| self.angle[k], to, middle)
        };
        let nodes: Vec<Nodes<f64>> = (1..capacitance.len())
            .map(|to| Nodes {
                start: capacitance[to - 1],
                middle: self.comb.capacitance(angle_between(to)),
                end: capacitance[to],
            })
            .collect();
        let samples: Vec<[f64; 1]> = self.signal.iter().map(|y| [*y]).collect();
        // Beyond this an integration step of one sample does not follow, and the samples hardly see them.
        let fastest = 0.5 / self.interval_s;
        let mut best: Option<(Fit<5>, Vec<f64>)> = None;
        for part in [0.03, 0.1, 0.4] {
            let rate = part * fastest;
            let process =
                Rk4::new(LowPassPair { rate }, self.interval_s, &NoiseDensity::none(), (&[0.0; 2], &0.0));
            let readout = LowPassOutput { gain: affine.slope, offset: affine.intercept };
            let unknowns = [
                Unknown::Process("rate"),
                Unknown::Measurement("gain"),
                Unknown::Measurement("offset"),
                Unknown::Start(0),
                Unknown::Start(1),
            ];
            let shooting = Shooting::new(
                (process, readout),
                ([capacitance[0]; 2], unknowns),
                (1, |step: usize| nodes[step]),
                (&samples, [affine.residual_deviation]),
            )?;
            let mut settings = FitSettings::from_start(shooting.nominal());
            settings.bounds[0] = ParameterBounds { low: 1e-3 * fastest, high: fastest };
            let found = match fit_until(&ByDual(shooting), &settings, progress) {
                Ok(found) => found,
                // Another start may do.
                Err(FitError::NotConverged { .. }) => continue,
                Err(error) => return Err(error.into()),
            };
            if best.as_ref().is_none_or(|(b, _)| found.sum_of_squares < b.sum_of_squares) {
                let mut residuals = Vec::with_capacity(samples.len());
                shooting.run(&found.parameters, samples.len(), |k, [y]| residuals.push(self.signal[k] - y));
                best = Some((found, residuals));
            }
        }
        let Some((mut found, residuals)) = best else { return Ok(None) };
        let n = affine.whiteness.samples as f64;
        // In units of the affine model's residuals, whose squares sum up to n − 2.
        let gained = n * ((n - 2.0) / found.sum_of_squares).portable_ln();
        if gained <= 3.0 * n.portable_ln() || found.at_bound[0] {
            return Ok(None);
        }
        found.sum_of_squares *= affine.residual_deviation * affine.residual_deviation;
        Ok(Some(PolesFit { fit: found, whiteness: Whiteness::of(&residuals), residuals }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::progress::Silent;

    /// Told 10 % too wide, and 3 % too narrow: found to what noise allows, with the error of the fit of three parameters.
    #[test]
    fn a_motion_with_a_reference_determines_the_width_of_the_comb() {
        let comb = GaussianComb { nominal: 5.71e-12, angular_width: 0.2, bias: 9.79e-12 };
        let time: Vec<f64> = (0..4000).map(|k| f64::from(k) * 1e-6).collect();
        let angle: Vec<f64> = time.iter().map(|t| 0.12 * (TAU * 15_675.0 * t).sin()).collect();
        let mut noise = crate::simulate::WhiteNoise::new(4, 0);
        let signal: Vec<f64> = angle
            .iter()
            .map(|a| 6.3945 - 0.3574e12 * comb.capacitance(*a) + 1.4e-2 * noise.sample())
            .collect();
        for factor in [1.1, 0.97] {
            let told = GaussianComb { angular_width: 0.2 * factor, ..comb };
            let (interval_s, comb_covariance) = (1e-6, Covariance::zero());
            let record = SteadyState {
                time_s: &time,
                interval_s,
                signal: &signal,
                angle: &angle,
                comb: told,
                comb_covariance,
            };
            let found = fit_width(&record).unwrap();
            assert!((found.value - 0.2).abs() < 4.0 * found.deviation, "{found:?}");
            // (JᵀJ)⁻¹ of offset, gain and width at the true values, by NumPy.
            assert!((found.deviation / 2.265e-3 - 1.0).abs() < 0.1, "{found:?}");
        }
    }

    /// A signal that is late shows the angle that was; taken for that of its time it gives another gain.
    #[test]
    fn a_late_signal_gives_the_gain_of_the_angle_that_was() {
        const DELAY_S: f64 = 1.16e-6;
        let comb = GaussianComb { nominal: 5.71e-12, angular_width: 0.2, bias: 9.79e-12 };
        let theta = |t: f64| 0.15 * (TAU * 15_675.0 * t).sin();
        // A gap of ten samples.
        let time: Vec<f64> =
            (0..2000).filter(|k| !(700..710).contains(k)).map(|k| f64::from(k) * 1e-6).collect();
        let angle: Vec<f64> = time.iter().map(|t| theta(*t)).collect();
        let signal: Vec<f64> =
            time.iter().map(|t| 6.3945 - 0.3574e12 * comb.capacitance(theta(t - DELAY_S))).collect();
        let gain = |angle: &[f64]| {
            let (interval_s, comb_covariance) = (1e-6, Covariance::zero());
            let record =
                SteadyState { time_s: &time, interval_s, signal: &signal, angle, comb, comb_covariance };
            fit_steady_state(&record, &Silent).unwrap().unwrap().affine.slope / -0.3574e12
        };
        let then = before(&time, &angle, DELAY_S);
        assert_eq!(then.iter().filter(|a| a.is_nan()).count(), 4, "two at the start, two after the gap");
        assert!((gain(&then) - 1.0).abs() < 1e-5, "{}", gain(&then));
        // cos 2φ of the second harmonic's lag, 13°.
        assert!((gain(&angle) - 0.974).abs() < 2e-3, "{}", gain(&angle));
        assert!(matches!(before(&time, &angle, 0.0), Cow::Borrowed(_)));
    }
}
