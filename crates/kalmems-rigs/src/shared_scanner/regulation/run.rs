//! The run itself, sample by sample.

use super::super::past::DelayedState;
use super::super::simulation::SIGNAL_NOISE;
use super::design::{MOST, Regulation};
use super::drift::Drifted;
use super::files;
use super::observer::{RegulationObserver, STATES};
use super::report::{RegulationReport, RegulationWindow, TriggerCheck};
use crate::config::{ConfigFault, Experiment};
use crate::signal::hermite;
use crate::simulate::{
    Converter, SimulateError, SimulatedColumn, SimulatedSample, Simulation, SimulationFiles, WhiteNoise,
};
use kalmems_core::Portable;
use kalmems_core::{Ekf, Filter, Measurement, Process, ProcessNoise, Rk4};
use kalmems_models::control::{Mark, Oscillator, Regulator, RegulatorStage, Trigger};
use kalmems_models::dynamics::ParametricScanner;
use std::f64::consts::PI;
use std::ops::ControlFlow;
use std::sync::OnceLock;

/// A scanner, its readout, a filter and a regulator in one loop.
///
/// At each sample the signal is read, the filter takes it, and the regulator says from the estimate what the drive does
/// from the next sample on: a whole interval is left to compute in. The filter is told the signal and the commanded drive,
/// and nothing else.
pub struct RegulatedSimulation {
    regulation: Regulation,
    observer: RegulationObserver,
    sampling_rate_hz: f64,
    steps_per_sample: u64,
    samples: u64,
    noise: f64,
    seed: u64,
    converter: Option<Converter>,
    report: OnceLock<RegulationReport>,
}

/// How long a window of the report is, in cycles of the motion.
const WINDOW_CYCLES: f64 = 16.0;

impl RegulatedSimulation {
    /// Reads and checks what the file says.
    pub fn of(experiment: &Experiment) -> Result<Self, SimulateError> {
        let regulation = Regulation::of(experiment)?;
        let Some(simulate) = &experiment.simulate else {
            let remedy = "add the table `[simulate]`".to_owned();
            return Err(experiment.error("simulate", ConfigFault::MissingKey { remedy }).into());
        };
        let interval_s = 1.0 / simulate.sampling_rate.si();
        let observer = regulation.observer(interval_s).map_err(|why| {
            let why = format!("the filter cannot be made: {why}");
            experiment.error("simulate.drive.regulated.filter", ConfigFault::Value { why })
        })?;
        Ok(Self {
            observer,
            noise: if simulate.noise { regulation.hardware.noise_variance.sqrt() } else { 0.0 },
            regulation,
            sampling_rate_hz: simulate.sampling_rate.si(),
            steps_per_sample: simulate.steps_per_sample(),
            samples: simulate.samples(),
            seed: simulate.seed,
            converter: simulate.adc.as_ref().map(Converter::of),
            report: OnceLock::new(),
        })
    }

    /// The design that it runs by.
    pub fn regulation(&self) -> &Regulation {
        &self.regulation
    }

    /// Runs it, and says what the run was like.
    pub fn regulate(
        &self,
        each: &mut dyn FnMut(&SimulatedSample) -> ControlFlow<()>,
    ) -> Result<RegulationReport, SimulateError> {
        let Regulation { hardware, settings, .. } = &self.regulation;
        let h = 1.0 / self.sampling_rate_hz;
        let mut observer = self.observer.clone();
        let mut regulator = Regulator::new(*settings);
        let mut witness = RegulationMonitor::new(&self.regulation, h);
        let mut noise = WhiteNoise::new(self.seed, SIGNAL_NOISE);
        let mut truth = self.regulation.start;
        let mut past = DelayedState::new(
            &truth,
            hardware.delay_s * self.sampling_rate_hz * self.steps_per_sample as f64,
        );
        let mut held: Option<Oscillator<f64>> = None;
        for k in 0..self.samples {
            let time_s = k as f64 * h;
            if !truth.iter().all(|x| x.is_finite()) {
                return Err(SimulateError::NotFinite { time_s });
            }
            let drifted = self.regulation.drift.map_or_else(Drifted::default, |drift| drift.at(time_s));
            let drive = held.unwrap_or(*regulator.drive());
            let [clean] = drifted.readout(hardware).predict(&past.state());
            let analogue = clean + self.noise * noise.sample();
            let signal = self.converter.map_or(analogue, |converter| converter.round(analogue));
            let sample = SimulatedSample { time_s, recorded: &[drive.voltage(), signal], truth: &truth };
            if each(&sample).is_break() {
                return Err(SimulateError::Interrupted);
            }

            let estimate = observer.step(signal, &drive).copied();
            if held.is_none() {
                regulator.step(estimate.map(|filter| [filter.mean()[0], filter.mean()[1]]));
                if self.regulation.hold_from_s.is_some_and(|from_s| time_s + h >= from_s) {
                    held = Some(*regulator.drive());
                }
            } else if let Some(held) = &mut held {
                held.advance(h);
            }
            let before = truth;
            advance(&drifted.scanner(hardware), &drive, &mut truth, (h, self.steps_per_sample), &mut past);
            let seen = ObservedSample { time_s, truth: [before, truth], drive: &drive, drifted: &drifted };
            witness.see(&seen, estimate.as_ref(), &observer, &regulator);
            observer.predict(&drive.nodes(h));
        }
        Ok(witness.into_report(&observer, &regulator))
    }
}

