//! Whether a drive can make a parametric scanner oscillate, and by how much it misses.

use super::Drive;
use kalmems_core::Portable;
use kalmems_models::dynamics::ParametricScanner;
use std::f64::consts::TAU;
use std::fmt;

/// The drive's modulation of a scanner's stiffness against the one that starts a motion.
///
/// Near rest the electrodes are a spring of (C₀/θ₀²)·V², so that the drive makes Mathieu's equation of the scanner,
/// θ̈ + (ω/Q)·θ̇ + ω²·(1 + h·cos 2πf_p·t)·θ = 0 with ω² from the mean of V² and h from its component at f_p, that
/// harmonic of the drive which is nearest to twice the resonance. To first order in h the motion grows at
/// f_p/2 with the rate √((hω/4)² − δ²) − ω/(2Q), δ being the detuning of f_p/2 in rad/s: nowhere, unless h is above
/// the threshold 2/Q (Nayfeh and Mook, Nonlinear Oscillations, 1979, section 5.7.2).
/// [`floquet_exponent`](super::floquet_exponent) tells the same without the approximation.
///
/// ```
/// use kalmems_engines::simulate::{Drive, Stability};
/// use kalmems_models::{capacitance::GaussianComb, dynamics::{ParametricScanner, TorsionalResonator}};
/// // Chen et al., shared electrodes, 2020, Tables I and II.
/// let scanner = ParametricScanner {
///     resonator: TorsionalResonator { inertia: 1.15e-14, damping: 5.95e-12, stiffness: 1.10e-4 },
///     comb: GaussianComb { nominal: 5.71e-12, angular_width: 0.2, bias: 9.79e-12 },
///     carrier_mean_square: 18.0,
/// };
/// let drive = Drive::Sine { offset: 30.0, amplitude: 30.0, frequency_hz: 31.1e3, phase_rad: 0.0 };
/// assert_eq!(
///     Stability::of(&scanner, &drive).unwrap().to_string(),
///     "cannot oscillate at this drive: the pump depth is 4.5 times below threshold"
/// );
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stability {
    /// The resonance at rest with the mean stiffness of the electrodes.
    pub resonance_hz: f64,
    /// Q there.
    pub quality: f64,
    /// The harmonic of the drive that pumps: 1 for a drive at twice the resonance.
    pub harmonic: u32,
    /// h: the amplitude of the stiffness's modulation relative to the stiffness.
    pub pump_depth: f64,
    /// The drive's frequencies, lowest and highest.
    pub drive_hz: [f64; 2],
}

impl Stability {
    /// The criterion for this drive; `None` where it has no frequency.
    pub fn of(scanner: &ParametricScanner<f64>, drive: &Drive) -> Option<Self> {
        let drive_hz = match drive {
            Drive::Sine { frequency_hz, .. } | Drive::Square { frequency_hz, .. } => [*frequency_hz; 2],
            Drive::Sweep { from_hz, to_hz, .. } => [from_hz.min(*to_hz), from_hz.max(*to_hz)],
            Drive::Constant { .. }
            | Drive::Tones { .. }
            | Drive::Interrupted { .. }
            | Drive::Steps { .. }
            | Drive::Switched { .. }
            | Drive::Late { .. }
            | Drive::Rate { .. }
            | Drive::Recorded { .. } => return None,
        };
        let resonator = &scanner.resonator;
        let per_square_volt = -0.5 * scanner.comb.curvature_at_rest();
        let (mean, _) = drive.square(1)?;
        let stiffness = resonator.stiffness + per_square_volt * (mean + scanner.carrier_mean_square);
        let rate = (stiffness / resonator.inertia).sqrt();
        let nearest = (rate / TAU * 2.0 / drive_hz[0].midpoint(drive_hz[1])).round().clamp(1.0, 100.0);
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // 1 to 100
        let harmonic = nearest as u32;
        let (_, component) = drive.square(harmonic)?;
        Some(Self {
            resonance_hz: rate / TAU,
            quality: resonator.inertia * rate / resonator.damping,
            harmonic,
            pump_depth: per_square_volt * component / stiffness,
            drive_hz,
        })
    }

    /// The pump depth above which a motion starts by itself, 2/Q.
    pub fn threshold(&self) -> f64 {
        2.0 / self.quality
    }

