//! What stands around the filters: parameters as states, updates of all kinds, banks, statistics, smoothing over a
//! recording, irregular intervals, steady states.

use crate::models;
use core::hint::black_box;
use core::num::NonZeroU32;
use kalmems_core::adapt::Bank;
use kalmems_core::bound::CramerRao;
use kalmems_core::consistency::Consistency;
use kalmems_core::smooth::{Backward, SmoothingCourse, smooth_interval};
use kalmems_core::update::{Decimation, History, OnNeed, Replay, Sequential};
use kalmems_core::{
    AddedState, Augmented, AugmentedMeasurement, ContinuousDiscrete, Covariance, Drift, Ekf, Filter,
    FilterError, FixedGain, LinearMeasurement, LinearProcess, Mat, Measurement, Nodes, NoiseDensity,
    Observability, OperatingPoint, Process, Rk4, SquareRootEkf, StateTransition,
};
use kalmems_models::dynamics::{ParametricScanner, TorsionalResonator};

type Scanner = Rk4<ParametricScanner<f64>, f64, 2>;

/// The largest error of a state that is estimated in one of the ways below, in rad, or in units of a state.
pub fn what_stands_around_the_filters() -> Option<f64> {
    let errors = [augmented()?, linear()?, irregular()?];
    Some(errors.into_iter().fold(0.0, f64::max))
}

/// Stiffness, gain and offset as states of the scanner, with a bank, statistics, observability and the bound.
fn augmented() -> Option<f64> {
    let (scanner, readout) = models::<f64>();
    let noise = NoiseDensity::none().on::<1>(black_box(1e6));
    let at = ([0.0; 2], 23.76);
    let process: Scanner = Rk4::new(scanner, black_box(1e-6), &noise, (&at.0, &at.1));
    let drift = Drift::GaussMarkov { correlation_time: black_box(10.0), deviation: 1.0 };
    let added = [1e-6, 1e10].map(|scale| AddedState { scale: black_box(scale), drift });
    let wide = Augmented::<_, _, 2, 2, 4>::new(process, &added, [Some("resonator.stiffness"), None]).ok()?;
    let sensor = AugmentedMeasurement::<_, _, 2, 2>::new(readout, &added, [None, Some("gain")]).ok()?;
    let start = Covariance::from_standard_deviations([0.05, 5e3, 1.0, 1.0]);
    let mut bank = Bank::new(
        [Ekf::new([0.12, 0.0, 0.0, 0.0], start), Ekf::new([0.14, 0.0, 0.0, 0.0], start)],
        [0.5, 0.5],
    );
    let mut factored = SquareRootEkf::new([0.12, 0.0, 0.0, 0.0], start);
    let mut statistics = Consistency::<f64, 1, 5>::new();
    let mut observability = Observability::<f64, 4>::new([1.0; 4]);
    let mut bound = CramerRao::new(start);
    let r = Covariance::from_variances([black_box(1.92e-4)]);
    let drive = Nodes::held(black_box(23.76));
    let mut truth = [black_box(0.15), 0.0, 0.0, 0.0];
    let mut due = Decimation::every(NonZeroU32::MIN.saturating_add(1));
    for _ in 0..black_box(500) {
        let (next, f) = wide.linearize(&truth, &drive);
        truth = next;
        let (y, h) = sensor.linearize(&truth);
        observability.advance(&f);
        observability.observe(&h, &r);
        bound.advance(&f, wide.noise().covariance());
        bound.observe(&h, &r).ok()?;
        bank.predict(&[wide; 2], &drive).ok()?;
        bank.update(&[sensor; 2], &y, &[r; 2]).ok()?;
        factored.predict(&wide, &drive).ok()?;
        if due.due() {
            let policy = OnNeed { fraction: black_box(0.01) };
            statistics.add(&factored.update_where(&sensor, &y, &r, &policy).ok()?);
        } else {
            statistics.miss();
        }
    }
    let sensible = statistics.ljung_box().statistic >= 0.0
        && observability.rank(1e-12) > 0
        && bound.covariance().get(0, 0) > 0.0;
    let angle = (bank.mixture().mean[0] - truth[0]).abs().max((factored.mean()[0] - truth[0]).abs());
    sensible.then_some(angle)
}

