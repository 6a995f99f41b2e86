//! The filter of a threshold-sensing scanner in units of its own.

use crate::export::ExportError;
use crate::source_code::{ANSWERS, fill, number};
use kalmems_core::detect::{CubicDesign, SlopeDesign};
use kalmems_core::{Covariance, Mat, ProcessNoise};
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

/// The numbers of a [`ThresholdFilter`] in units of 1/N_θ, of the interval T and of the noise's standard deviation σ.
pub struct ScaledThreshold {
    /// 1/N_θ in rad.
    pub angle_unit: f64,
    /// 1/(N_θ·T) in rad/s.
    pub rate_unit: f64,
    /// 1/σ in 1/V.
    pub per_volt: f64,
    /// e^{A·T}.
    pub transition: [[f64; 2]; 2],
    /// Q₀₀, Q₁₀ and Q₁₁.
    pub noise: [f64; 3],
    /// A per sample.
    pub system: Mat<f64, 2, 2>,
    /// θ_c.
    pub centre: f64,
    /// N_g.
    pub gain: f64,
    /// s(u).
    pub shape: CurveShape,
    /// Whether a signal falls where the angle is passed.
    pub falls: bool,
    /// y₀.
    pub offset: f64,
    /// The variance that the filter reckons with.
    pub variance: f64,
    /// The first mean.
    pub start: [f64; 2],
    /// Its standard deviations.
    pub start_sd: [f64; 2],
    /// The standard deviation of the kernel's Gaussian in samples, and how many it has on each side.
    pub kernel: (f64, usize),
    /// The same of the cubic's.
    pub fit: (f64, usize),
    /// The least distance between crossings in samples.
    pub reach: usize,
    /// How many samples after it happened a crossing is known.
    pub look_ahead: usize,
    /// How many samples are kept.
    pub memory: usize,
    /// The response that counts, in standard deviations of that to noise.
    pub deviations: f64,
    /// The angle of a crossing.
    pub angle: f64,
    /// The variance that it has at least.
    pub least_variance: f64,
    /// The largest normalised innovation squared that is believed, if any is not.
    pub gate_nis: Option<f64>,
}

impl ThresholdFilter {
    /// For an interval in s.
    pub fn scaled(&self, interval_s: f64) -> ScaledThreshold {
        let (comb, crossings) = (self.readout.comb, &self.crossings);
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
        let width = crossings.width_s / interval_s;
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // positive, and a few hundred
        let samples = |x: f64| (x - 1e-6).ceil().max(1.0) as usize;
        let half = samples(KERNEL_WIDTHS * width);
        let fit = samples(FIT_REACH * FIT_WIDTHS * width);
        let reach = samples((crossings.separation_s / interval_s).round());
        let look_ahead = half + reach + 1;
        ScaledThreshold {
            angle_unit: units[0],
            rate_unit: units[1],
            per_volt: 1.0 / sd,
            transition: step.transition.0,
            noise: [(0, 0), (1, 0), (1, 1)].map(|(i, j)| noise.get(i, j)),
            system: per_sample.system_matrix(),
            centre: comb.centre / unit,
            gain: comb.gain * units[1] / sd,
            shape: comb.shape,
            falls: comb.steepest() < 0.0,
            offset: self.readout.offset / sd,
            variance: self.signal_variance / self.noise_variance,
            start: [0, 1].map(|i| self.start[i] / units[i]),
            start_sd: [0, 1].map(|i| self.start_sd[i] / units[i]),
            kernel: (width, half),
            fit: (FIT_WIDTHS * width, fit),
            reach,
            look_ahead,
            memory: look_ahead + fit + 3 * fit / 8 + 2,
            deviations: crossings.deviations,
            angle: crossings.angle / unit,
            least_variance: crossings.least_variance / (unit * unit),
            gate_nis: Some(crossings.gate_nis).filter(|nis| nis.is_finite()),
        }
    }
}

