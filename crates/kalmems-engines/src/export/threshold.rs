//! The filter of a threshold-sensing scanner in units of its own.

use super::{fill, number};
use kalmems_models::capacitance::CurveShape;
use kalmems_models::dynamics::MirrorResonator;
use kalmems_models::readout::CurrentReadout;

/// The extended Kalman filter of angle and rate with what finds crossings, in SI. The mirror is not driven.
#[derive(Clone, Debug)]
pub struct ThresholdFilter {
    /// How it moves.
    pub resonator: MirrorResonator<f64>,
    /// How it is read.
    pub readout: CurrentReadout<f64>,
    /// The variance of the signal's noise per sample in V².
    pub noise_variance: f64,
    /// The variance that the filter reckons with, in V².
    pub signal_variance: f64,
    /// The density of the angular acceleration's noise in rad²/s³.
    pub acceleration_density: f64,
    /// Angle in rad and rate in rad/s to start from.
    pub start: [f64; 2],
    /// Their standard deviations.
    pub start_sd: [f64; 2],
    /// How crossings are found and used.
    pub crossings: CrossingSettings,
}

/// How crossings are found and used.
#[derive(Clone, Copy, Debug)]
pub struct CrossingSettings {
    /// The standard deviation of the Gaussian in s.
    pub width_s: f64,
    /// The least distance between crossings in s.
    pub separation_s: f64,
    /// The response that counts, in standard deviations of that to noise.
    pub deviations: f64,
    /// The angle in rad.
    pub angle: f64,
    /// The variance that an angle at a crossing has at least, in rad².
    pub least_variance: f64,
    /// The largest normalised innovation squared that is believed.
    pub gate_nis: f64,
}

/// The kernel holds this many widths on each side, and the cubic, twice as wide, three of its own.
const KERNEL_WIDTHS: f64 = 4.0;
const FIT_WIDTHS: f64 = 2.0;
const FIT_REACH: f64 = 3.0;

impl ThresholdFilter {
    /// The module behind its heading, for Rust.
    pub fn to_rust(&self, interval_s: f64) -> String {
        let comb = self.readout.comb;
        let unit = 1.0 / comb.steepness;
        let units = [unit, unit / interval_s];
        let sd = self.noise_variance.sqrt();
        let per_sample = MirrorResonator {
            natural_rate: self.resonator.natural_rate * interval_s,
            damping_ratio: self.resonator.damping_ratio,
        };
        let density = self.acceleration_density * interval_s.powi(3) / (unit * unit);
        let step = per_sample.exact(1.0, density);
        let noise = step.noise.covariance();
        let matrix = |m: [[f64; 2]; 2]| m.map(|row| row.map(|x| format!("of({})", number(x))));
        let [[f00, f01], [f10, f11]] = matrix(step.transition.0);
        let [[q00, _], [q10, q11]] = matrix([[noise.get(0, 0), 0.0], [noise.get(1, 0), noise.get(1, 1)]]);
        let [[_, a01], [a10, a11]] = matrix(per_sample.system_matrix().0);
        let width = self.crossings.width_s / interval_s;
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // positive, and a few hundred
        let samples = |x: f64| (x - 1e-6).ceil().max(1.0) as usize;
        let half = samples(KERNEL_WIDTHS * width);
        let fit = samples(FIT_REACH * FIT_WIDTHS * width);
        let reach = samples((self.crossings.separation_s / interval_s).round());
        let look_ahead = half + reach + 1;
        let memory = look_ahead + fit + 3 * fit / 8 + 2;
        let gate = if self.crossings.gate_nis.is_finite() {
            format!("Gate {{ nis: T::of({}) }}", number(self.crossings.gate_nis))
        } else {
            "Always".to_owned()
        };
        let policy = if self.crossings.gate_nis.is_finite() { "Gate" } else { "Always" };
        let shape = match comb.shape {
            CurveShape::Logistic => "Logistic",
            CurveShape::Gaussian => "Gaussian",
        };
        let [angle, rate] = [0, 1].map(|i| number(self.start[i] / units[i]));
        let [angle_sd, rate_sd] = [0, 1].map(|i| number(self.start_sd[i] / units[i]));
        let falling = if comb.steepest() < 0.0 { ".falling()" } else { "" };
        fill(
            MODULE,
            &[
                ("a01", &a01),
                ("a10", &a10),
                ("a11", &a11),
                ("angle", &angle),
                ("angle_sd", &angle_sd),
                ("angle_unit", &number(units[0])),
                ("centre", &number(comb.centre / unit)),
                ("deviations", &number(self.crossings.deviations)),
                ("f00", &f00),
                ("f01", &f01),
                ("f10", &f10),
                ("f11", &f11),
                ("falling", &falling),
                ("fit", &fit),
                ("fit_width", &number(FIT_WIDTHS * width)),
                ("gain", &number(comb.gain * units[1] / sd)),
                ("gate", &gate),
                ("half", &half),
                ("least", &number(self.crossings.least_variance / (unit * unit))),
                ("look_ahead", &look_ahead),
                ("memory", &memory),
                ("offset", &number(self.readout.offset / sd)),
                ("per_steepest", &number((sd * interval_s / (comb.steepest() * unit * unit)).abs())),
                ("per_volt", &number(1.0 / sd)),
                ("policy", &policy),
                ("q00", &q00),
                ("q10", &q10),
                ("q11", &q11),
                ("rate", &rate),
                ("rate_sd", &rate_sd),
                ("rate_unit", &number(units[1])),
                ("reach", &reach),
                ("shape", &shape),
                ("threshold", &number(self.crossings.angle / unit)),
                ("variance", &number(self.signal_variance / self.noise_variance)),
                ("width", &number(width)),
            ],
        )
    }
}