/// A resonator seen by two sensors, in sequence, late, smoothed and with a fixed gain.
fn linear() -> Option<f64> {
    let resonator = TorsionalResonator {
        inertia: black_box(1.15e-14),
        damping: black_box(5.95e-12),
        stiffness: black_box(1.10e-4),
    };
    let process = resonator.exact(black_box(1e-6), 1e6);
    let both = LinearMeasurement { matrix: Mat([[1.0, 0.0], [0.5, black_box(1e-6)]]) };
    let r = Covariance::from_lower(Mat([[1e-8, 0.0], [1e-9, 1e-8]]));
    let point = OperatingPoint::of(&process, (&both, r), (&[0.0; 2], &[0.0]));
    let mut constant = FixedGain::steady_state([0.1, 0.0], &point).ok()?;
    let start = Covariance::from_standard_deviations([0.05, 5e3]);
    let mut sequential = Ekf::new([0.1, 0.0], start);
    let mut history = History::<_, _, 4>::new(sequential, InTime { process, both, r });
    let mut truth = [black_box(0.15), 0.0];
    let mut late = [0.0; 2];
    for k in 0..black_box(3000) {
        truth = process.step(&truth, &[0.0]);
        let y = both.predict(&truth);
        constant.predict(&process, &[0.0]).ok()?;
        constant.update(&both, &y).ok()?;
        sequential.predict(&process, &[0.0]).ok()?;
        sequential.update_sequentially(&both, &y, &r).ok()?;
        // Every third sample comes two late.
        history.push(if k % 3 == 0 { None } else { Some(y) }).ok()?;
        if k % 3 == 0 {
            late = y;
        } else if k % 3 == 2 {
            history.amend(2, |record| *record = Some(late)).ok()?;
        }
    }
    let smoothed = over_a_recording(&process)?;
    let error = |mean: &[f64; 2]| (mean[0] - truth[0]).abs();
    let errors = [constant.mean(), sequential.mean(), history.filter().mean()].map(error);
    Some(errors.into_iter().fold(smoothed, f64::max))
}

/// One sample of both sensors, or none.
struct InTime {
    process: LinearProcess<f64, 2, 1>,
    both: LinearMeasurement<f64, 2, 2>,
    r: Covariance<f64, 2>,
}

impl Replay<Ekf<f64, 2>> for InTime {
    type Record = Option<[f64; 2]>;
    type Error = FilterError;

    fn replay(&self, filter: &mut Ekf<f64, 2>, record: &Self::Record) -> Result<(), FilterError> {
        filter.predict(&self.process, &[0.0])?;
        if let Some(y) = record {
            filter.update(&self.both, y, &self.r)?;
        }
        Ok(())
    }
}

/// The smoother over a recording of the resonator's angle, in blocks; the error of its first state.
fn over_a_recording(process: &LinearProcess<f64, 2, 1>) -> Option<f64> {
    struct Recording<'a> {
        process: &'a LinearProcess<f64, 2, 1>,
        angle: [f64; 60],
    }
    impl SmoothingCourse<f64, Ekf<f64, 2>, 2> for Recording<'_> {
        type Error = FilterError;
        fn samples(&self) -> usize {
            self.angle.len()
        }
        fn advance(
            &mut self,
            filter: &mut Ekf<f64, 2>,
            _: usize,
        ) -> Result<StateTransition<f64, 2>, FilterError> {
            filter.predict_linked(self.process, &[0.0])
        }
        fn correct(&mut self, filter: &mut Ekf<f64, 2>, sample: usize) -> Result<(), FilterError> {
            let seen = LinearMeasurement { matrix: Mat([[1.0, 0.0]]) };
            let y = self.angle.get(sample).copied().unwrap_or(0.0);
            filter.update(&seen, &[y], &Covariance::from_variances([1e-8])).map(|_| ())
        }
    }
    let mut truth = [black_box(0.15), 0.0];
    let first = truth[0];
    let mut angle = [0.0; 60];
    for sample in &mut angle {
        *sample = truth[0];
        truth = process.step(&truth, &[0.0]);
    }
    let start = Ekf::new([0.1, 0.0], Covariance::from_standard_deviations([0.05, 5e3]));
    let (mut checkpoints, mut block) = ([start; 8], [Backward::identity(); 8]);
    let mut error = None;
    let mut course = Recording { process, angle };
    smooth_interval(&start, &mut course, &mut checkpoints, &mut block, |k, smoothed| {
        if k == 0 {
            error = Some((smoothed.mean[0] - first).abs());
        }
        Ok(())
    })
    .ok()?;
    error
}

/// The scanner's ring-down over intervals that differ.
fn irregular() -> Option<f64> {
    let (scanner, readout) = models::<f64>();
    let noise = NoiseDensity::none().on::<1>(black_box(1e6));
    let propagate = ContinuousDiscrete::new(scanner, noise, 1e-6).ok()?;
    let mut filter = Ekf::new([0.12, 0.0], Covariance::from_standard_deviations([0.05, 5e3]));
    let r = Covariance::from_variances([black_box(1.92e-4)]);
    let mut truth = [black_box(0.15), 0.0];
    let voltage = |_: f64| -> f64 { 23.76 };
    for k in 0..black_box(1000) {
        let interval = 1e-6 + 1e-7 * f64::from(k % 7);
        truth = propagate.over(interval, &truth, voltage).ok()?.step(&truth, &());
        let step = propagate.over(interval, filter.mean(), voltage).ok()?;
        filter.predict(&step, &()).ok()?;
        filter.update(&readout, &readout.predict(&truth), &r).ok()?;
    }
    Some((filter.mean()[0] - truth[0]).abs())
}
