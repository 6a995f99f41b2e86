//! One gain for all of a swing: constant in the frame that turns with the motion.

use crate::estimate::{GainOf, Never, Swing};
use kalmems_core::Portable;
use kalmems_core::riccati::continuous_riccati;
use kalmems_core::update::{Correction, Policy};
use kalmems_core::{
    Cholesky, Covariance, Ekf, Filter, FilterError, FixedGain, Innovation, LinearProcess, Lu, Mat,
    NoiseDensity, NumericMeasurement, NumericProcess, OperatingPoint, Process, StateTransition,
};
use std::f64::consts::TAU;

/// A filter with a constant gain for a device that swings, on the states [θ, θ̇] of each coordinate.
///
/// What a sample tells turns with the phase φ = atan2(ω·θ, θ̇) of each swing, so that no constant gain K fits it. With the errors
/// δθ = a·sin φ + b·cos φ and δθ̇ = ω·(a·cos φ − b·sin φ), x = T(φ)·e, a is the error of the amplitude A and b that of the phase
/// times A. Both change slowly: in the mean over the cycles of a steady swing ė = F·e + w with the density Q of w (the first
/// approximation of Krylov and Bogoliubov), and a sample of the variance R carries the information G/R, with G the mean of
/// (H·T)ᵀ·(H·T). For these constant matrices there is a constant gain L, and K = T·L·(H·T)ᵀ turns with the estimate's phase.
/// A correction takes two products with T and none of a covariance.
///
/// Right where the gain is slow against the swing, near the amplitude that it is computed for.
#[derive(Clone, Copy, Debug)]
pub struct TurningGain<const N: usize> {
    mean: [f64; N],
    /// ω of the coordinate of each state in rad/s.
    rates: [f64; N],
    /// L.
    weight: Mat<f64, N, N>,
    /// The covariances in which e settles.
    predicted: Covariance<f64, N>,
    filtered: Covariance<f64, N>,
}

/// What a device is linearised to at a state and a time in s: the slopes of its rates, and those of its signal.
pub type LinearisedDevice<'a, const N: usize> =
    dyn Fn(&[f64; N], f64) -> (Mat<f64, N, N>, Mat<f64, 1, N>) + 'a;

/// Points of the fastest cycle over which means are taken.
const POINTS: f64 = 64.0;
/// How many times faster than the error's decay the slowest swing has to be at least.
const FASTER: f64 = 10.0;

