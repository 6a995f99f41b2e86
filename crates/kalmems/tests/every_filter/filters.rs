//! Every filter, one after the other.

use crate::devices::Number;
use kalmems_core::{
    Covariance, Ekf, Filter, IteratedEkf, SchmidtEkf, SigmaPoints, SquareRootEkf, SquareRootUkf, Ukf,
};

/// What is done with every filter.
pub trait Cell<T: Number, const N: usize> {
    fn run<F: Filter<T, N> + Copy>(&mut self, name: &str, start: F);
}

/// Every filter of the core that is a [`Filter`], from the same start.
pub fn every_filter<T: Number, const N: usize>(
    (mean, deviations): &([T; N], [T; N]),
    cell: &mut impl Cell<T, N>,
) {
    let (mean, covariance) = (*mean, Covariance::from_standard_deviations(*deviations));
    let points = SigmaPoints::standard();
    cell.run("Ekf", Ekf::new(mean, covariance));
    cell.run("IteratedEkf", IteratedEkf::<_, N, 4>::new(mean, covariance, T::of(1e-3)));
    cell.run("Ukf", Ukf::new(mean, covariance, points));
    cell.run("SquareRootEkf", SquareRootEkf::new(mean, covariance));
    cell.run("SquareRootUkf", SquareRootUkf::new(mean, covariance, points));
    cell.run("SchmidtEkf", SchmidtEkf::new(mean, covariance, [false; N]));
}
