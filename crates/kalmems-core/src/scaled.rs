//! States in units of their own size.

use crate::notation::{lower, matrix, vector};
use crate::{
    Covariance, Dynamics, Gaussian, Mat, Measurement, NoiseDensity, Over, Process, ProcessNoise, Scalar,
};
use core::fmt;

/// A scale is not a positive finite number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NotAScale {
    /// Of this state.
    pub state: usize,
}

impl fmt::Display for NotAScale {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "the scale of state {} is not a positive finite number", self.state)
    }
}

impl core::error::Error for NotAScale {}

/// The unit s of each state, for filters in z = x/s.
///
/// In SI a displacement of 10⁻¹⁰ m has a variance of 10⁻²⁰ m², and what the noise of one short step adds to it may lie
/// below the least number of f32 (the test `an_accelerometer_in_single_precision`). In units of their own size
/// these numbers are nearer one.
///
/// A scale that is a power of two changes no bit of any state, covariance or gain, as long as the numbers stay
/// within range: see [`to_powers_of_two`](Self::to_powers_of_two).
///
/// ```
/// use kalmems_core::{Covariance, Scales};
/// let scales = Scales::new([1e-10, 2.0])?;
/// let start = Covariance::from_standard_deviations([3e-10, 4.0]);
/// assert_eq!(scales.scale_state(&[5e-10, 4.0]), [5.0, 2.0]);
/// assert!((scales.scale_covariance(&start).get(0, 0) - 9.0_f64).abs() < 1e-14);
/// # Ok::<(), kalmems_core::NotAScale>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scales<T, const N: usize> {
    sizes: [T; N],
    recips: [T; N],
}

impl<T: Scalar, const N: usize> Scales<T, N> {
    /// From the unit of each state; each must be positive, and neither it nor its reciprocal near the end of the range.
    pub fn new(sizes: [T; N]) -> Result<Self, NotAScale> {
        let recips = sizes.map(Scalar::recip);
        for (state, (size, recip)) in sizes.iter().zip(&recips).enumerate() {
            if !(size.gt(T::of(0.0)) && size.is_finite() && recip.twice().is_finite()) {
                return Err(NotAScale { state });
            }
        }
        Ok(Self { sizes, recips })
    }

    /// The natural scales of a model, as powers of two.
    pub fn natural<D: Dynamics<T, N>>(dynamics: &D) -> Result<Self, NotAScale> {
        Ok(Self::new(dynamics.natural_scales())?.to_powers_of_two())
    }

    /// Each scale replaced by the largest power of two that is no larger.
    #[must_use]
    pub fn to_powers_of_two(self) -> Self {
        let sizes = self.sizes.map(|size| {
            let mut power = T::of(1.0);
            // f64 ends at 2^±1074.
            for _ in 0..1100 {
                if power.gt(size) {
                    power = power.half();
                } else if !power.twice().gt(size) {
                    power = power.twice();
                }
            }
            power
        });
        Self { sizes, recips: sizes.map(Scalar::recip) }
    }
}

impl<T: Scalar, const N: usize> Scales<T, N> {
    /// The unit of each state.
    #[inline(always)]
    pub const fn sizes(&self) -> &[T; N] {
        &self.sizes
    }

    /// x/s.
    #[inline(always)]
    #[must_use]
    pub fn scale_state<S: Over<T>>(&self, x: &[S; N]) -> [S; N] {
        vector!(|i| x[i] * self.recips[i])
    }

    /// z·s.
    #[inline(always)]
    #[must_use]
    pub fn restore_state<S: Over<T>>(&self, z: &[S; N]) -> [S; N] {
        vector!(|i| z[i] * self.sizes[i])
    }

    /// P_ij/(s_i·s_j), by one after the other: their product may be out of range.
    #[inline(always)]
    #[must_use]
    pub fn scale_covariance(&self, p: &Covariance<T, N>) -> Covariance<T, N> {
        lower!(|i, j| p.get(i, j) * self.recips[i] * self.recips[j])
    }

    /// P_ij·s_i·s_j.
    #[inline(always)]
    #[must_use]
    pub fn restore_covariance(&self, p: &Covariance<T, N>) -> Covariance<T, N> {
        lower!(|i, j| p.get(i, j) * self.sizes[i] * self.sizes[j])
    }

    /// A Gaussian over x as one over z.
    #[inline(always)]
    #[must_use]
    pub fn scale_gaussian(&self, g: &Gaussian<T, N>) -> Gaussian<T, N> {
        Gaussian { mean: self.scale_state(&g.mean), covariance: self.scale_covariance(&g.covariance) }
    }

    /// A Gaussian over z as one over x.
    #[inline(always)]
    #[must_use]
    pub fn restore_gaussian(&self, g: &Gaussian<T, N>) -> Gaussian<T, N> {
        Gaussian { mean: self.restore_state(&g.mean), covariance: self.restore_covariance(&g.covariance) }
    }

    /// A noise density on x as one on z.
    #[inline(always)]
    #[must_use]
    pub fn scale_density(&self, density: &NoiseDensity<T, N>) -> NoiseDensity<T, N> {
        NoiseDensity::from_lower(self.scale_covariance(density.matrix()).to_full())
    }

