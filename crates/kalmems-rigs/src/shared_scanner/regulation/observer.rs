//! The filter that observes the scanner while it runs.

use super::super::line::amplitude_of;
use super::super::settings::ScannerHardware;
use super::design::MOST;
use super::filter::ObserverFilter;
use crate::estimate::DeviceParameter;
use kalmems_core::Portable;
use kalmems_core::augmentation::AugmentationError;
use kalmems_core::{
    AddedState, Augmented, AugmentedMeasurement, Covariance, Drift, Ekf, Etdrk4, Filter, Nodes, NoiseDensity,
};
use kalmems_models::control::{Complex, Oscillator};
use kalmems_models::dynamics::DriveGain;
use kalmems_models::readout::DelayedComb;
use std::f64::consts::TAU;

/// Angle, rate and the parameters that are tracked; where there are fewer, states that stay 0.
pub const STATES: usize = 2 + MOST;
/// The process of the filter.
pub type ObserverProcess = Augmented<Etdrk4<DriveGain<f64>, f64, 2>, f64, 2, MOST, STATES>;

/// An extended Kalman filter that takes one sample after the other, and finds its own start.
///
/// As long as there is no estimate, the signal is projected on the drive's oscillator, half a hundred cycles at a time. A
/// component of the size that a large enough motion makes gives amplitude and phase to start from, as the lock-in
/// has them. The estimate is told after the filter has settled. Where the innovations say that it has lost the motion, it
/// looks for a start again.
#[derive(Clone, Debug)]
pub struct RegulationObserver {
    process: ObserverProcess,
    readout: AugmentedMeasurement<DelayedComb<f64>, f64, 2, MOST>,
    noise: Covariance<f64, 1>,
    hardware: ScannerHardware,
    start_sd: [f64; STATES],
    least_amplitude: f64,
    stage: ObserverStage,
    window: ObserverWindow,
    /// How many samples it takes.
    window_samples: u32,
    losses: u32,
}

#[derive(Clone, Copy, Debug)]
// One per loop, and no allocation while it runs.
#[allow(clippy::large_enum_variant)]
enum ObserverStage {
    /// Until a motion shows.
    Waiting,
    /// So many samples until its estimate is told.
    Following { filter: Ekf<f64, STATES>, settling: u32 },
}

/// Sums over a window of samples.
#[derive(Clone, Copy, Debug, Default)]
struct ObserverWindow {
    samples: u32,
    signal: f64,
    product: [f64; 2],
    reference: [f64; 2],
    nis: f64,
}

/// Cycles of the motion in a window.
const WINDOW_CYCLES: f64 = 48.0;
/// A mean NIS over a window from which the motion counts as lost: of 3000 samples it is 1 ± 0.03 in a filter that is right.
const LOST_NIS: f64 = 4.0;