impl ScaledThreshold {
    /// The kernel of the slope for the edge that a passed angle gives: its weights, and the design behind them.
    pub fn slope(&self) -> Result<(Vec<f64>, SlopeDesign), ExportError> {
        let (width, half) = self.kernel;
        let design = SlopeDesign::new(width, half)?;
        let sign = if self.falls { -1.0 } else { 1.0 };
        Ok(((1..=half).map(|n| sign * design.weight(n)).collect(), design))
    }

    /// The weights of the cubic, and the design behind them.
    pub fn cubic(&self) -> Result<(Vec<f64>, CubicDesign), ExportError> {
        let (width, reach) = self.fit;
        let design = CubicDesign::new(width, reach)?;
        Ok(((1..=reach).map(|n| design.weight(n)).collect(), design))
    }

    /// How much of what a sample tells the filter takes.
    pub fn share(&self) -> f64 {
        self.variance.recip().min(1.0)
    }

    /// The module behind its heading, for Rust.
    pub fn to_rust(&self) -> Result<String, ExportError> {
        let of = |x: f64| format!("of({})", number(x));
        let list = |values: &[f64], of: &dyn Fn(f64) -> String| {
            values.iter().map(|x| of(*x)).collect::<Vec<_>>().join(", ")
        };
        let table = |values: Vec<f64>| {
            let rows: Vec<String> = values.chunks(4).map(|row| list(row, &of)).collect();
            rows.join(",\n        ")
        };
        let ((slope_weights, slope), (fit_weights, cubic)) = (self.slope()?, self.cubic()?);
        let [[f00, f01], [f10, f11]] = self.transition.map(|row| row.map(of));
        let [[_, a01], [a10, a11]] = self.system.0.map(|row| row.map(of));
        let [own, both, other] = self.noise;
        let noise = ProcessNoise::from(Covariance::from_lower(Mat([[own, 0.0], [both, other]])));
        let [[r00, _], [r10, r11]] = noise.root().0.map(|row| row.map(of));
        let [q00, q10, q11] = self.noise.map(of);
        let [angle, rate] = self.start.map(number);
        let [angle_sd, rate_sd] = self.start_sd.map(number);
        let (policy, gate) = match self.gate_nis {
            Some(nis) => ("Gate", format!("Gate {{ nis: T::of({}) }}", number(nis))),
            None => ("Always", "Always".to_owned()),
        };
        let shape = match self.shape {
            CurveShape::Logistic => "Logistic",
            CurveShape::Gaussian => "Gaussian",
        };
        Ok(fill(
            MODULE,
            &[
                ("a01", &a01),
                ("a10", &a10),
                ("a11", &a11),
                ("angle", &angle),
                ("angle_sd", &angle_sd),
                ("angle_unit", &number(self.angle_unit)),
                ("answers", &ANSWERS),
                ("centre", &number(self.centre)),
                ("deviations", &number(self.deviations)),
                ("f00", &f00),
                ("f01", &f01),
                ("f10", &f10),
                ("f11", &f11),
                ("fit", &self.fit.1),
                ("fit_moments", &list(&cubic.moments, &number)),
                ("fit_noise_gain", &number(cubic.noise_gain)),
                ("fit_weights", &table(fit_weights)),
                ("fit_width", &number(cubic.width)),
                ("gain", &number(self.gain)),
                ("gate", &gate),
                ("half", &self.kernel.1),
                ("least", &number(self.least_variance)),
                ("look_ahead", &self.look_ahead),
                ("memory", &self.memory),
                ("offset", &number(self.offset)),
                ("per_volt", &number(self.per_volt)),
                ("policy", &policy),
                ("q00", &q00),
                ("q10", &q10),
                ("q11", &q11),
                ("r00", &r00),
                ("r10", &r10),
                ("r11", &r11),
                ("rate", &rate),
                ("rate_sd", &rate_sd),
                ("rate_unit", &number(self.rate_unit)),
                ("reach", &self.reach),
                ("shape", &shape),
                ("share", &number(self.share())),
                ("threshold", &number(self.angle)),
                ("slope_moments", &list(&slope.moments(), &number)),
                ("slope_weights", &table(slope_weights)),
                ("variance", &number(self.variance)),
            ],
        ))
    }
}

