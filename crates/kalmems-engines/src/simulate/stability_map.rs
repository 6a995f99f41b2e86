//! Where in the plane of drive frequency and drive amplitude a device starts by itself.

// Instructions for lanes are used only where everything is inlined into the kernel.
#![allow(clippy::inline_always)]

use super::Drive;
use super::floquet::exponent_of;
use super::waveform::PeriodStep;
use crate::progress::{Progress, Silent, map_on_threads, processors};
use kalmems_core::lanes::{Isa, Kernel, Lane};
use kalmems_core::{Covariance, Dynamics, Mat, Nodes, Process, ProcessNoise, Rk4};
use kalmems_models::capacitance::GaussianComb;
use kalmems_models::dynamics::{ParametricScanner, TorsionalResonator};
use serde::Serialize;

/// A device that can be computed several times side by side.
pub trait SideBySide: Copy + Send + Sync {
    /// It, with its parameters in lanes.
    type In<L: Lane<f64>>: Dynamics<L, 2, Input = L> + Copy;

    /// The same parameters in every lane. Put `#[inline(always)]` on it.
    fn spread<L: Lane<f64>>(&self) -> Self::In<L>;
}

impl SideBySide for ParametricScanner<f64> {
    type In<L: Lane<f64>> = ParametricScanner<L>;

    #[inline(always)]
    fn spread<L: Lane<f64>>(&self) -> ParametricScanner<L> {
        ParametricScanner {
            resonator: TorsionalResonator {
                inertia: L::of(self.resonator.inertia),
                damping: L::of(self.resonator.damping),
                stiffness: L::of(self.resonator.stiffness),
            },
            comb: GaussianComb {
                nominal: L::of(self.comb.nominal),
                angular_width: L::of(self.comb.angular_width),
                bias: L::of(self.comb.bias),
            },
            carrier_mean_square: L::of(self.carrier_mean_square),
        }
    }
}

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
    /// Points are computed side by side in the lanes of a register and on all processors; each is the same by
    /// itself, so that neither changes a bit.
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
    pub fn of<D: SideBySide>(
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
            let points = shares[share];
            let mut growth = vec![0.0; points.len()];
            Isa::best().run(GrowthRates { device, steps: &steps, points, growth: &mut growth });
            Some(growth)
        })?
        .concat();
        let growth_rate = growth.chunks(drive_hz.len().max(1)).map(<[f64]>::to_vec).collect();
        Some(Self { drive_hz, factor, growth_rate })
    }
}

/// Growth rates at points of drive frequency and factor.
struct GrowthRates<'a, D> {
    device: D,
    steps: &'a [PeriodStep],
    points: &'a [[f64; 2]],
    growth: &'a mut [f64],
}

impl<D: SideBySide> Kernel<f64> for GrowthRates<'_, D> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lane<f64>>(self) {
        let device = self.device.spread::<L>();
        let still = ProcessNoise::from(Covariance::zero());
        for (points, growth) in self.points.chunks(L::WIDTH).zip(self.growth.chunks_mut(L::WIDTH)) {
            // A lane without a point repeats the first.
            let period = L::from_fn(|lane| points.get(lane).unwrap_or(&points[0])[0]).recip();
            let factor = L::from_fn(|lane| points.get(lane).unwrap_or(&points[0])[1]);
            let rest = [L::of(0.0), L::of(0.0)];
            let mut monodromy = Mat::<L, 2, 2>::identity();
            for step in self.steps {
                let process = Rk4::with_noise(device, period * L::of(step.part), still);
                let [start, middle, end] = step.volts;
                let nodes = Nodes {
                    start: factor * L::of(start),
                    middle: factor * L::of(middle),
                    end: factor * L::of(end),
                };
                monodromy = process.linearize(&rest, &nodes).1.times(&monodromy);
            }
            let Mat([[a, b], [c, d]]) = monodromy;
            for (lane, (growth, point)) in growth.iter_mut().zip(points).enumerate() {
                let entry = |number: L| number.lane(lane).unwrap_or(f64::NAN);
                *growth = exponent_of(&Mat([[entry(a), entry(b)], [entry(c), entry(d)]]), 1.0 / point[0]);
            }
        }
    }
}
