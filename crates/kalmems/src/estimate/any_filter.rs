//! A filter that is chosen when the program runs.

use super::{LiteralUkf, ModelAlone};
use kalmems_core::update::Policy;
use kalmems_core::{
    Covariance, Ekf, Filter, FilterError, Innovation, IteratedEkf, Link, Measurement, Process, SquareRootEkf,
    Ukf,
};

/// Iterations that the iterated filter takes at most.
pub const ITERATIONS: usize = 10;

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
    /// The unscented one as it was printed.
    LiteralUkf(LiteralUkf<N>),
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
            AnyFilter::LiteralUkf($filter) => $body,
        }
    };
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