/// The module, with the places of its constants.
const MODULE: &str = r"use kalmems_core::detect::{CubicDesign, CubicFit, Detector, SlopeKernel, Threshold, angle_at, angle_variance};
use kalmems_core::update::@policy@;
use kalmems_core::{Covariance, Ekf, Filter, FilterError, LinearProcess, Mat, ProcessNoise, Scalar};
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
pub fn process<T: Scalar>() -> LinearProcess<T, 2, 0> {
    let of = T::of;
    LinearProcess {
        transition: Mat([[@f00@, @f01@], [@f10@, @f11@]]),
        input: Mat([[], []]),
        // With its root, which is not found anew with each step.
        noise: ProcessNoise::with_root(
            Mat([[@q00@, of(0.0)], [@q10@, @q11@]]),
            Mat([[@r00@, of(0.0)], [@r10@, @r11@]]),
        ),
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

/// What smooths a signal and takes its slope.
#[inline(always)]
fn slope_kernel<T: Scalar>() -> SlopeKernel<T, @half@> {
    let of = T::of;
    let weights = [
        @slope_weights@,
    ];
    SlopeKernel::of_table(weights, [@slope_moments@])
}

/// The cubic around a crossing.
#[inline(always)]
fn cubic_fit<T: Scalar>() -> CubicFit<T, @fit@> {
    let of = T::of;
    let weights = [
        @fit_weights@,
    ];
    let moments = [@fit_moments@];
    CubicFit::of_table(weights, &CubicDesign { width: @fit_width@, moments, noise_gain: @fit_noise_gain@ })
}

/// The detector and the filter on their way.
#[derive(Clone, Copy, Debug)]
pub struct Estimator<T: Scalar> {
    finder: Finder<T>,
    fit: CubicFit<T, @fit@>,
    filter: Ekf<T, 2>,
    crossings: u32,
}

impl<T: Scalar> Estimator<T> {
    /// Before the first sample.
    pub fn new() -> Self {
        let of = T::of;
        let kernel = slope_kernel();
        let threshold = Threshold::fixed(kernel.noise_deviation(of(1.0)) * of(@deviations@));
        let start = Covariance::from_standard_deviations([of(@angle_sd@), of(@rate_sd@)]);
        Self {
            finder: Finder::new(kernel, threshold, of(1.0)),
            fit: cubic_fit(),
            filter: Ekf::new([of(@angle@), of(@rate@)], start),
            crossings: 0,
        }
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
        // The rate then, h·A·x, makes an error of the time one of the angle.
        let ([by_angle, by_rate], [angle, rate]) = (past.matrix.times(&free).0[0], *self.filter.mean());
        let rate = by_angle * angle + by_rate * rate;
        let variance = angle_variance(crossing.timing_variance, rate, of(1.0)) + of(@least@);
        self.crossings += 1;
        // The samples from which it was found correct the filter themselves, all or a part of them: so much it is less certain, and gives back.
        let before = self.filter.covariance();
        let variance = Covariance::from_variances([variance * of(1.0 + @share@)]);
        self.filter.update_where(&past, &[of(@threshold@)], &variance, &@gate@)?;
        let after = self.filter.covariance();
        let claimed = |i, j| after.get(i, j) + of(@share@) * (before.get(i, j) - after.get(i, j));
        self.filter = Ekf::new(*self.filter.mean(), Covariance::from_lower(Mat::from_fn(claimed)));
        Ok(())
    }

    /// How many crossings there were.
    #[inline(always)]
    pub fn crossings(&self) -> u32 {
        self.crossings
    }

@answers@}
";
