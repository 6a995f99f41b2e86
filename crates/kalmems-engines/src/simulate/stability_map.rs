//! Where in the plane of drive frequency and drive amplitude a device starts by itself.

use super::Drive;
use super::floquet::exponent_of;
use super::waveform::PeriodStep;
use crate::progress::{Progress, Silent, map_on_threads, processors};
use kalmems_core::{Covariance, Dynamics, Mat, Nodes, Process, ProcessNoise, Rk4};
use serde::Serialize;

/// How fast a small motion about rest grows at each point of a grid.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct StabilityMap {
    /// The drive's frequencies.
    pub drive_hz: Vec<f64>,
    /// How many times as large as the given one the drive is.
    pub factor: Vec<f64>,
    /// The larger exponent of Floquet in 1/s, above 0 where a motion starts by itself: one row for each factor, with
    /// one number for each frequency.
    pub growth_rate: Vec<Vec<f64>>,
}

impl StabilityMap {
    /// The map of a device under a waveform, as [`floquet_exponent`](super::floquet_exponent) has it at each point;
    /// `None` where the drive does not repeat.
    ///
    /// Points are computed on all processors, and each by itself, so that this changes no bit.
    ///
    /// ```
    /// use kalmems_engines::simulate::{Drive, StabilityMap};
    /// use kalmems_models::{capacitance::GaussianComb, dynamics::{ParametricScanner, TorsionalResonator}};
    /// let scanner = ParametricScanner {
    ///     resonator: TorsionalResonator { inertia: 1.15e-14, damping: 5.95e-12, stiffness: 1.10e-4 },
    ///     comb: GaussianComb { nominal: 5.71e-12, angular_width: 0.2, bias: 9.79e-12 },
    ///     carrier_mean_square: 18.0,
    /// };
    /// let drive = Drive::Sine { offset: 90.0, amplitude: 90.0, frequency_hz: 31e3, phase_rad: 0.0 };
    /// // At a third of 90 V it does not start, at 90 V it does.
    /// let map = StabilityMap::of(scanner, &drive, vec![31_380.0], vec![0.33, 1.0], 48).unwrap();
    /// assert!(map.growth_rate[0][0] < 0.0 && map.growth_rate[1][0] > 0.0);
    /// ```
    pub fn of<D: Dynamics<f64, 2, Input = f64> + Copy + Send + Sync>(
        device: D,
        drive: &Drive,
        drive_hz: Vec<f64>,
        factor: Vec<f64>,
        steps_per_period: u32,
    ) -> Option<Self> {
        // One period at factor 1, which all points share.
        let steps = drive.period_steps(steps_per_period)?;
        let points: Vec<[f64; 2]> = factor.iter().flat_map(|s| drive_hz.iter().map(|f| [*f, *s])).collect();
        let shares: Vec<&[[f64; 2]]> = points.chunks(points.len().div_ceil(processors()).max(1)).collect();
        let work = (&Silent as &dyn Progress, "stability");
        let growth = map_on_threads(work, shares.len(), (shares.len(), 1), |share, _| {
            Some(shares[share].iter().map(|point| growth_rate(device, &steps, *point)).collect::<Vec<f64>>())
        })?
        .concat();
        let growth_rate = growth.chunks(drive_hz.len().max(1)).map(<[f64]>::to_vec).collect();
        Some(Self { drive_hz, factor, growth_rate })
    }
}

/// The growth rate at a drive's frequency and factor.
fn growth_rate<D: Dynamics<f64, 2, Input = f64> + Copy>(
    device: D,
    steps: &[PeriodStep],
    [drive_hz, factor]: [f64; 2],
) -> f64 {
    let still = ProcessNoise::from(Covariance::zero());
    let period_s = drive_hz.recip();
    let mut monodromy = Mat::<f64, 2, 2>::identity();
    for step in steps {
        let process = Rk4::with_noise(device, period_s * step.part, still);
        let [start, middle, end] = step.volts.map(|volts| factor * volts);
        monodromy = process.linearize(&[0.0, 0.0], &Nodes { start, middle, end }).1.times(&monodromy);
    }
    exponent_of(&monodromy, period_s)
}
