//! The mechanics and the electrodes from a free decay under a bias.

use crate::fit::{
    ByDual, Fit, FitError, FitSettings, ParameterBounds, Regression, Shooting, ShootingError, Unknown,
    fit_until,
};
use crate::identify::Whiteness;
use crate::progress::Progress;
use kalmems_core::Portable;
use kalmems_core::{Nodes, NoiseDensity, Rk4};
use kalmems_models::dynamics::ParametricScanner;
use kalmems_models::readout::BiasedComb;
use std::f64::consts::{PI, TAU};

/// A ring-down, and what is believed of the device before it is looked at.
#[derive(Clone, Copy, Debug)]
pub struct RingDown<'a> {
    /// The interval between samples in s.
    pub interval_s: f64,
    /// V_o1 in V; not a number where it is missing.
    pub signal: &'a [f64],
    /// The reference's angle in rad at the same times; not a number where it is missing, empty without a reference.
    pub angle: &'a [f64],
    /// The device as believed: the inertia is held, the rest is where the fit starts.
    pub scanner: ParametricScanner<f64>,
    /// V on the electrodes, for what it does to the motion.
    pub bias: f64,
    /// R_f·V in Ω·V, for what is read of it.
    pub gain: f64,
}

/// The places of the unknowns in a [`RingDownFit`].
pub mod unknown {
    /// k in N·m/rad.
    pub const STIFFNESS: usize = 0;
    /// b in N·m·s/rad.
    pub const DAMPING: usize = 1;
    /// C₀ in F.
    pub const NOMINAL: usize = 2;
    /// θ₀ in rad.
    pub const WIDTH: usize = 3;
    /// The angle at the first sample in rad.
    pub const ANGLE: usize = 4;
    /// The rate there in rad/s.
    pub const RATE: usize = 5;
    /// The offset of V_o1 in V.
    pub const OFFSET: usize = 6;
    /// The offset of the reference in rad.
    pub const ANGLE_OFFSET: usize = 7;
    /// How many.
    pub const COUNT: usize = 8;
}
use unknown::{ANGLE, ANGLE_OFFSET, COUNT, DAMPING, NOMINAL, RATE, STIFFNESS, WIDTH};

const UNKNOWNS: [Unknown<'static>; COUNT] = [
    Unknown::Process("resonator.stiffness"),
    Unknown::Process("resonator.damping"),
    Unknown::Shared { process: "comb.nominal", measurement: "comb.nominal" },
    Unknown::Shared { process: "comb.angular_width", measurement: "comb.angular_width" },
    Unknown::Start(0),
    Unknown::Start(1),
    Unknown::Measurement("offset"),
    Unknown::Measurement("angle_offset"),
];

/// What a ring-down says.
#[derive(Clone, Debug)]
pub struct RingDownFit {
    /// The unknowns in the order of [`unknown`], with their covariance.
    pub fit: Fit<COUNT>,
    /// Whether a reference was there.
    pub with_reference: bool,
    /// The standard deviation of the noise of V_o1 in V and of the reference in rad (0 without one), from what the
    /// fit leaves.
    pub deviations: [f64; 2],
    /// V_o1 and angle as fitted, at each sample.
    pub fitted: Vec<[f64; 2]>,
    /// What V_o1 leaves looks like, and what the reference leaves.
    pub whiteness: [Whiteness; 2],
}

