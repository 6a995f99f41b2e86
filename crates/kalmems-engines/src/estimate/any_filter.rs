//! A filter that is chosen when the program runs.

use super::ModelAlone;
use crate::config::Method;
use kalmems_core::update::Policy;
use kalmems_core::{
    Covariance, Ekf, Filter, FilterError, Innovation, IteratedEkf, Link, Measurement, Process, SigmaPoints,
    SquareRootEkf, Ukf,
};

/// Iterations that the iterated filter takes at most.
const ITERATIONS: usize = 10;

/// One of the filters, but for the unscented one in square-root form, which takes longer to compile than all the others
/// together.
///
/// A filter dissolves into the loop that it is used in. That is what makes it fast, and what takes long to compile
/// where every filter meets every model in every loop. Behind this, a loop is compiled once per model; the choice
/// costs a branch per step that always goes the same way.
#[derive(Clone, Copy, Debug)]
#[allow(clippy::large_enum_variant)] // there is one per recording
pub enum AnyFilter<const N: usize> {
    /// The model without a sensor.
    ModelAlone(ModelAlone<N>),
    /// The extended Kalman filter.
    Ekf(Ekf<f64, N>),
    /// The iterated one.
    IteratedEkf(IteratedEkf<f64, N, ITERATIONS>),
    /// The extended one in square-root form.
    SquareRootEkf(SquareRootEkf<f64, N>),
    /// The unscented Kalman filter.
    Ukf(Ukf<f64, N>),
}

/// The same for whichever filter it is.
macro_rules! each {
    ($any:expr, $filter:ident => $body:expr) => {
        match $any {
            AnyFilter::ModelAlone($filter) => $body,
            AnyFilter::Ekf($filter) => $body,
            AnyFilter::IteratedEkf($filter) => $body,
            AnyFilter::SquareRootEkf($filter) => $body,
            AnyFilter::Ukf($filter) => $body,
        }
    };
}

/// When the iterated filter has settled, in standard deviations.
const SETTLED: f64 = 1e-3;

impl<const N: usize> AnyFilter<N> {
    /// The filter of a method, from this mean and covariance; the extended one for a method that is none of these,
    /// which a rig refuses or has its own filter for.
    pub fn of(
        method: Method,
        points: SigmaPoints<f64>,
        mean: [f64; N],
        covariance: Covariance<f64, N>,
    ) -> Self {
        match method {
            Method::Model => Self::ModelAlone(ModelAlone::new(mean)),
            Method::Ekf
            | Method::EulerEkf
            | Method::LockIn
            | Method::DirectInversion
            | Method::HybridEkf
            | Method::SteadyState
            | Method::KalmanBucy
            | Method::Luenberger
            | Method::ConsiderEkf
            | Method::Bank => Self::Ekf(Ekf::new(mean, covariance)),
            Method::IteratedEkf => Self::IteratedEkf(IteratedEkf::new(mean, covariance, SETTLED)),
            Method::SquareRootEkf => Self::SquareRootEkf(SquareRootEkf::new(mean, covariance)),
            Method::Ukf | Method::SquareRootUkf => Self::Ukf(Ukf::new(mean, covariance, points)),
        }
    }
}

impl<const N: usize> Filter<f64, N> for AnyFilter<N> {
    fn mean(&self) -> &[f64; N] {
        each!(self, filter => filter.mean())
    }

    #[inline(never)]
    fn covariance(&self) -> Covariance<f64, N> {
        each!(self, filter => filter.covariance())
    }

    #[inline(never)]
    fn predict_linked<P: Process<f64, N>>(
        &mut self,
        process: &P,
        u: &P::Input,
    ) -> Result<Link<f64, N>, FilterError> {
        each!(self, filter => filter.predict_linked(process, u))
    }

    #[inline(never)]
    fn update_where<H: Measurement<f64, N, M>, const M: usize>(
        &mut self,
        measurement: &H,
        y: &[f64; M],
        r: &Covariance<f64, M>,
        policy: &impl Policy<f64, N>,
    ) -> Result<Innovation<f64, M>, FilterError> {
        each!(self, filter => filter.update_where(measurement, y, r, policy))
    }
}
