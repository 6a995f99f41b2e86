//! What is compared with what, and within which bounds.

#![allow(dead_code)] // each bench and test uses its part

use crate::by_hand;
use crate::system::{Innovations, Outcome, Run, System};
use kalmems_core::{
    AddedState, Augmented, AugmentedMeasurement, Covariance, Drift, Ekf, Filter, FilterError, Measurement,
    Nodes, NoiseDensity, Process, Rk4, Scalar, SigmaPoints, SquareRootEkf, Ukf,
};
use kalmems_models::dynamics::DriveGain;

/// A filter against the first.
pub struct Case<T> {
    pub name: &'static str,
    pub run: Run<T>,
    /// How many times the first's instructions it may take.
    pub bound: f64,
}

/// Filters beside the first of them.
pub struct Comparison<T> {
    pub name: &'static str,
    /// What the first is called.
    pub first: &'static str,
    pub run: Run<T>,
    pub others: Vec<Case<T>>,
}

impl<T> Comparison<T> {
    /// All of them.
    pub fn runs(&self) -> impl Iterator<Item = Run<T>> {
        [self.run].into_iter().chain(self.others.iter().map(|case| case.run))
    }
}

/// The filters that are written by hand.
const BY_HAND: &str = "by hand";

/// The bound of the generic extended filter in f64.
pub const EXTENDED_F64: f64 = 1.10;

/// The bound of the generic extended filter in f32.
pub const EXTENDED_F32: f64 = 1.15;

/// The bound of the generic square-root filter.
const SQUARE_ROOT: f64 = 1.10;

/// The bound of the generic filter with a constant gain.
const FIXED_GAIN: f64 = 1.03;

/// The generic filters against the ones by hand; `extended` is the bound of the generic extended filter.
pub fn comparisons<T: Scalar>(extended: f64) -> Vec<Comparison<T>> {
    let mut all = extended_filters(extended);
    all.extend(unscented_filters());
    all.extend(square_root_filters());
    all.push(fixed_gain_filters());
    all
}

/// What more states cost.
pub fn more_states<T: Scalar>() -> Comparison<T> {
    Comparison {
        name: "EKF, Runge–Kutta, states",
        first: "2 states",
        run: |s| follow(ekf(s), s, &s.runge_kutta(), |d| *d),
        others: vec![case("5 states", five_states, 8.0)],
    }
}

fn case<T>(name: &'static str, run: Run<T>, bound: f64) -> Case<T> {
    Case { name, run, bound }
}

