//! How a device gets from one sample to the next and what is read of it, whatever the number of its states.
//!
//! The filters of the core know their number of states when they are compiled. A rig, or a model that is made when the
//! program runs, hands its numbers over in slices, and every filter is compiled once for each number of states, not once
//! for each device.

use kalmems_core::filter::Pole;
use kalmems_core::{
    Covariance, Mat, Measurement, NumericMeasurement, NumericProcess, Process, ProcessNoise, Scalar,
};
use std::cell::Cell;

/// A step x′ = f(x) + w from one sample to the next, what drives it included.
///
/// All slices are as long as there are states, matrices hold them row by row.
pub trait Transition {
    /// f(x), written to `to`.
    fn advance(&self, x: &[f64], to: &mut [f64]);

    /// f(x), and ∂f/∂x.
    fn linearize(&self, x: &[f64], to: &mut [f64], jacobian: &mut [f64]);

    /// f(x) by two steps of half the length, written to `to`: what tells how far one is off. `false` where the step is exact, or a published
    /// method's own, and nothing is written.
    fn advance_in_halves(&self, x: &[f64], to: &mut [f64]) -> bool {
        let _ = (x, to);
        false
    }

    /// Whether its rates bend and jump nowhere, so that the error of a step tells those of its neighbours.
    fn is_smooth(&self) -> bool {
        true
    }

    /// The motion in continuous time where its linear part is taken; `None` where that is not known.
    fn continuous(&self) -> Option<ContinuousMotion> {
        None
    }

    /// The lower triangle of the covariance of w, and of a root W of it, Q = W·Wᵀ.
    fn noise(&self, covariance: &mut [f64], root: &mut [f64]);

    /// How many of these states, from the first one on, depend on others; each behind them depends on itself alone.
    fn moving(&self, states: usize) -> usize {
        states
    }
}

/// A linear motion in continuous time.
pub struct ContinuousMotion {
    /// ∂f/∂x, row by row.
    pub slopes: Vec<f64>,
    /// The power density of the noise of each state's rate.
    pub densities: Vec<f64>,
    /// Its eigenvalues in rad/s.
    pub poles: Vec<Pole<f64>>,
}

/// What a sample says of the state: y = h(x) + v, one number.
pub trait Sensor {
    /// h(x).
    fn read(&self, x: &[f64]) -> f64;

    /// h(x), and ∂h/∂x.
    fn linearize(&self, x: &[f64], slopes: &mut [f64]) -> f64;
}

/// A sensor that keeps where it was linearised last: who needs the slopes of a filter's correction once more need not have them computed again.
pub(super) struct KeptSensor<'a, const N: usize> {
    sensor: &'a dyn Sensor,
    /// The state, and the slopes there.
    last: Cell<Option<([f64; N], [f64; N])>>,
}

impl<'a, const N: usize> KeptSensor<'a, N> {
    pub(super) const fn new(sensor: &'a dyn Sensor) -> Self {
        Self { sensor, last: Cell::new(None) }
    }

    /// ∂h/∂x at a state.
    pub(super) fn slopes_at(&self, x: &[f64; N]) -> [f64; N] {
        if let Some((_, slopes)) = self.last.get().filter(|(at, _)| at == x) {
            return slopes;
        }
        let mut slopes = [0.0; N];
        self.sensor.linearize(x, &mut slopes);
        slopes
    }
}

impl<const N: usize> Sensor for KeptSensor<'_, N> {
    fn read(&self, x: &[f64]) -> f64 {
        self.sensor.read(x)
    }

    fn linearize(&self, x: &[f64], slopes: &mut [f64]) -> f64 {
        let value = self.sensor.linearize(x, slopes);
        let all = <&[f64; N]>::try_from(x).ok().zip(<&[f64; N]>::try_from(&*slopes).ok());
        self.last.set(all.map(|(x, slopes)| (*x, *slopes)));
        value
    }
}

/// A process of the core with its input as a [`Transition`].
pub struct ProcessTransition<'a, P: Process<f64, N>, const N: usize> {
    process: &'a P,
    input: &'a P::Input,
}

impl<'a, P: Process<f64, N>, const N: usize> ProcessTransition<'a, P, N> {
    /// Over one interval, under this input.
    pub fn new(process: &'a P, input: &'a P::Input) -> Self {
        Self { process, input }
    }
}

impl<P: Process<f64, N>, const N: usize> Transition for ProcessTransition<'_, P, N> {
    #[inline(never)]
    fn advance(&self, x: &[f64], to: &mut [f64]) {
        put(to, &self.process.step(&sized(x), self.input));
    }

    #[inline(never)]
    fn linearize(&self, x: &[f64], to: &mut [f64], jacobian: &mut [f64]) {
        let (next, slopes) = self.process.linearize(&sized::<N>(x), self.input);
        put(to, &next);
        put_rows(jacobian, &slopes);
    }

    fn noise(&self, covariance: &mut [f64], root: &mut [f64]) {
        write_noise(self.process.noise(), covariance, root);
    }
}

