//! The filters in lanes.

use crate::models;
use core::hint::black_box;
use kalmems_core::lanes::{Isa, Kernel, Lane, Real};
use kalmems_core::update::Gate;
use kalmems_core::{
    Covariance, Ekf, Filter, IteratedEkf, Measurement, Nodes, Process, ProcessNoise, Rk4, Scalar, SchmidtEkf,
    SigmaPoints, SquareRootEkf, SquareRootUkf, Ukf,
};

/// Whether all of them followed, with each set of instructions that this machine has.
pub fn followed() -> bool {
    Isa::available().all(|isa| {
        let followed = |error: Option<Option<f64>>| error.flatten().is_some_and(|e| e < 1e-3);
        followed(isa.run::<f64, _>(InLanes))
            && followed(isa.run::<f32, _>(InLanes))
            && followed(isa.run::<f64, _>(OthersInLanes))
    })
}

/// Filters in lanes against a simulated ring-down from several angles at once; the largest error at the end, in rad.
///
/// Two call sites of each model function, so that none is inlined by chance.
struct InLanes;

/// The other filters, likewise.
struct OthersInLanes;

impl<F: Real + Into<f64>> Kernel<F> for InLanes {
    type Output = Option<f64>;

    #[inline(always)]
    fn run<L: Lane<F>>(self) -> Option<f64> {
        let (mean, start) = beginning::<L>();
        let extended = Ekf::new(mean, start);
        let unscented = Ukf::new(mean, start, SigmaPoints::standard());
        follow_in_lanes::<F, L, _, _>(extended, unscented)
    }
}

impl<F: Real + Into<f64>> Kernel<F> for OthersInLanes {
    type Output = Option<f64>;

    #[inline(always)]
    fn run<L: Lane<F>>(self) -> Option<f64> {
        let (mean, start) = beginning::<L>();
        let iterated = IteratedEkf::<L, 2, 2>::new(mean, start, L::of(1e-3));
        let considering = SchmidtEkf::new(mean, start, [false, false]);
        let worst = follow_in_lanes::<F, L, _, _>(iterated, considering)?;
        let factored = SquareRootEkf::new(mean, start);
        let both = SquareRootUkf::new(mean, start, SigmaPoints::standard());
        let other = follow_in_lanes::<F, L, _, _>(factored, both)?;
        Some(if other > worst { other } else { worst })
    }
}

/// Where the filters start.
#[inline(always)]
fn beginning<L: Scalar>() -> ([L; 2], Covariance<L, 2>) {
    ([L::of(0.12), L::of(0.0)], Covariance::from_standard_deviations([L::of(0.05), L::of(5e3)]))
}

/// Two filters.
#[inline(always)]
fn follow_in_lanes<F: Real + Into<f64>, L: Lane<F>, A: Filter<L, 2>, B: Filter<L, 2>>(
    mut a: A,
    mut b: B,
) -> Option<f64> {
    let (scanner, readout) = models::<L>();
    let q = Covariance::from_variances([1e-16, 1.0].map(|q| L::of(black_box(q))));
    let process = Rk4::with_noise(scanner, L::of(black_box(1e-6)), ProcessNoise::from(q));
    let r = Covariance::from_variances([L::of(black_box(1.92e-4))]);
    let drive = Nodes::held(L::of(black_box(23.76)));
    let gate = Gate { nis: L::of(black_box(1e6)) };
    let mut truth = [L::from_fn(|lane| F::of(0.14 + 0.001 * lane as f64)), L::of(0.0)];
    for _ in 0..black_box(2000) {
        truth = process.step(&truth, &drive);
        let y = readout.predict(&truth);
        a.predict(&process, &drive).ok()?;
        a.update_where(&readout, &y, &r, &gate).ok()?;
        b.predict(&process, &drive).ok()?;
        b.update_where(&readout, &y, &r, &gate).ok()?;
    }
    let mut worst = 0.0;
    for angle in [a.mean()[0], b.mean()[0]] {
        for lane in 0..L::WIDTH {
            let error: f64 = (angle - truth[0]).abs().lane(lane)?.into();
            worst = if error > worst { error } else { worst };
        }
    }
    Some(worst)
}