    /// The drive frequencies between which a motion starts by itself; `None` below the threshold.
    pub fn tongue_hz(&self) -> Option<[f64; 2]> {
        let margin = (0.25 * self.pump_depth).powi(2) - (0.5 / self.quality).powi(2);
        let per_harmonic = 2.0 * self.resonance_hz / f64::from(self.harmonic);
        (margin > 0.0).then(|| [-1.0, 1.0].map(|side| per_harmonic * (1.0 + side * margin.sqrt())))
    }

    /// How fast a small motion grows at a drive frequency, in 1/s; below 0 where it dies.
    pub fn growth_rate(&self, drive_hz: f64) -> f64 {
        let rate = TAU * self.resonance_hz;
        let detuning = 0.5 * TAU * drive_hz * f64::from(self.harmonic) - rate;
        let pumped = ((0.25 * self.pump_depth * rate).powi(2) - detuning.powi(2)).max(0.0).sqrt();
        pumped - 0.5 * rate / self.quality
    }
}

/// How many times as large a drive must be to bring a scanner to its threshold; `None` where nothing in its square
/// pumps, or where nothing damps the scanner.
///
/// The depth h grows with the square of the factor, and ω and Q move with the mean stiffness: κ·s²·c = 2·b·ω(s) with
/// κ = C₀/θ₀² and c the component of V² that pumps.
///
/// ```
/// use kalmems_engines::simulate::{Drive, starting_factor};
/// # use kalmems_models::{capacitance::GaussianComb, dynamics::{ParametricScanner, TorsionalResonator}};
/// # let scanner = ParametricScanner {
/// #     resonator: TorsionalResonator { inertia: 1.15e-14, damping: 5.95e-12, stiffness: 1.10e-4 },
/// #     comb: GaussianComb { nominal: 5.71e-12, angular_width: 0.2, bias: 9.79e-12 },
/// #     carrier_mean_square: 18.0,
/// # };
/// let drive = Drive::Sine { offset: 30.0, amplitude: 30.0, frequency_hz: 31.1e3, phase_rad: 0.0 };
/// // 4.53 times too shallow: about the root of that in volts.
/// assert!((starting_factor(&scanner, &drive).unwrap() - 2.13).abs() < 0.01);
/// ```
pub fn starting_factor(scanner: &ParametricScanner<f64>, drive: &Drive) -> Option<f64> {
    let harmonic = Stability::of(scanner, drive)?.harmonic;
    let resonator = &scanner.resonator;
    let per_square_volt = -0.5 * scanner.comb.curvature_at_rest();
    let (mean, component) = drive.square(harmonic)?;
    let pump = per_square_volt * component;
    // p²·u² = (4·b²/J)·(k + κ·(u·M + carrier)) with u = s².
    let braking = 4.0 * resonator.damping.powi(2) / resonator.inertia;
    let stiffness = resonator.stiffness + per_square_volt * scanner.carrier_mean_square;
    let half = 0.5 * braking * per_square_volt * mean;
    let square = (half + (half.powi(2) + pump.powi(2) * braking * stiffness).sqrt()) / pump.powi(2);
    (square.is_finite() && square > 0.0).then(|| square.sqrt())
}

/// A frequency in kHz with the digits that a width in Hz asks for: a tenth of it, and hundredths of a kHz at least.
fn khz(hz: f64, width_hz: f64) -> String {
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // 2 to 9
    let digits = (4.0 - width_hz.portable_log10().floor()).clamp(2.0, 9.0) as usize;
    format!("{:.digits$}", hz / 1e3)
}

impl fmt::Display for Stability {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [low, high] = self.drive_hz;
        match self.tongue_hz() {
            None if self.pump_depth == 0.0 => write!(
                f,
                "cannot oscillate at this drive: its square has no component near twice the resonance of {:.2} kHz",
                self.resonance_hz / 1e3
            ),
            None => write!(
                f,
                "cannot oscillate at this drive: the pump depth is {:.1} times below threshold",
                self.threshold() / self.pump_depth
            ),
            Some([from, to]) => {
                let starts = if low <= to && from <= high { "starts" } else { "does not start" };
                write!(
                    f,
                    "{starts} by itself at this drive: the pump depth is {:.1} times the threshold, and a motion \
                     starts from {} to {} kHz",
                    self.pump_depth / self.threshold(),
                    khz(from, to - from),
                    khz(to, to - from)
                )
            }
        }
    }
}