/// Writes a noise of the core as a [`Transition`] has it.
pub(super) fn write_noise<const N: usize>(
    noise: &ProcessNoise<f64, N>,
    covariance: &mut [f64],
    root: &mut [f64],
) {
    put_rows(covariance, noise.covariance().lower_triangle());
    put_rows(root, noise.root());
}

/// A measurement of the core as a [`Sensor`].
pub struct MeasurementSensor<'a, H, const N: usize>(pub &'a H);

impl<H: Measurement<f64, N, 1>, const N: usize> Sensor for MeasurementSensor<'_, H, N> {
    #[inline(never)]
    fn read(&self, x: &[f64]) -> f64 {
        let [y] = self.0.predict(&sized::<N>(x));
        y
    }

    #[inline(never)]
    fn linearize(&self, x: &[f64], slopes: &mut [f64]) -> f64 {
        let ([y], jacobian) = self.0.linearize(&sized::<N>(x));
        put_rows(slopes, &jacobian);
        y
    }
}

/// The states as an array; no numbers where there are as many others, which does not happen: a model and its filter come
/// from one place.
#[inline]
fn sized<const N: usize>(x: &[f64]) -> [f64; N] {
    x.try_into().unwrap_or([f64::NAN; N])
}

/// Writes numbers to a slice of as many.
#[inline]
fn put<const N: usize>(to: &mut [f64], numbers: &[f64; N]) {
    // Of a known length, so that nothing is called for a few numbers.
    if let Ok(to) = <&mut [f64; N]>::try_from(to) {
        *to = *numbers;
    }
}

/// Writes a matrix to a slice, row by row.
#[inline]
fn put_rows<const M: usize, const N: usize>(to: &mut [f64], matrix: &Mat<f64, M, N>) {
    for (i, row) in matrix.0.iter().enumerate() {
        if let Some(to) = to.get_mut(i * N..(i + 1) * N) {
            put(to, row);
        }
    }
}

/// A transition as the filters of the core take it.
pub(super) struct TransitionProcess<'a, const N: usize> {
    transition: &'a dyn Transition,
    noise: ProcessNoise<f64, N>,
    moving: usize,
}

impl<'a, const N: usize> TransitionProcess<'a, N> {
    pub(super) fn of(transition: &'a dyn Transition) -> Self {
        let (mut covariance, mut root) = (Mat::<f64, N, N>::zero(), Mat::<f64, N, N>::zero());
        transition.noise(covariance.0.as_flattened_mut(), root.0.as_flattened_mut());
        Self { transition, noise: ProcessNoise::with_root(covariance, root), moving: transition.moving(N) }
    }
}

impl<const N: usize> NumericProcess<f64, N> for TransitionProcess<'_, N> {
    type Input = ();

    fn moved(&self, x: &[f64; N], (): &()) -> [f64; N] {
        let mut to = [0.0; N];
        self.transition.advance(x, &mut to);
        to
    }

    fn linearized(&self, x: &[f64; N], (): &()) -> ([f64; N], Mat<f64, N, N>) {
        let (mut to, mut jacobian) = ([0.0; N], Mat::zero());
        self.transition.linearize(x, &mut to, jacobian.0.as_flattened_mut());
        (to, jacobian)
    }

    fn noise_added(&self) -> &ProcessNoise<f64, N> {
        &self.noise
    }

    /// Rows of states that depend on themselves alone are scaled.
    fn spread(&self, f: &Mat<f64, N, N>, p: &Covariance<f64, N>) -> Covariance<f64, N> {
        if self.moving >= N {
            return p.transformed(f);
        }
        let moving = self.moving;
        let dot =
            |a: &[f64; N], b: &dyn Fn(usize) -> f64| (1..N).fold(a[0] * b(0), |sum, k| sum.mac(a[k], b(k)));
        let mut fp = Mat::<f64, N, N>::zero();
        for i in 0..N {
            for j in 0..N {
                fp.0[i][j] =
                    if i < moving { dot(&f.0[i], &|k| p.get(k, j)) } else { f.0[i][i] * p.get(i, j) };
            }
        }
        let mut next = Mat::zero();
        for i in 0..N {
            for j in 0..=i {
                next.0[i][j] = match (i < moving, j < moving) {
                    (true, _) => dot(&fp.0[i], &|k| f.0[j][k]),
                    (false, true) => fp.0[j][i] * f.0[i][i],
                    (false, false) => fp.0[i][j] * f.0[j][j],
                };
            }
        }
        Covariance::from_lower(next)
    }
}

/// A sensor as the filters of the core take it.
pub(super) struct SensorMeasurement<'a>(pub &'a dyn Sensor);

impl<const N: usize> NumericMeasurement<f64, N, 1> for SensorMeasurement<'_> {
    fn expected(&self, x: &[f64; N]) -> [f64; 1] {
        [self.0.read(x)]
    }

    fn linearized(&self, x: &[f64; N]) -> ([f64; 1], Mat<f64, 1, N>) {
        let mut slopes = Mat::zero();
        let y = self.0.linearize(x, &mut slopes.0[0]);
        ([y], slopes)
    }
}