/// The true device over one sample.
fn advance(
    scanner: &ParametricScanner<f64>,
    drive: &Oscillator<f64>,
    state: &mut [f64; 2],
    (interval_s, steps): (f64, u64),
    past: &mut DelayedState<2>,
) {
    let h = interval_s / steps as f64;
    let process = Rk4::with_noise(*scanner, h, ProcessNoise::none());
    let mut drive = *drive;
    for _ in 0..steps {
        *state = process.step(state, &drive.nodes(h));
        past.push(state);
        drive.advance(h);
    }
}

impl Simulation for RegulatedSimulation {
    fn recorded(&self) -> &[SimulatedColumn] {
        &[
            SimulatedColumn { meaning: "drive", column: "drive_V" },
            SimulatedColumn { meaning: "signal", column: "cap_V" },
        ]
    }

    fn truth(&self) -> &[SimulatedColumn] {
        &SimulatedColumn::ANGLE_AND_RATE
    }

    fn samples(&self) -> u64 {
        self.samples
    }

    fn outlook(&self) -> Option<String> {
        Some(self.regulation.to_string())
    }

    fn run(&self, each: &mut dyn FnMut(&SimulatedSample) -> ControlFlow<()>) -> Result<(), SimulateError> {
        let report = self.regulate(each)?;
        // Every run gives the same: the first one's is that of all.
        let _ = self.report.set(report);
        Ok(())
    }

    fn files(&self) -> SimulationFiles {
        self.report.get().map_or_else(SimulationFiles::default, files::of)
    }
}

/// What there is to see at one sample.
struct ObservedSample<'a> {
    time_s: f64,
    /// The true state there and at the next sample.
    truth: [[f64; 2]; 2],
    drive: &'a Oscillator<f64>,
    drifted: &'a Drifted,
}

/// Keeps what the report will say. It sees the truth, and nothing of it goes back.
struct RegulationMonitor {
    report: RegulationReport,
    interval_s: f64,
    length: u32,
    trigger: Option<(Trigger<f64>, f64)>,
    /// An event that is told and has not happened: when it was told and will be, its sd, and the sign that the estimate has
    /// against the truth.
    waiting: Option<(TriggerCheck, f64)>,
    within: u32,
    sums: [f64; 2],
    begun: RegulationWindow,
    /// The place among the filter's states of stiffness, damping, gain and offset.
    places: [Option<usize>; 4],
}

impl RegulationMonitor {
    fn new(regulation: &Regulation, interval_s: f64) -> Self {
        let cycle_s = 2.0 / regulation.motion.drive_hz;
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // some hundreds
        let length = (WINDOW_CYCLES * cycle_s / interval_s).round() as u32;
        let tracked = &regulation.filter.basics.tracked;
        let place = |name: &str| {
            let at = tracked.iter().position(|tracked| tracked.parameter.name == name);
            at.filter(|at| *at < MOST).map(|at| 2 + at)
        };
        let rising = |trigger: Trigger<f64>| {
            let sign = if trigger.mark() == Mark::Falling { -1.0 } else { 1.0 };
            (trigger, sign)
        };
        Self {
            report: RegulationReport {
                wanted_amplitude: regulation.motion.amplitude,
                wanted_phase: regulation.motion.phase,
                held_from_s: regulation.hold_from_s,
                ..RegulationReport::default()
            },
            interval_s,
            length,
            trigger: regulation.trigger.map(rising),
            waiting: None,
            within: 0,
            sums: [0.0; 2],
            begun: RegulationWindow::default(),
            places: ["stiffness", "damping", "gain", "offset"].map(place),
        }
    }