impl RegulationObserver {
    /// Before the first sample, at this interval; it starts from motions of at least this amplitude in rad.
    pub fn new(
        hardware: &ScannerHardware,
        filter: &ObserverFilter,
        interval_s: f64,
        least_amplitude: f64,
    ) -> Result<Self, AugmentationError> {
        let tracked = &filter.basics.tracked;
        let none = AddedState { scale: 1.0, drift: Drift::RandomWalk { density: 0.0 } };
        let added = std::array::from_fn(|i| tracked.get(i).map_or(none, |tracked| tracked.added));
        let enters = |place: fn(&DeviceParameter) -> Option<&'static str>| {
            std::array::from_fn(|i| tracked.get(i).and_then(|tracked| place(tracked.parameter)))
        };
        let dynamics = DriveGain { scanner: hardware.scanner, drive_gain: 1.0 };
        let noise = NoiseDensity::none().on::<1>(filter.acceleration_density);
        let process = Augmented::new(
            Etdrk4::new(dynamics, interval_s, &noise, (&[0.0; 2], &0.0)),
            &added,
            enters(|parameter| parameter.in_motion),
        )?;
        let readout = AugmentedMeasurement::new(
            hardware.late_readout(),
            &added,
            enters(|parameter| parameter.in_readout),
        )?;
        let window = WINDOW_CYCLES * TAU / hardware.scanner.resonator.natural_rate() / interval_s;
        let mut start_sd = [0.0; STATES];
        let of_parameters = tracked.iter().map(|tracked| tracked.sd);
        for (slot, sd) in start_sd.iter_mut().zip(filter.start_sd.into_iter().chain(of_parameters)) {
            *slot = sd;
        }
        Ok(Self {
            process,
            readout,
            noise: Covariance::from_variances([hardware.noise_variance]),
            hardware: *hardware,
            start_sd,
            least_amplitude,
            stage: ObserverStage::Waiting,
            window: ObserverWindow::default(),
            #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // some thousands
            window_samples: window.round() as u32,
            losses: 0,
        })
    }

    /// The process that it predicts with.
    pub fn process(&self) -> &ObserverProcess {
        &self.process
    }

    /// How often it has lost a motion.
    pub fn losses(&self) -> u32 {
        self.losses
    }

    /// One sample in V under this drive: the estimate, where there is one.
    pub fn step(&mut self, signal: f64, drive: &Oscillator<f64>) -> Option<&Ekf<f64, STATES>> {
        let window = self.window_samples;
        self.window.add(signal, drive);
        let full = self.window.samples >= window;
        match &mut self.stage {
            ObserverStage::Waiting => {
                if full {
                    let found = self.window.motion(&self.hardware, drive);
                    self.window = ObserverWindow::default();
                    if let Some((amplitude, mean)) = found
                        && amplitude > self.least_amplitude
                    {
                        let covariance = Covariance::from_standard_deviations(self.start_sd);
                        let filter = Ekf::new(mean, covariance);
                        self.stage = ObserverStage::Following { filter, settling: window };
                    }
                }
            }
            ObserverStage::Following { filter, settling } => {
                let updated = filter.update(&self.readout, &[signal], &self.noise);
                let lost = match updated {
                    Ok(innovation) => {
                        self.window.nis += innovation.nis;
                        let lost = full && *settling == 0 && self.window.nis > LOST_NIS * f64::from(window);
                        if full {
                            self.window = ObserverWindow::default();
                        }
                        lost
                    }
                    Err(_) => true,
                };
                *settling = settling.saturating_sub(1);
                if lost {
                    self.lose();
                }
            }
        }
        match &self.stage {
            ObserverStage::Following { filter, settling: 0 } => Some(filter),
            _ => None,
        }
    }

    /// To the next sample.
    pub fn predict(&mut self, drive: &Nodes<f64>) {
        if let ObserverStage::Following { filter, .. } = &mut self.stage
            && filter.predict(&self.process, drive).is_err()
        {
            self.lose();
        }
    }

    fn lose(&mut self) {
        self.losses += 1;
        self.stage = ObserverStage::Waiting;
        self.window = ObserverWindow::default();
    }
}

impl ObserverWindow {
    fn add(&mut self, signal: f64, drive: &Oscillator<f64>) {
        let turned = Complex::turned(2.0 * drive.phase);
        self.samples += 1;
        self.signal += signal;
        for (i, part) in [turned.re, turned.im].into_iter().enumerate() {
            self.product[i] += signal * part;
            self.reference[i] += part;
        }
    }

    /// Amplitude and state of the motion at the end of the window. The signal a·C(θ) of θ = A·cos β has the component
    /// 2a·C₀·e^{−z}·I₁(z)·cos 2β.
    fn motion(&self, hardware: &ScannerHardware, drive: &Oscillator<f64>) -> Option<(f64, [f64; STATES])> {
        let count = f64::from(self.samples);
        let mean = self.signal / count;
        let component = [0, 1].map(|i| 2.0 * (self.product[i] - mean * self.reference[i]) / count);
        let readout = &hardware.readout;
        let full = 2.0 * readout.gain * readout.comb.nominal;
        // K·cos(2α − 2φ − 2ωτ) of a sign that the gain has.
        let component = Complex { re: component[0] / full, im: component[1] / full };
        let amplitude = amplitude_of(component.size(), &readout.comb)?;
        let lag = 0.5 * component.angle() - drive.rate * hardware.delay_s;
        let phase = drive.phase - lag;
        let mut state = [0.0; STATES];
        (state[0], state[1]) =
            (amplitude * phase.portable_cos(), -amplitude * drive.rate * phase.portable_sin());
        Some((amplitude, state))
    }
}