/// Why a ring-down says nothing.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum RingDownError {
    /// There is too little of it.
    #[error("{cycles:.1} cycles of the motion; expected at least {LEAST_CYCLES} to see a decay")]
    TooShort {
        /// Cycles recorded.
        cycles: f64,
    },
    /// The channel is flat or missing.
    #[error("V_o1 has no finite sample that differs from 0 in the first cycles; there is no motion to see")]
    NoMotion,
    /// The fit did not end.
    #[error(transparent)]
    Fit(#[from] FitError),
    /// The models do not have what is fitted.
    #[error(transparent)]
    Shooting(#[from] ShootingError),
}

const LEAST_CYCLES: f64 = 10.0;

/// Fits of the whole record at most, until the noise that one leaves is the noise that it was weighted by.
const ROUNDS: usize = 5;

/// Cycles that the start is searched in.
const SEARCH_CYCLES: f64 = 3.0;

/// The search takes about so many samples per cycle.
const SEARCH_SAMPLES: f64 = 48.0;

/// The longest integration step in rad of the motion. The method's frequency is off by x⁴/120 of itself, so that the
/// stiffness is by at most 10⁻⁷.
const LONGEST_STEP: f64 = 0.05;

/// Fits of ever more cycles, so that the phase stays known to a fraction of a cycle.
const GROWTH: f64 = 5.0;

/// Fits a ring-down by shooting.
///
/// J·θ̈ + b·θ̇ + k·θ = ½·C′(θ)·V² from an unknown start; V_o1 = R_f·V·C′(θ)·θ̇ + y₀ and the reference θ + y₁ are fitted
/// together over the whole record, each weighted by the noise that the fit itself leaves in it. The start is the best
/// of a grid of amplitudes and phases in the first cycles; from there the fit takes more and more cycles. The standard
/// errors are those of the Cramér–Rao bound if both noises are white.
///
/// The electrodes are a spring of (C₀/θ₀²)·V² at small angles: it is part of the model, k is that of the torsion bars.
/// J is held: the record knows k/J and b/J, C₀/J·V² and θ₀. Without a reference θ → −θ is an exact symmetry, and the
/// answer starts with a positive angle or rate; θ₀ and the angle are then known apart only by the bias's pull.
///
/// ```
/// use kalmems_rigs::shared_scanner::identification::{RingDown, fit_ring_down, unknown};
/// use kalmems_engines::progress::Silent;
/// use kalmems_engines::simulate::{Drive, Simulator};
/// use kalmems_models::{capacitance::GaussianComb, dynamics::{ParametricScanner, TorsionalResonator}};
/// let comb = GaussianComb { nominal: 5.71e-12, angular_width: 0.2, bias: 9.79e-12 };
/// let resonator = TorsionalResonator { inertia: 1.15e-14, damping: 5.95e-12, stiffness: 1.10e-4 };
/// let truth = ParametricScanner { resonator, comb, carrier_mean_square: 0.0 };
/// let (bias, gain) = (23.76, 17.86e3 * 23.76);
/// let mut simulator = Simulator::new(truth, Drive::Constant { level: bias }, 2e6, [0.15, 2e3]);
/// let (mut signal, mut angle) = (Vec::new(), Vec::new());
/// for _ in 0..3000 {
///     let [theta, rate] = *simulator.state();
///     signal.push(gain * comb.slope(theta) * rate);
///     angle.push(theta);
///     simulator.step();
/// }
/// let mut scanner = truth;
/// scanner.resonator.stiffness *= 1.003;
/// let found = fit_ring_down(&RingDown { interval_s: 5e-7, signal: &signal, angle: &angle, scanner, bias, gain }, &Silent)?;
/// assert!((found.fit.parameters[unknown::STIFFNESS] / 1.10e-4 - 1.0).abs() < 1e-7);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn fit_ring_down(record: &RingDown, progress: &dyn Progress) -> Result<RingDownFit, RingDownError> {
    let samples: Vec<[f64; 2]> = (0..record.signal.len())
        .map(|k| [record.signal[k], record.angle.get(k).copied().unwrap_or(f64::NAN)])
        .collect();
    let rate = record.natural_rate();
    let per_cycle = TAU / rate / record.interval_s;
    let cycles = samples.len() as f64 / per_cycle;
    if cycles < LEAST_CYCLES {
        return Err(RingDownError::TooShort { cycles });
    }
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // not negative, at most the record
    let of_cycles = |cycles: f64| ((cycles * per_cycle).ceil() as usize).min(samples.len());
    let first = &samples[..of_cycles(SEARCH_CYCLES)];
    let [signal_size, angle_size] = rms(first);
    if !(signal_size > 0.0 && signal_size.is_finite()) {
        return Err(RingDownError::NoMotion);
    }
    let with_reference = angle_size > 0.0;
    let channels = if with_reference { 2 } else { 1 };
    // Without a reference its deviation scales nothing.
    let sizes = [signal_size, if with_reference { angle_size } else { 1.0 }];
    let mut deviations = sizes;
    let mut rounds = 0;

    let start = record.search((first, deviations), with_reference, per_cycle, progress)?;
    let mut settings = settings_from(start, with_reference);
    let all_free = settings.free;
    let mut window = SEARCH_CYCLES;
    let fit = loop {
        let part = &samples[..of_cycles(window)];
        let whole = part.len() == samples.len();
        // The first cycles say where it starts and how fast it is; the scale of the angle waits for the reference or
        // for the whole record.
        settings.free = all_free;
        settings.free[DAMPING] &= window > SEARCH_CYCLES;
        settings.free[NOMINAL] &= window > SEARCH_CYCLES;
        settings.free[WIDTH] &= whole || (with_reference && window > SEARCH_CYCLES);
        settings.tolerance = if whole { 1e-9 } else { 1e-6 };
        let (found, left) = record.fit((part, deviations), &settings, progress)?;
        settings.start = found.parameters;
        // An exact record leaves nothing, and nothing cannot weigh.
        let next = [0, 1].map(|i| left[i].max(1e-9 * sizes[i]));
        let settled = next
            .iter()
            .zip(&deviations)
            .take(channels)
            .all(|(now, before)| (now / before - 1.0).abs() < 1e-4);
        let next = [next[0], if with_reference { next[1] } else { 1.0 }];
        rounds += usize::from(whole);
        if rounds == ROUNDS || (whole && settled) {
            break found;
        }
        deviations = next;
        window = (window * GROWTH).min(cycles + 1.0);
    };
    let shooting = record.shooting(&samples, 1.0, deviations)?;
    let mut fitted = Vec::with_capacity(samples.len());
    shooting.run(&fit.parameters, samples.len(), |_, output| fitted.push(output));
    let whiteness = [0, 1].map(|channel| {
        let left: Vec<f64> = samples.iter().zip(&fitted).map(|(y, f)| y[channel] - f[channel]).collect();
        Whiteness::of(&left)
    });
    if !with_reference {
        deviations[1] = 0.0;
    }
    Ok(RingDownFit { fit, with_reference, deviations, fitted, whiteness })
}