fn extended_filters<T: Scalar>(bound: f64) -> Vec<Comparison<T>> {
    vec![
        Comparison {
            name: "EKF, Euler",
            first: BY_HAND,
            run: |system| {
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
                    bound,
                ),
                case("generic, Jacobian by Dual", |s| follow(ekf(s), s, &s.euler(), |d| d.start), 1.12),
            ],
        },
        Comparison {
            name: "EKF, Runge–Kutta",
            first: BY_HAND,
            run: |system| {
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
    ]
}

fn unscented_filters<T: Scalar>() -> Vec<Comparison<T>> {
    vec![
        Comparison {
            name: "UKF, Euler",
            first: BY_HAND,
            run: |system| {
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
            first: BY_HAND,
            run: |system| {
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

fn square_root_filters<T: Scalar>() -> Vec<Comparison<T>> {
    vec![
        Comparison {
            name: "SR-EKF, Euler",
            first: BY_HAND,
            run: |system| {
                let mut filter = by_hand::SquareRoot::new(system);
                for sample in &system.samples {
                    filter.predict_euler(sample.drive.start)?;
                    filter.update(sample.signal)?;
                }
                Ok(filter.outcome())
            },
            others: vec![
                case(
                    "generic, Jacobian by hand",
                    |s| follow(square_root(s), s, &s.euler_by_hand(), |d| d.start),
                    SQUARE_ROOT,
                ),
                case(
                    "generic, Jacobian by Dual",
                    |s| follow(square_root(s), s, &s.euler(), |d| d.start),
                    SQUARE_ROOT,
                ),
            ],
        },
        Comparison {
            name: "SR-EKF, Runge–Kutta",
            first: BY_HAND,
            run: |system| {
                let mut filter = by_hand::SquareRoot::new(system);
                for sample in &system.samples {
                    filter.predict_runge_kutta(&sample.drive)?;
                    filter.update(sample.signal)?;
                }
                Ok(filter.outcome())
            },
            others: vec![case(
                "generic, Jacobian by Dual",
                |s| follow(square_root(s), s, &s.runge_kutta(), |d| *d),
                SQUARE_ROOT,
            )],
        },
    ]
}

/// The filter with a constant gain, in the same operations as the one by hand.
pub fn fixed_gain_filters<T: Scalar>() -> Comparison<T> {
    Comparison {
        name: "Fixed gain, exact",
        first: BY_HAND,
        run: |system| {
            let mut filter = by_hand::FixedGain::new(system);
            for sample in &system.held {
                filter.predict(sample.torque)?;
                filter.update(sample.signal)?;
            }
            Ok(filter.outcome())
        },
        others: vec![case("generic", fixed_gain, FIXED_GAIN)],
    }
}

pub fn ekf<T: Scalar>(system: &System<T>) -> Ekf<T, 2> {
    Ekf::new(system.start_mean, system.start_covariance)
}

fn ukf<T: Scalar>(system: &System<T>) -> Ukf<T, 2> {
    Ukf::new(system.start_mean, system.start_covariance, SigmaPoints::standard())
}

fn square_root<T: Scalar>(system: &System<T>) -> SquareRootEkf<T, 2> {
    SquareRootEkf::new(system.start_mean, system.start_covariance)
}

/// The filter with a constant gain, through the public interface.
#[inline(always)]
fn fixed_gain<T: Scalar>(system: &System<T>) -> Result<Outcome<T>, FilterError> {
    let (mut filter, process) = (system.settled(), system.resonator());
    let mut innovations = Innovations::none();
    for sample in &system.held {
        filter.predict(&process, &[sample.torque])?;
        let innovation = filter.update(&system.readout, &[sample.signal])?;
        innovations.add(innovation.residual[0], innovation.covariance.get(0, 0), innovation.nis);
    }
    let p = filter.filtered_covariance();
    Ok(Outcome {
        mean: *filter.mean(),
        covariance: [p.get(0, 0), p.get(1, 0), p.get(1, 1)],
        innovations: Some(innovations),
    })
}

/// Any filter, through the public interface.
#[inline(always)]
pub fn follow<T: Scalar, P: Process<T, 2>>(
    filter: impl Filter<T, 2>,
    system: &System<T>,
    process: &P,
    input: impl Fn(&Nodes<T>) -> P::Input,
) -> Result<Outcome<T>, FilterError> {
    follow_states(filter, system, process, &system.readout, input)
}

/// The extended filter by Runge–Kutta with stiffness, gain and offset as states beside angle and rate.
fn five_states<T: Scalar>(system: &System<T>) -> Result<Outcome<T>, FilterError> {
    let of = |value: f64| T::of(value);
    let drift = Drift::RandomWalk { density: of(1e-8) };
    let (stiffness, gain) = (system.scanner.resonator.stiffness, system.readout.gain);
    let added = [stiffness, gain, of(1.0)].map(|scale| AddedState { scale, drift });
    let model = DriveGain { scanner: system.scanner, drive_gain: of(1.0) };
    let noise = NoiseDensity::none().on::<1>(of(1e10));
    let step = Rk4::new(model, system.interval, &noise, (&[of(0.0); 2], &of(0.0)));
    let in_motion = [Some("scanner.resonator.stiffness"), None, None];
    let in_readout = [None, Some("gain"), Some("offset")];
    let process = Augmented::<_, _, 2, 3, 5>::new(step, &added, in_motion).expect("the names are right");
    let readout = AugmentedMeasurement::<_, _, 2, 3>::new(system.readout, &added, in_readout);
    let readout = readout.expect("the names are right");
    let [angle, rate] = system.start_mean;
    let deviations = [of(0.05), of(5e3), of(0.01), of(0.05), of(0.05)];
    let start = Covariance::from_standard_deviations(deviations);
    let filter = Ekf::new([angle, rate, of(0.0), of(0.0), of(0.0)], start);
    follow_states(filter, system, &process, &readout, |drive| *drive)
}

#[inline(always)]
fn follow_states<T: Scalar, P: Process<T, N>, const N: usize>(
    mut filter: impl Filter<T, N>,
    system: &System<T>,
    process: &P,
    readout: &impl Measurement<T, N, 1>,
    input: impl Fn(&Nodes<T>) -> P::Input,
) -> Result<Outcome<T>, FilterError> {
    let r = system.r();
    let mut innovations = Innovations::none();
    for sample in &system.samples {
        filter.predict(process, &input(&sample.drive))?;
        let innovation = filter.update(readout, &[sample.signal], &r)?;
        innovations.add(innovation.residual[0], innovation.covariance.get(0, 0), innovation.nis);
    }
    let p = filter.covariance();
    Ok(Outcome {
        mean: [filter.mean()[0], filter.mean()[1]],
        covariance: [p.get(0, 0), p.get(1, 0), p.get(1, 1)],
        innovations: Some(innovations),
    })
}