    /// A noise density on z as one on x.
    #[inline(always)]
    #[must_use]
    pub fn restore_density(&self, density: &NoiseDensity<T, N>) -> NoiseDensity<T, N> {
        NoiseDensity::from_lower(self.restore_covariance(density.matrix()).to_full())
    }

    /// F of x as F of z: F_ij·s_j/s_i.
    #[inline(always)]
    fn scale_matrix(&self, f: &Mat<T, N, N>) -> Mat<T, N, N> {
        matrix!(|i, j| f.0[i][j] * self.sizes[j] * self.recips[i])
    }
}

/// [`Dynamics`] or a [`Measurement`] of x as one of z = x/s.
///
/// An integrator over scaled dynamics is a process in z, and its noise density one in z
/// ([`Scales::scale_density`]). A measurement keeps its own unit.
///
/// ```
/// use kalmems_core::{Dynamics, Over, Scalar, Scaled, Scales};
/// /// A spring with position in m and velocity in m/s.
/// struct Spring;
/// impl<T: Scalar> Dynamics<T, 2> for Spring {
///     type Input = ();
///     fn derivative<S: Over<T>>(&self, x: &[S; 2], (): &()) -> [S; 2] {
///         [x[1], -x[0]]
///     }
///     fn natural_scales(&self) -> [T; 2] {
///         [T::of(0.25), T::of(0.5)]
///     }
/// }
/// let scaled = Scaled::new(Spring, Scales::natural(&Spring)?);
/// assert_eq!(scaled.derivative(&[1.0, 1.0], &()), [0.5 / 0.25, -0.25 / 0.5]);
/// # Ok::<(), kalmems_core::NotAScale>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scaled<M, T, const N: usize> {
    model: M,
    scales: Scales<T, N>,
}

impl<M, T, const N: usize> Scaled<M, T, N> {
    /// Wraps a model whose state is in its own units.
    pub const fn new(model: M, scales: Scales<T, N>) -> Self {
        Self { model, scales }
    }
}

impl<T: Scalar, D: Dynamics<T, N>, const N: usize> Dynamics<T, N> for Scaled<D, T, N> {
    type Input = D::Input;

    #[inline(always)]
    fn derivative<S: Over<T>>(&self, z: &[S; N], u: &D::Input) -> [S; N] {
        self.scales.scale_state(&self.model.derivative(&self.scales.restore_state(z), u))
    }

    #[inline(always)]
    fn bends(i: usize) -> bool {
        D::bends(i)
    }

    #[inline(always)]
    fn natural_scales(&self) -> [T; N] {
        self.scales.scale_state(&self.model.natural_scales())
    }

    #[inline(always)]
    fn jacobian(&self, z: &[T; N], u: &D::Input) -> Mat<T, N, N> {
        self.scales.scale_matrix(&self.model.jacobian(&self.scales.restore_state(z), u))
    }
}

impl<T: Scalar, H: Measurement<T, N, M>, const N: usize, const M: usize> Measurement<T, N, M>
    for Scaled<H, T, N>
{
    #[inline(always)]
    fn predict<S: Over<T>>(&self, z: &[S; N]) -> [S; M] {
        self.model.predict(&self.scales.restore_state(z))
    }

    #[inline(always)]
    fn depends(i: usize, j: usize) -> bool {
        H::depends(i, j)
    }

    #[inline(always)]
    fn linearize(&self, z: &[T; N]) -> ([T; M], Mat<T, M, N>) {
        let (y, h) = self.model.linearize(&self.scales.restore_state(z));
        (y, matrix!(|i, j| h.0[i][j] * self.scales.sizes[j]))
    }
}

/// A [`Process`] on x as one on z = x/s, for one that was not made from [`Dynamics`].
///
/// Its noise is scaled after it was computed. Where that is out of range already, scale the dynamics and discretise
/// them then.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ScaledProcess<P, T, const N: usize> {
    process: P,
    scales: Scales<T, N>,
    noise: ProcessNoise<T, N>,
}

impl<T: Scalar, P: Process<T, N>, const N: usize> ScaledProcess<P, T, N> {
    /// Wraps a process whose state is in its own units.
    pub fn new(process: P, scales: Scales<T, N>) -> Self {
        let noise = scales.scale_covariance(process.noise().covariance()).into();
        Self { process, scales, noise }
    }
}

impl<T: Scalar, P: Process<T, N>, const N: usize> Process<T, N> for ScaledProcess<P, T, N> {
    type Input = P::Input;

    #[inline(always)]
    fn step<S: Over<T>>(&self, z: &[S; N], u: &P::Input) -> [S; N] {
        self.scales.scale_state(&self.process.step(&self.scales.restore_state(z), u))
    }

    #[inline(always)]
    fn noise(&self) -> &ProcessNoise<T, N> {
        &self.noise
    }

    #[inline(always)]
    fn linearize(&self, z: &[T; N], u: &P::Input) -> ([T; N], Mat<T, N, N>) {
        let (x, f) = self.process.linearize(&self.scales.restore_state(z), u);
        (self.scales.scale_state(&x), self.scales.scale_matrix(&f))
    }
}