/// The root mean square of each channel's finite samples.
fn rms(samples: &[[f64; 2]]) -> [f64; 2] {
    [0, 1].map(|channel| {
        let (mut sum, mut count) = (0.0, 0_usize);
        for value in samples.iter().map(|s| s[channel]).filter(|v| v.is_finite()) {
            sum += value * value;
            count += 1;
        }
        (sum / count.max(1) as f64).sqrt()
    })
}

/// What may move, and how far.
fn settings_from(start: [f64; COUNT], with_reference: bool) -> FitSettings<COUNT> {
    let mut settings = FitSettings::from_start(start);
    settings.free[ANGLE_OFFSET] = with_reference;
    let around = |value: f64, factor: f64| ParameterBounds { low: value / factor, high: value * factor };
    settings.bounds[STIFFNESS] = around(start[STIFFNESS], 2.0);
    settings.bounds[DAMPING].low = 0.0;
    settings.bounds[NOMINAL] = around(start[NOMINAL], 100.0);
    settings.bounds[WIDTH] = around(start[WIDTH], 100.0);
    settings
}

type Shot<'a, F> = Shooting<'a, Rk4<ParametricScanner<f64>, f64, 2>, BiasedComb<f64>, F, 2, 2, COUNT>;

impl RingDown<'_> {
    /// The scanner without a carrier: there is none during a ring-down.
    fn scanner(&self) -> ParametricScanner<f64> {
        ParametricScanner { carrier_mean_square: 0.0, ..self.scanner }
    }

    fn natural_rate(&self) -> f64 {
        let resonator = self.scanner.resonator;
        let electrodes = -0.5 * self.scanner.comb.curvature_at_rest() * self.bias * self.bias;
        ((resonator.stiffness + electrodes) / resonator.inertia).sqrt()
    }

    fn shooting<'s>(
        &self,
        samples: &'s [[f64; 2]],
        intervals: f64,
        deviations: [f64; 2],
    ) -> Result<Shot<'s, impl Fn(usize) -> Nodes<f64> + Copy>, ShootingError> {
        let (scanner, bias) = (self.scanner(), self.bias);
        let interval_s = intervals * self.interval_s;
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        // at least 1; the search's is a cycle's part
        let steps = (self.natural_rate() * interval_s / LONGEST_STEP).ceil().max(1.0) as usize;
        let process = Rk4::new(scanner, interval_s / steps as f64, &NoiseDensity::none(), (&[0.0; 2], &0.0));
        let readout = BiasedComb { comb: scanner.comb, gain: self.gain, offset: 0.0, angle_offset: 0.0 };
        let start = ([0.0; 2], UNKNOWNS);
        Shooting::new((process, readout), start, (steps, move |_| Nodes::held(bias)), (samples, deviations))
    }

    /// The best start of a grid of amplitudes and phases, by the first cycles.
    fn search(
        &self,
        (first, deviations): (&[[f64; 2]], [f64; 2]),
        with_reference: bool,
        per_cycle: f64,
        progress: &dyn Progress,
    ) -> Result<[f64; COUNT], RingDownError> {
        const AMPLITUDES: i32 = 32;
        const PHASES: i32 = 24;
        let stride = (per_cycle / SEARCH_SAMPLES).floor().max(1.0);
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        // at least 1, below a cycle's samples
        let thinned: Vec<[f64; 2]> = first.iter().copied().step_by(stride as usize).collect();
        let shooting = self.shooting(&thinned, stride, deviations)?;
        let rate = self.natural_rate();
        let mut nominal = shooting.nominal();
        let law = ByDual(shooting);
        let width = self.scanner.comb.angular_width;
        let turn = if with_reference { TAU } else { PI };
        let mut best = (f64::INFINITY, nominal);
        for i in 0..AMPLITUDES {
            if progress.reached(0).is_break() {
                return Err(FitError::Interrupted.into());
            }
            // From a fortieth of the width to three times it.
            let amplitude = width / 40.0 * 120_f64.portable_powf(f64::from(i) / f64::from(AMPLITUDES - 1));
            for j in 0..PHASES {
                let (sine, cosine) = (turn * f64::from(j) / f64::from(PHASES)).portable_sin_cos();
                (nominal[ANGLE], nominal[RATE]) = (amplitude * sine, amplitude * rate * cosine);
                let mut cost = 0.0;
                law.residuals(&nominal, &mut |residual| cost += residual * residual);
                if cost < best.0 {
                    best = (cost, nominal);
                }
            }
        }
        if best.0.is_finite() { Ok(best.1) } else { Err(RingDownError::NoMotion) }
    }

    /// One fit, and the noise that it leaves in each channel.
    fn fit(
        &self,
        (samples, deviations): (&[[f64; 2]], [f64; 2]),
        settings: &FitSettings<COUNT>,
        progress: &dyn Progress,
    ) -> Result<(Fit<COUNT>, [f64; 2]), RingDownError> {
        let shooting = self.shooting(samples, 1.0, deviations)?;
        let found = fit_until(&ByDual(shooting), settings, progress)?;
        let mut left = Vec::with_capacity(samples.len());
        shooting.run(&found.parameters, samples.len(), |k, output| {
            left.push([samples[k][0] - output[0], samples[k][1] - output[1]]);
        });
        Ok((found, rms(&left)))
    }
}

/// The capacitance less its first value by adding up charge, ∫V_o1/(R_f·V) dt in F: what the papers do (Chen's
/// dissertation, 2018, equation 108).
///
/// An offset of V_o1 grows in proportion to time, and its noise with the root of time: shown as what not to do. Missing samples
/// count as 0.
pub fn integrated_capacitance(signal: &[f64], interval_s: f64, gain: f64) -> Vec<f64> {
    let mut sum = 0.0;
    let mut last = 0.0;
    signal
        .iter()
        .enumerate()
        .map(|(k, volts)| {
            let volts = if volts.is_finite() { *volts } else { 0.0 };
            if k > 0 {
                sum += 0.5 * (last + volts) * interval_s / gain;
            }
            last = volts;
            sum
        })
        .collect()
}
