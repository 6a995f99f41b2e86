//! The extended filter in lanes, for counting: one group of devices, all on the same signal.

use crate::system::System;
use kalmems_core::lanes::{Isa, Kernel, Lane, Real};
use kalmems_core::{
    Covariance, Ekf, Euler, Filter, FilterError, Nodes, Parameters, Process, ProcessNoise, Rk4, Scalar,
};
use std::hint::black_box;

/// The set of instructions that is counted: valgrind knows no AVX-512.
pub const COUNTED: Isa = Isa::Avx2;

/// Which step.
#[derive(Clone, Copy, Debug)]
pub enum Method {
    Euler,
    RungeKutta,
}

/// The filters of one group.
pub struct Group<'a, F> {
    pub system: &'a System<F>,
    pub method: Method,
}

impl<F: Real + Scalar<Mask = bool>> Kernel<F> for Group<'_, F> {
    /// How many there are, or why they stopped.
    type Output = Result<usize, FilterError>;

    #[inline(always)]
    fn run<L: Lane<F>>(self) -> Self::Output {
        let system = self.system;
        let scanner = system.scanner.map(|_, value| L::splat(value));
        let interval = L::splat(system.interval);
        let q = system.process_noise;
        let mut noise = Covariance::from_variances([L::splat(q.get(0, 0)), L::splat(q.get(1, 1))]);
        // All lanes alike would let the optimiser know something; black-boxed, they do not.
        noise = black_box(noise);
        match self.method {
            Method::Euler => follow(system, &Euler::new(scanner, interval, noise), |d| L::splat(d.start)),
            Method::RungeKutta => {
                let process = Rk4::with_noise(scanner, interval, ProcessNoise::from(noise));
                follow(system, &process, |d| Nodes {
                    start: L::splat(d.start),
                    middle: L::splat(d.middle),
                    end: L::splat(d.end),
                })
            }
        }
    }
}

/// Over the whole signal.
#[inline(always)]
fn follow<F: Real + Scalar<Mask = bool>, L: Lane<F>, P: Process<L, 2>>(
    system: &System<F>,
    process: &P,
    input: impl Fn(&Nodes<F>) -> P::Input,
) -> Result<usize, FilterError> {
    let readout = system.readout.map(|_, value| L::splat(value));
    let r = Covariance::from_variances([L::splat(system.readout_variance)]);
    let start = system.start_covariance;
    let covariance = Covariance::from_variances([L::splat(start.get(0, 0)), L::splat(start.get(1, 1))]);
    let mut filter = Ekf::new(system.start_mean.map(|x| L::splat(x)), covariance);
    for sample in &system.samples {
        filter.predict(process, &input(&sample.drive))?;
        filter.update(&readout, &[L::splat(sample.signal)], &r)?;
    }
    Ok(L::WIDTH)
}
