//! The filter of a shared-electrode scanner in units of its own.

use crate::export::ExportSamples;
use crate::source_code::{ANSWERS, fill, number};
use kalmems_core::update::Decimation;
use kalmems_core::{Covariance, Ekf, Euler, Filter, Nodes, NoiseDensity, Process, Rk4};
use kalmems_models::dynamics::ParametricScanner;
use kalmems_models::readout::DemodulatedComb;
use std::num::NonZeroU32;

/// The extended Kalman filter of angle and rate, in SI.
#[derive(Clone, Debug)]
pub struct ScannerFilter {
    /// How it moves.
    pub scanner: ParametricScanner<f64>,
    /// How it is read.
    pub readout: DemodulatedComb<f64>,
    /// The variance of the signal's noise per sample in V².
    pub noise_variance: f64,
    /// The density of the angular acceleration's noise in rad²/s³.
    pub acceleration_density: f64,
    /// Angle in rad and rate in rad/s to start from.
    pub start: [f64; 2],
    /// Their standard deviations.
    pub start_sd: [f64; 2],
    /// How a step is integrated.
    pub integration: Integration,
}

/// How a step is integrated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Integration {
    /// Euler's method.
    Euler,
    /// The classical Runge–Kutta method.
    RungeKutta,
}

/// The numbers of a [`ScannerFilter`] in units of θ₀, of the interval T and of the noise's standard deviation σ.
pub struct ScaledScannerFilter {
    /// θ₀ in rad.
    pub angle_unit: f64,
    /// θ₀/T in rad/s.
    pub rate_unit: f64,
    /// 1/σ in 1/V.
    pub per_volt: f64,
    /// k/J·T².
    pub stiffness: f64,
    /// b/J·T.
    pub damping: f64,
    /// C₀/(J·θ₀²)·T² in 1/V².
    pub pull: f64,
    /// V_c²/2 in V².
    pub carrier_mean_square: f64,
    /// a·C₀/σ.
    pub gain: f64,
    /// (a·C_b + b)/σ.
    pub offset: f64,
    /// Q₀₀, Q₁₀ and Q₁₁.
    pub noise: [f64; 3],
    /// The first mean.
    pub start: [f64; 2],
    /// Its standard deviations.
    pub start_sd: [f64; 2],
}

impl ScannerFilter {
    /// For an interval in s.
    pub fn scaled(&self, interval_s: f64) -> ScaledScannerFilter {
        let comb = self.scanner.comb;
        let resonator = self.scanner.resonator;
        let (width, sd) = (comb.angular_width, self.noise_variance.sqrt());
        let units = [width, width / interval_s];
        let density = NoiseDensity::none().on::<1>(self.acceleration_density);
        // As the estimate has it: discretised for the motion at rest and without a drive.
        let step = Rk4::new(self.scanner, interval_s, &density, (&[0.0; 2], &0.0));
        let noise = step.noise().covariance();
        let square = interval_s * interval_s;
        ScaledScannerFilter {
            angle_unit: units[0],
            rate_unit: units[1],
            per_volt: 1.0 / sd,
            stiffness: resonator.stiffness / resonator.inertia * square,
            damping: resonator.damping / resonator.inertia * interval_s,
            pull: comb.nominal / resonator.inertia / (width * width) * square,
            carrier_mean_square: self.scanner.carrier_mean_square,
            gain: self.readout.gain * comb.nominal / sd,
            offset: (self.readout.gain * comb.bias + self.readout.offset) / sd,
            noise: [(0, 0), (1, 0), (1, 1)].map(|(i, j)| noise.get(i, j) / (units[i] * units[j])),
            start: [0, 1].map(|i| self.start[i] / units[i]),
            start_sd: [0, 1].map(|i| self.start_sd[i] / units[i]),
        }
    }
}