impl<const N: usize> TurningGain<N> {
    /// The gain, from a mean on, for what a device is linearised to at a state and a time in s, its rates' slopes and those of its signal, with the density of its
    /// noise; of these swings, whose means are taken over a time from its begin in s on; for samples of this interval in s and this variance in V².
    pub fn of(
        (gain, mean): (GainOf, [f64; N]),
        device: (&LinearisedDevice<'_, N>, Mat<f64, N, N>),
        motion: (&[Swing], [f64; 2]),
        (interval_s, noise_variance): (f64, f64),
    ) -> Result<Self, String> {
        let rates = std::array::from_fn(|i| motion.0.get(i / 2).map_or(f64::NAN, |swing| swing.rate));
        let slowest = rates.into_iter().fold(f64::INFINITY, f64::min);
        if let GainOf::Poles(corner) = gain
            && corner * FASTER > slowest
        {
            return Err(format!(
                "its gain is for the mean over the cycles of the motion, and one of {:.6} Hz is not {FASTER} times faster than an \
                 error that decays with {:.6} Hz",
                slowest / TAU,
                corner / TAU
            ));
        }
        let SteadyMeans { system, density, information } = SteadyMeans::of(device, motion, &rates);
        // A root of G is an observation of as many numbers as there are states, each with the noise of a sample.
        let lower = Cholesky::of_semidefinite(&Covariance::from_lower(information));
        let observation = Mat::from_fn(|i, j| lower.0[j][i]);
        let process = LinearProcess::<f64, N, 0>::exact(&system, &Mat::zero(), &density, interval_s);
        let point = OperatingPoint {
            transition: process.transition,
            observation,
            process_noise: *process.noise().covariance(),
            measurement_noise: Covariance::from_variances([noise_variance; N]),
        };
        let per_variance =
            |covariance: &Covariance<f64, N>| covariance.to_full().scaled(noise_variance.recip());
        let weight = match gain {
            GainOf::Settled => {
                let settled = FixedGain::steady_state([0.0; N], &point).map_err(|why| why.to_string())?;
                per_variance(settled.filtered_covariance())
            }
            // Over an interval h the gain P·Hᵀ/(R·h) of the continuous filter adds P·Hᵀ/R times what a sample says of the error.
            GainOf::Continuous => {
                let noise = Mat::identity().scaled(noise_variance * interval_s);
                let noise = NoiseDensity::from_lower(noise);
                let settled = continuous_riccati(&system, &observation, &density, &noise);
                per_variance(&settled.map_err(|why| why.to_string())?)
            }
            // F̂·(I − L·G) = e^{−ω_c·h}·I with the transition F̂.
            GainOf::Poles(corner) => {
                let unseen = || "its signal does not tell amplitude and phase apart".to_owned();
                let transition = Lu::of(&point.transition).ok_or_else(unseen)?;
                let left = transition.inverse().scaled((-corner * interval_s).portable_exp());
                let identity = Mat::<f64, N, N>::identity();
                let closed = Mat::<f64, N, N>::from_fn(|i, j| identity.0[i][j] - left.0[i][j]);
                closed.times(&Lu::of(&information).ok_or_else(unseen)?.inverse())
            }
        };
        let settled = FixedGain::from_gain([0.0; N], weight.times_transposed(&observation), &point);
        let settled = settled.map_err(|why| why.to_string())?;
        let (predicted, filtered) = (*settled.predicted_covariance(), *settled.filtered_covariance());
        Ok(Self { mean, rates, weight, predicted, filtered })
    }

    /// T at the phases of the estimate.
    fn turn(&self) -> Mat<f64, N, N> {
        turned(&self.mean, &self.rates)
    }
}

/// T at the phases of a state; of one at rest, at a phase of 0.
fn turned<const N: usize>(x: &[f64; N], rates: &[f64; N]) -> Mat<f64, N, N> {
    of_each(|first| {
        let (sine, cosine) = phase(x, rates, first);
        [[sine, cosine], [rates[first] * cosine, -rates[first] * sine]]
    })
}

/// Sine and cosine of the phase of the coordinate whose state is the `first` one.
fn phase<const N: usize>(x: &[f64; N], rates: &[f64; N], first: usize) -> (f64, f64) {
    let (angle, rate) = (rates[first] * x[first], x[first + 1]);
    let amplitude = angle.portable_hypot(rate);
    if amplitude > 0.0 { (angle / amplitude, rate / amplitude) } else { (0.0, 1.0) }
}

/// A matrix of one block for each coordinate, told by its first state.
fn of_each<const N: usize>(block: impl Fn(usize) -> [[f64; 2]; 2]) -> Mat<f64, N, N> {
    Mat::from_fn(|i, j| if i / 2 == j / 2 { block(i / 2 * 2)[i % 2][j % 2] } else { 0.0 })
}

/// The means over a steady motion.
struct SteadyMeans<const N: usize> {
    /// F.
    system: Mat<f64, N, N>,
    /// Q.
    density: NoiseDensity<f64, N>,
    /// G.
    information: Mat<f64, N, N>,
}

impl<const N: usize> SteadyMeans<N> {
    fn of(
        (linearised, noise): (&LinearisedDevice<'_, N>, Mat<f64, N, N>),
        (swings, [from_s, length_s]): (&[Swing], [f64; 2]),
        rates: &[f64; N],
    ) -> Self {
        let fastest = rates.iter().copied().fold(0.0, f64::max);
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a positive count, saturating
        let points = (POINTS * length_s * fastest / TAU).ceil() as usize;
        let [mut system, mut density, mut information] = [Mat::<f64, N, N>::zero(); 3];
        for point in 0..points {
            let time_s = from_s + length_s * point as f64 / points as f64;
            let now: Vec<[f64; 2]> = swings.iter().map(|swing| swing.at(time_s)).collect();
            let x = std::array::from_fn(|i| now.get(i / 2).map_or(f64::NAN, |swing| swing[i % 2]));
            let turn = turned(&x, rates);
            // T⁻¹, and dT/dt of a phase that turns with ω.
            let back: Mat<f64, N, N> = of_each(|first| {
                let (sine, cosine) = phase(&x, rates, first);
                [[sine, cosine / rates[first]], [cosine, -sine / rates[first]]]
            });
            let turning: Mat<f64, N, N> = of_each(|first| {
                let ((sine, cosine), rate) = (phase(&x, rates, first), rates[first]);
                [[rate * cosine, -rate * sine], [-rate * rate * sine, -rate * rate * cosine]]
            });
            let (jacobian, seen) = linearised(&x, time_s);
            let moved = jacobian.times(&turn);
            let moved = Mat::<f64, N, N>::from_fn(|i, j| moved.0[i][j] - turning.0[i][j]);
            let seen: Mat<f64, 1, N> = seen.times(&turn);
            let noise = Covariance::from_lower(noise).transformed(&back);
            let share = (points as f64).recip();
            system = system.plus(&back.times(&moved).scaled(share));
            density = density.plus(&noise.lower_triangle().scaled(share));
            information = information.plus(&Mat::from_fn(|i, j| share * seen.0[0][i] * seen.0[0][j]));
        }
        Self { system, density: NoiseDensity::from_lower(density), information }
    }
}

impl<const N: usize> Filter<f64, N> for TurningGain<N> {
    fn mean(&self) -> &[f64; N] {
        &self.mean
    }