/// The module, with the places of its constants.
const MODULE: &str = r"use kalmems_core::detect::{CubicFit, DetectError, Detector, SlopeKernel, Threshold, angle_at, angle_variance};
use kalmems_core::update::@policy@;
use kalmems_core::{Covariance, Ekf, Filter, FilterError, LinearProcess, Mat, Scalar};
use kalmems_models::capacitance::{CombCurve, CurveShape};
use kalmems_models::readout::CurrentReadout;

/// The unit of the angle in rad.
pub const ANGLE_UNIT_RAD: f64 = @angle_unit@;
/// The unit of the rate in rad/s.
pub const RATE_UNIT_RAD_PER_S: f64 = @rate_unit@;
/// What a signal of 1 V is, in standard deviations of its noise.
pub const PER_VOLT: f64 = @per_volt@;
/// How many samples after it happened a crossing is known.
pub const LOOK_AHEAD: usize = Finder::<f64>::LOOK_AHEAD;

/// What finds crossings.
type Finder<T> = Detector<T, @half@, @reach@, @memory@>;

/// One step over one interval, and its noise.
#[inline(always)]
pub fn process<T: Scalar<Mask = bool>>() -> LinearProcess<T, 2, 0> {
    let of = T::of;
    LinearProcess {
        transition: Mat([[@f00@, @f01@], [@f10@, @f11@]]),
        input: Mat([[], []]),
        noise: Covariance::from_lower(Mat([[@q00@, of(0.0)], [@q10@, @q11@]])).into(),
    }
}

/// What is read, in standard deviations of its noise.
#[inline(always)]
pub fn readout<T: Scalar>() -> CurrentReadout<T> {
    let of = T::of;
    let comb = CombCurve {
        centre: of(@centre@),
        gain: of(@gain@),
        steepness: of(1.0),
        shape: CurveShape::@shape@,
    };
    CurrentReadout { comb, offset: of(@offset@) }
}

/// The detector and the filter on their way.
#[derive(Clone, Copy, Debug)]
pub struct Estimator<T: Scalar> {
    finder: Finder<T>,
    fit: CubicFit<T, @fit@>,
    filter: Ekf<T, 2>,
    crossings: u32,
}

impl<T: Scalar<Mask = bool>> Estimator<T> {
    /// Before the first sample.
    pub fn new() -> Result<Self, DetectError> {
        let of = T::of;
        let kernel = SlopeKernel::new(@width@)?@falling@;
        let threshold = Threshold::fixed(kernel.noise_deviation(of(1.0)) * of(@deviations@));
        let start = Covariance::from_standard_deviations([of(@angle_sd@), of(@rate_sd@)]);
        Ok(Self {
            finder: Finder::new(kernel, threshold, of(1.0)),
            fit: CubicFit::new(@fit_width@)?,
            filter: Ekf::new([of(@angle@), of(@rate@)], start),
            crossings: 0,
        })
    }

    /// Goes on to the next sample, a signal in V; the first is at the start.
    #[inline(always)]
    pub fn step(&mut self, signal_v: T, is_first: bool) -> Result<(), FilterError> {
        let signal = signal_v * T::of(PER_VOLT);
        if !is_first {
            self.filter.predict(&process(), &[])?;
        }
        if self.finder.push(signal).is_some() {
            self.cross()?;
        }
        self.filter.update(&readout(), &[signal], &Covariance::from_variances([T::of(@variance@)])).map(drop)
    }

    /// Corrects by a crossing that is known now, where the signal has a zero there.
    #[inline(never)]
    fn cross(&mut self) -> Result<(), FilterError> {
        let of = T::of;
        let Some(crossing) = self.finder.crossing(&self.fit, of(@offset@)) else { return Ok(()) };
        let free = Mat([[of(0.0), @a01@], [@a10@, @a11@]]);
        let past = angle_at(&free, of(@look_ahead@.0) - crossing.displacement);
        // y′ = h′·ω² where h is 0.
        let rate = (crossing.slope.abs() * of(@per_steepest@)).sqrt();
        let variance = angle_variance(crossing.timing_variance, rate, of(1.0)) + of(@least@);
        self.crossings += 1;
        self.filter
            .update_where(&past, &[of(@threshold@)], &Covariance::from_variances([variance]), &@gate@)
            .map(drop)
    }

    /// How many crossings there were.
    #[inline(always)]
    pub fn crossings(&self) -> u32 {
        self.crossings
    }

    /// Angle and rate, in their units.
    #[inline(always)]
    pub fn mean(&self) -> [T; 2] {
        *self.filter.mean()
    }

    /// Their covariance, in their units.
    #[inline(always)]
    pub fn covariance(&self) -> Covariance<T, 2> {
        self.filter.covariance()
    }
}
";
