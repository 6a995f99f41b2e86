//! The mirror that moves as a phasor, beside the scanner: what five states and none of their covariance cost.

use crate::cases;
use crate::system::{Innovations, Outcome, System};
use kalmems_core::{Covariance, Ekf, Filter, FilterError, FixedGain, NoiseDensity};
use kalmems_models::capacitance::DistanceSeries;
use kalmems_models::dynamics::DriftingPhasor;
use kalmems_models::readout::{DriftingPhasorCapacitance, PhasorDetector};
use std::f64::consts::{PI, TAU};
use std::hint::black_box;

/// Both devices over signals of one length.
pub struct Both {
    scanner: System<f64>,
    process: DriftingPhasor<f64>,
    series: DistanceSeries<f64, 2>,
    variance: f64,
    lock: FixedGain<f64, 5, 3>,
    start: [f64; 5],
    signal: Vec<f64>,
}

/// A filter over one of them.
pub type Run = fn(&Both) -> Result<Outcome<f64>, FilterError>;

impl Both {
    /// In micrometres, femtofarads and hertz: 500 Hz at 194 kHz, without noise.
    pub fn simulated(length: usize) -> Self {
        let of = black_box::<f64>;
        let interval = 1.0 / 194e3;
        let density = NoiseDensity::none().on::<1>(of(1e-8)).on::<3>(of(1e-7)).on::<4>(of(1e-2));
        let process = DriftingPhasor::new(of(interval), &density);
        let series = DistanceSeries { reference_distance: of(1000.0), coefficients: [of(0.0), of(109.3)] };
        let variance = of(0.151e-3_f64.powi(2) / (2.0 * interval));
        let start = [500.0, 500.0, 0.7, 1000.0, 0.0].map(of);
        let point = PhasorDetector { series }.operating_point(&process, &start, variance);
        let lock = FixedGain::steady_state(start, &point).expect("it settles");
        let signal = (0..length)
            .map(|k| {
                let phase = 0.7 + TAU * 500.0 * interval * k as f64;
                series.capacitance(of(1000.0 + 500.0 * phase.cos()))
            })
            .collect();
        Self { scanner: System::simulated(length), process, series, variance, lock, start, signal }
    }

    /// The scanner's filter of two states.
    pub fn scanner(&self) -> Result<Outcome<f64>, FilterError> {
        cases::follow(cases::ekf(&self.scanner), &self.scanner, &self.scanner.runge_kutta(), |d| *d)
    }

    /// The same by Euler's method.
    pub fn scanner_euler(&self) -> Result<Outcome<f64>, FilterError> {
        cases::follow(cases::ekf(&self.scanner), &self.scanner, &self.scanner.euler(), |d| d.start)
    }

    /// The mirror's filter of five.
    pub fn phasor(&self) -> Result<Outcome<f64>, FilterError> {
        let readout = DriftingPhasorCapacitance { series: self.series };
        let sd = [0.01, 4e-4, 4e-5, 0.01, 2.5];
        let mut filter = Ekf::new(self.start, Covariance::from_standard_deviations(sd));
        let r = Covariance::from_variances([self.variance]);
        let mut innovations = Innovations::none();
        for y in &self.signal {
            filter.predict(&self.process, &turns(filter.mean()[2]))?;
            let innovation = filter.update(&readout, &[*y], &r)?;
            innovations.add(innovation.residual[0], innovation.covariance.get(0, 0), innovation.nis);
        }
        let p = filter.covariance();
        Ok(outcome(filter.mean(), [p.get(0, 0), p.get(1, 0), p.get(1, 1)], innovations))
    }

    /// Its phase-locked loop.
    pub fn lock(&self) -> Result<Outcome<f64>, FilterError> {
        let (detector, mut lock) = (PhasorDetector { series: self.series }, self.lock);
        let mut innovations = Innovations::none();
        for y in &self.signal {
            lock.predict(&self.process, &turns(lock.mean()[2]))?;
            let innovation = lock.update(&detector, &detector.mixed(lock.mean(), *y))?;
            innovations.add(innovation.residual[1], innovation.covariance.get(1, 1), 0.0);
        }
        let p = lock.filtered_covariance();
        Ok(outcome(lock.mean(), [p.get(0, 0), p.get(1, 0), p.get(1, 1)], innovations))
    }
}

/// One, where the phase has passed π.
fn turns(phase: f64) -> f64 {
    if phase > PI { 1.0 } else { 0.0 }
}

fn outcome(mean: &[f64; 5], covariance: [f64; 3], innovations: Innovations<f64>) -> Outcome<f64> {
    Outcome { mean: [mean[0], mean[2]], covariance, innovations: Some(innovations) }
}