impl ScannerFilter {
    /// The angle in rad after each sample by the library's filter, corrected by one sample in `update_every`; not a number where it
    /// refuses a sample.
    pub fn angles(&self, samples: &ExportSamples, interval_s: f64, update_every: NonZeroU32) -> Vec<f64> {
        let density = NoiseDensity::none().on::<1>(self.acceleration_density);
        let runge_kutta = Rk4::new(self.scanner, interval_s, &density, (&[0.0; 2], &0.0));
        let euler = Euler::new(self.scanner, interval_s, *runge_kutta.noise().covariance());
        let noise = Covariance::from_variances([self.noise_variance]);
        let mut filter = Ekf::new(self.start, Covariance::from_standard_deviations(self.start_sd));
        let mut decimation = Decimation::every(update_every);
        let mut angle_after = |k: usize| {
            let moved = match (k.checked_sub(1), self.integration) {
                (None, _) => true,
                (Some(before), Integration::Euler) => filter.predict(&euler, &samples.drive[before]).is_ok(),
                (Some(before), Integration::RungeKutta) => {
                    let [start, middle, end] = [samples.drive[before], samples.middle[k], samples.drive[k]];
                    filter.predict(&runge_kutta, &Nodes { start, middle, end }).is_ok()
                }
            };
            let corrected =
                !decimation.due() || filter.update(&self.readout, &[samples.signal[k]], &noise).is_ok();
            if moved && corrected { filter.mean()[0] } else { f64::NAN }
        };
        (0..samples.signal.len()).map(&mut angle_after).collect()
    }
}

impl ScaledScannerFilter {
    /// The module behind its heading, for Rust.
    pub fn to_rust(&self, integration: Integration, update_every: u32) -> String {
        let (process, make, input, what) = match integration {
            Integration::Euler => {
                ("Euler", "Euler::new(scanner(), of(1.0), noise)", "T", "at the start of the interval")
            }
            Integration::RungeKutta => (
                "Rk4",
                "Rk4::with_noise(scanner(), of(1.0), noise.into())",
                "Nodes<T>",
                "at its ends and in its middle",
            ),
        };
        let decimated = update_every > 1;
        let due = if decimated { "\n    due: Decimation," } else { "" };
        let first = if decimated { ", due: Decimation::every(UPDATE_EVERY)" } else { "" };
        let every = if decimated {
            "/// Every how many samples the filter is corrected.\npub const UPDATE_EVERY: NonZeroU32 = NonZeroU32::MIN.saturating_add(EVERY_LESS_ONE);\n"
                .replace("EVERY_LESS_ONE", &(update_every - 1).to_string())
        } else {
            String::new()
        };
        let skip = if decimated {
            "        if !self.due.due() {\n            return self.filter.predict(&process(), drive).map(drop);\n        }\n"
        } else {
            ""
        };
        let begin = if decimated { "        self.due.due();\n" } else { "" };
        let mut imports = vec!["Covariance", "Ekf", "Filter", "FilterError", "Mat", "Scalar", process];
        if integration == Integration::RungeKutta {
            imports.push("Nodes");
        }
        imports.sort_unstable();
        let used = if decimated {
            "use core::num::NonZeroU32;\nuse kalmems_core::update::Decimation;\n"
        } else {
            ""
        };
        let [q00, q10, q11] = self.noise.map(number);
        let [angle, rate] = self.start.map(number);
        let [angle_sd, rate_sd] = self.start_sd.map(number);
        fill(
            MODULE,
            &[
                ("angle", &angle),
                ("angle_sd", &angle_sd),
                ("angle_unit", &number(self.angle_unit)),
                ("answers", &ANSWERS),
                ("begin", &begin),
                ("carrier", &number(self.carrier_mean_square)),
                ("damping", &number(self.damping)),
                ("due", &due),
                ("every", &every),
                ("first", &first),
                ("gain", &number(self.gain)),
                ("imports", &imports.join(", ")),
                ("input", &input),
                ("make", &make),
                ("offset", &number(self.offset)),
                ("per_volt", &number(self.per_volt)),
                ("process", &process),
                ("pull", &number(self.pull)),
                ("q00", &q00),
                ("q10", &q10),
                ("q11", &q11),
                ("rate", &rate),
                ("rate_sd", &rate_sd),
                ("rate_unit", &number(self.rate_unit)),
                ("skip", &skip),
                ("stiffness", &number(self.stiffness)),
                ("used", &used),
                ("what", &what),
            ],
        )
    }
}