    fn covariance(&self) -> Covariance<f64, N> {
        self.filtered.transformed(&self.turn())
    }

    fn predict_linked<P: NumericProcess<f64, N>>(
        &mut self,
        process: &P,
        u: &P::Input,
    ) -> Result<StateTransition<f64, N>, FilterError> {
        let (mean, transition) = process.linearized(&self.mean, u);
        if !mean.iter().all(|x| x.is_finite()) {
            return Err(FilterError::NonFiniteState);
        }
        self.mean = mean;
        Ok(StateTransition { transition, noise: *process.noise_added().covariance() })
    }

    fn update_where<H: NumericMeasurement<f64, N, M>, const M: usize>(
        &mut self,
        measurement: &H,
        y: &[f64; M],
        r: &Covariance<f64, M>,
        policy: &impl Policy<f64, N>,
    ) -> Result<Innovation<f64, M>, FilterError> {
        let turn = self.turn();
        let predicted = self.predicted.transformed(&turn);
        let mut innovation = Ekf::new(self.mean, predicted).update_where(measurement, y, r, &Never)?;
        let seen: Mat<f64, M, N> = measurement.linearized(&self.mean).1.times(&turn);
        let gain: Mat<f64, N, M> = turn.times(&self.weight.times_transposed(&seen));
        let change = gain.times_vector(&innovation.residual);
        let variance = std::array::from_fn(|i| predicted.get(i, i));
        innovation.taken = policy.take(&innovation, &Correction { change, variance });
        if innovation.taken {
            let mean: [f64; N] = std::array::from_fn(|i| self.mean[i] + change[i]);
            if !mean.iter().all(|x| x.is_finite()) {
                return Err(FilterError::NonFiniteState);
            }
            self.mean = mean;
        }
        Ok(innovation)
    }
}