    fn see(
        &mut self,
        seen: &ObservedSample,
        estimate: Option<&Ekf<f64, STATES>>,
        observer: &RegulationObserver,
        regulator: &Regulator<f64>,
    ) {
        let regulated = regulator.stage() == RegulatorStage::Regulated;
        if regulated && self.report.regulated_from_s.is_none() {
            self.report.regulated_from_s = Some(seen.time_s);
        }
        if let Some(estimate) = estimate {
            self.trigger(seen, estimate, observer);
        }
        if self.within == 0 {
            self.begun.regulated = self.report.regulated_from_s.is_some();
        }
        let window = (PI * (f64::from(self.within) + 0.5) / f64::from(self.length)).portable_sin().powi(2);
        let [angle, _] = seen.truth[0];
        // The mean of sin² is ½, of the angle times the cosine half the amplitude.
        let weight = 4.0 / f64::from(self.length) * window;
        self.sums[0] += weight * angle * seen.drive.phase.portable_cos();
        self.sums[1] += weight * angle * seen.drive.phase.portable_sin();
        self.within += 1;
        if self.within == self.length / 2 {
            let Drifted { temperature_k, stiffness, damping, gain, offset_v } = *seen.drifted;
            self.begun.time_s = seen.time_s;
            self.begun.temperature_k = temperature_k;
            self.begun.true_parameters = [stiffness, damping, gain, offset_v];
            self.begun.estimated_parameters = self.places.map(|place| match (place, estimate) {
                (Some(place), Some(filter)) => filter.mean()[place],
                _ => f64::NAN,
            });
            self.begun.estimated_amplitude = regulator.amplitude();
            self.begun.estimated_phase = regulator.phase();
            self.begun.drive_hz = seen.drive.rate / PI;
            self.begun.voltage = seen.drive.amplitude;
        }
        if self.within == self.length {
            let [cosine, sine] = self.sums;
            self.begun.amplitude = cosine.portable_hypot(sine);
            // The motion and its mirror image are one; the phase is that nearest to what is wanted.
            let off = sine.portable_atan2(cosine) - self.report.wanted_phase;
            self.begun.phase = self.report.wanted_phase + off - PI * (off / PI).round();
            self.report.windows.push(self.begun);
            (self.within, self.sums) = (0, [0.0; 2]);
        }
    }

    fn trigger(&mut self, seen: &ObservedSample, estimate: &Ekf<f64, STATES>, observer: &RegulationObserver) {
        let Some((trigger, direction)) = &mut self.trigger else { return };
        let onward = (observer.process(), &(*seen.drive, self.interval_s));
        let covariance = estimate.covariance();
        let [before, after] = seen.truth;
        if let Some(event) = trigger.step(&onward, (estimate.mean(), &covariance)) {
            // Of a mirrored estimate the truth passes on the other way.
            let same = estimate.mean()[1] * before[1] > 0.0;
            let way = if same { *direction } else { -*direction };
            let check = TriggerCheck {
                told_s: seen.time_s,
                after_s: event.crossing.after,
                sd_s: event.crossing.sd,
                error_s: f64::NAN,
            };
            self.waiting = Some((check, way));
        }
        if let Some((check, way)) = self.waiting
            && way * before[0] < 0.0
            && way * after[0] >= 0.0
        {
            let into = passage(before, after, self.interval_s);
            let happened_s = seen.time_s - check.told_s + into * self.interval_s;
            self.report.events.push(TriggerCheck { error_s: check.after_s - happened_s, ..check });
            self.waiting = None;
        }
    }

    fn into_report(mut self, observer: &RegulationObserver, regulator: &Regulator<f64>) -> RegulationReport {
        self.report.sweeps_again = regulator.sweeps_again();
        self.report.losses = observer.losses();
        self.report.marks_missed = self.trigger.map_or(0, |(trigger, _)| trigger.missed());
        self.report.judged()
    }
}

/// The share of the interval after which the angle passes 0, by the cubic of angles and rates.
fn passage(before: [f64; 2], after: [f64; 2], interval_s: f64) -> f64 {
    let (mut low, mut high) = (0.0_f64, 1.0_f64);
    let at = |s: f64| hermite((before[0], before[1]), (after[0], after[1]), interval_s, s);
    for _ in 0..50 {
        let middle = low.midpoint(high);
        if (at(middle) < 0.0) == (before[0] < 0.0) { low = middle } else { high = middle }
    }
    low
}