/// The module, with the places of its constants.
const MODULE: &str = r"@used@use kalmems_core::{@imports@};
use kalmems_models::capacitance::GaussianComb;
use kalmems_models::dynamics::{ParametricScanner, TorsionalResonator};
use kalmems_models::readout::DemodulatedComb;

/// The unit of the angle in rad.
pub const ANGLE_UNIT_RAD: f64 = @angle_unit@;
/// The unit of the rate in rad/s.
pub const RATE_UNIT_RAD_PER_S: f64 = @rate_unit@;
/// What a signal of 1 V is, in standard deviations of its noise.
pub const PER_VOLT: f64 = @per_volt@;
@every@
/// How it moves, the angle in its unit and the time in samples.
#[inline(always)]
pub fn scanner<T: Scalar>() -> ParametricScanner<T> {
    let of = T::of;
    ParametricScanner {
        resonator: TorsionalResonator { inertia: of(1.0), damping: of(@damping@), stiffness: of(@stiffness@) },
        comb: GaussianComb { nominal: of(@pull@), angular_width: of(1.0), bias: of(-0.0) },
        carrier_mean_square: of(@carrier@),
    }
}

/// One step over one interval, and its noise; what drives it is the voltage @what@.
#[inline(always)]
pub fn process<T: Scalar>() -> @process@<ParametricScanner<T>, T, 2> {
    let of = T::of;
    let noise = Covariance::from_lower(Mat([[of(@q00@), of(0.0)], [of(@q10@), of(@q11@)]]));
    @make@
}

/// What is read, in standard deviations of its noise.
#[inline(always)]
pub fn readout<T: Scalar>() -> DemodulatedComb<T> {
    let of = T::of;
    let comb = GaussianComb { nominal: of(1.0), angular_width: of(1.0), bias: of(-0.0) };
    DemodulatedComb { comb, gain: of(@gain@), offset: of(@offset@) }
}

/// The filter on its way.
#[derive(Clone, Copy, Debug)]
pub struct Estimator<T> {
    filter: Ekf<T, 2>,@due@
}

impl<T: Scalar<Mask = bool>> Estimator<T> {
    /// Before the first sample.
    #[inline(always)]
    pub fn new() -> Self {
        let of = T::of;
        let start = Covariance::from_standard_deviations([of(@angle_sd@), of(@rate_sd@)]);
        Self { filter: Ekf::new([of(@angle@), of(@rate@)], start)@first@ }
    }

    /// Corrects by the first sample, in V.
    #[inline(always)]
    pub fn begin(&mut self, signal_v: T) -> Result<(), FilterError> {
@begin@        self.filter.update(&readout(), &[signal_v * T::of(PER_VOLT)], &one()).map(drop)
    }

    /// Goes on to the next sample: the drive in V @what@, the signal in V at its end.
    #[inline(always)]
    pub fn step(&mut self, drive: &@input@, signal_v: T) -> Result<(), FilterError> {
@skip@        let seen = [signal_v * T::of(PER_VOLT)];
        self.filter.step((&process(), drive), (&readout(), &seen, &one())).map(drop)
    }

@answers@}

impl<T: Scalar<Mask = bool>> Default for Estimator<T> {
    fn default() -> Self {
        Self::new()
    }
}

/// The variance of the signal in its unit.
#[inline(always)]
fn one<T: Scalar>() -> Covariance<T, 1> {
    Covariance::from_variances([T::of(1.0)])
}
";
