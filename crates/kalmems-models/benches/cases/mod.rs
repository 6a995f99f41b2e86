//! What is compared with what, and within which bounds.

#![allow(dead_code)] // each bench and test uses its part

use crate::by_hand;
use crate::system::{Innovations, Outcome, Run, System};
use kalmems_core::{Ekf, Filter, FilterError, Nodes, Process, Scalar, SigmaPoints, Ukf};

/// A filter against another that does the same.
pub struct Case<T> {
    pub name: &'static str,
    pub run: Run<T>,
    /// How many times the other's instructions it may take.
    pub bound: f64,
}

/// Filters that do the same, the first written by hand.
pub struct Comparison<T> {
    pub name: &'static str,
    pub by_hand: Run<T>,
    pub others: Vec<Case<T>>,
}

impl<T> Comparison<T> {
    /// All of them, the one by hand first.
    pub fn runs(&self) -> impl Iterator<Item = Run<T>> {
        [self.by_hand].into_iter().chain(self.others.iter().map(|case| case.run))
    }
}

/// The bound of the generic extended filter in f64.
pub const EXTENDED_F64: f64 = 1.10;

/// The bound of the generic extended filter in f32.
pub const EXTENDED_F32: f64 = 1.15;

/// The generic filters against the ones by hand; `extended` is the bound of the generic extended filter.
pub fn comparisons<T: Scalar<Mask = bool>>(extended: f64) -> Vec<Comparison<T>> {
    let case = |name, run, bound| Case { name, run, bound };
    vec![
        Comparison {
            name: "EKF, Euler",
            by_hand: |system| {
                let mut filter = by_hand::Extended::new(system);
                for sample in &system.samples {
                    filter.predict_euler(sample.drive.start)?;
                    filter.update(sample.signal)?;
                }
                Ok(filter.outcome())
            },
            others: vec![
                case(
                    "generic, Jacobian by hand",
                    |s| follow(ekf(s), s, &s.euler_by_hand(), |d| d.start),
                    extended,
                ),
                case("generic, Jacobian by Dual", |s| follow(ekf(s), s, &s.euler(), |d| d.start), 1.12),
            ],
        },
        Comparison {
            name: "EKF, Runge–Kutta",
            by_hand: |system| {
                let mut filter = by_hand::Extended::new(system);
                for sample in &system.samples {
                    filter.predict_runge_kutta(&sample.drive)?;
                    filter.update(sample.signal)?;
                }
                Ok(filter.outcome())
            },
            others: vec![case(
                "generic, Jacobian by Dual",
                |s| follow(ekf(s), s, &s.runge_kutta(), |d| *d),
                1.12,
            )],
        },
        Comparison {
            name: "UKF, Euler",
            by_hand: |system| {
                let mut filter = by_hand::Unscented::new(system);
                for sample in &system.samples {
                    filter.predict_euler(sample.drive.start)?;
                    filter.update(sample.signal)?;
                }
                Ok(filter.outcome())
            },
            others: vec![case("generic", |s| follow(ukf(s), s, &s.euler(), |d| d.start), 1.25)],
        },
        Comparison {
            name: "UKF, Runge–Kutta",
            by_hand: |system| {
                let mut filter = by_hand::Unscented::new(system);
                for sample in &system.samples {
                    filter.predict_runge_kutta(&sample.drive)?;
                    filter.update(sample.signal)?;
                }
                Ok(filter.outcome())
            },
            others: vec![case("generic", |s| follow(ukf(s), s, &s.runge_kutta(), |d| *d), 1.25)],
        },
    ]
}

pub fn ekf<T: Scalar>(system: &System<T>) -> Ekf<T, 2> {
    Ekf::new(system.start_mean, system.start_covariance)
}

fn ukf<T: Scalar>(system: &System<T>) -> Ukf<T, 2> {
    Ukf::new(system.start_mean, system.start_covariance, SigmaPoints::standard())
}

/// Any filter, through the public interface.
#[inline(always)]
pub fn follow<T: Scalar<Mask = bool>, P: Process<T, 2>>(
    mut filter: impl Filter<T, 2>,
    system: &System<T>,
    process: &P,
    input: impl Fn(&Nodes<T>) -> P::Input,
) -> Result<Outcome<T>, FilterError> {
    let r = system.r();
    let mut innovations = Innovations::none();
    for sample in &system.samples {
        filter.predict(process, &input(&sample.drive))?;
        let innovation = filter.update(&system.readout, &[sample.signal], &r)?;
        innovations.add(innovation.residual[0], innovation.covariance.get(0, 0), innovation.nis);
    }
    let p = filter.covariance();
    Ok(Outcome {
        mean: *filter.mean(),
        covariance: [p.get(0, 0), p.get(1, 0), p.get(1, 1)],
        innovations: Some(innovations),
    })
}
