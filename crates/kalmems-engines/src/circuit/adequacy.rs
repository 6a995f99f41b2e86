//! Whether a filter may do without the poles of the demodulator, and without its delay.

use super::excitation::turned;
use super::reduced::{HARMONICS, output_harmonics};
use super::{Circuit, Complex, Excitation, ReducedCircuit, SineMotion};
use crate::signal::{Sine, fit_sine_at};
use crate::simulate::{Drive, Simulator};
use kalmems_core::{Covariance, Dynamics, Ekf, Filter, FilterError, Measurement, Nodes, NoiseDensity, Rk4};
use kalmems_models::dynamics::{DriveGain, ParametricScanner};
use kalmems_models::readout::{AngleBefore, DemodulatedComb, LowPassedComb};
use std::f64::consts::{FRAC_1_SQRT_2, PI, TAU};
use std::fmt;

/// The filter that is asked about, and what is permitted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AdequacySettings {
    /// q: the density of its angular acceleration's noise in rad²/s³.
    pub acceleration_density: f64,
    /// R: the variance that it takes a sample to have, in V².
    pub noise_variance: f64,
    /// The carrier's amplitude in V.
    pub carrier: f64,
    /// The carrier's frequency.
    pub carrier_hz: f64,
    /// The error of phase that is permitted, in degrees of the motion's cycle.
    pub permitted_phase_deg: f64,
}

/// What a filter is wrong by because its model of the circuit is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cost {
    /// How far its motion is behind the true one, in degrees of the motion's cycle.
    pub phase_deg: f64,
    /// How much its amplitude is too large, in degrees.
    pub amplitude_deg: f64,
    /// The root mean square of its angle's error, in degrees.
    pub angle_rmse_deg: f64,
}

/// What a filter knows of the circuit, the simplest first.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CircuitKnowledge {
    /// y = a·C + b.
    Affine,
    /// The same behind the poles of the two low-pass stages.
    Poles,
    /// The same of C a time ago, that of [`ReducedCircuit::front_delay_s`].
    PolesAndDelay,
}

/// Whether y = a·C + b is good enough for a filter, and if not, whether the poles are.
///
/// The device is integrated under its drive until it is steady, the circuit [`ReducedCircuit`] for that motion, and
/// extended Kalman filters that know the device exactly follow the circuit's output, without noise and
/// carrier, each knowing as much of poles and delay as [`CircuitKnowledge`] says. Their gain and offset are those of
/// [`ReducedCircuit::with_poles_and_delay`]. A small q trusts the device's model, which the drive holds in phase,
/// and is pulled less; a large one follows its signal wherever it is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Adequacy {
    /// Amplitude of the motion in degrees.
    pub amplitude_deg: f64,
    /// Frequency of the motion in Hz.
    pub motion_hz: f64,
    /// The circuit for it.
    pub reduced: ReducedCircuit,
    /// What the affine model without poles costs.
    pub affine: Cost,
    /// What the poles without the delay cost.
    pub poles: Cost,
    /// What is left with both.
    pub poles_and_delay: Cost,
    /// What was asked.
    pub setting: AdequacySettings,
}

/// Why nothing can be said.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum AdequacyError {
    /// Only a steady motion under a sine is reduced.
    #[error("only a drive that is a sine keeps a motion for which a circuit can be reduced")]
    NoSine,
    /// Nothing moves.
    #[error("the device does not come into motion at this drive within {settle_s} s")]
    NoMotion {
        /// How long it was driven.
        settle_s: f64,
    },
    /// More cycles than are worth following.
    #[error("the drive at {drive_hz:e} Hz is followed over {settle_s} s, which is more than 1e8 steps")]
    TooFast {
        /// Frequency of the drive in Hz.
        drive_hz: f64,
        /// Time to simulate in s.
        settle_s: f64,
    },
    /// The filter gave up.
    #[error("a filter fails on this signal: {0}")]
    Filter(#[from] FilterError),
}

/// Time for the device to become steady, for the filter, and what is scored, in s.
const SETTLE_S: f64 = 60e-3;
const FOLLOW_S: f64 = 12e-3;
const SCORED_S: f64 = 4e-3;

/// Steps per cycle of the drive; at 31 kHz this is 1 MHz.
const STEPS_PER_DRIVE_CYCLE: f64 = 32.0;

/// Below this the device is at rest.
const AT_REST_RAD: f64 = 1e-3;

impl Adequacy {
    /// Asks for a device that starts at `start` under `drive`.
    pub fn of(
        circuit: &Circuit,
        scanner: &ParametricScanner<f64>,
        (drive, start): (&Drive, [f64; 2]),
        setting: &AdequacySettings,
    ) -> Result<Self, AdequacyError> {
        let &Drive::Sine { offset, amplitude, frequency_hz, phase_rad } = drive else {
            return Err(AdequacyError::NoSine);
        };
        let rate_hz = STEPS_PER_DRIVE_CYCLE * frequency_hz;
        if rate_hz * (SETTLE_S + FOLLOW_S) > 1e8 {
            return Err(AdequacyError::TooFast { drive_hz: frequency_hz, settle_s: SETTLE_S + FOLLOW_S });
        }
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // positive, saturates
        let steps = |duration_s: f64| (duration_s * rate_hz).round() as usize;
        let mut simulator = Simulator::new(*scanner, drive.clone(), rate_hz, start);
        for _ in 0..steps(SETTLE_S) {
            simulator.step();
        }

        // The truth from there on, and the reduced signal of it.
        let (follow, scored) = (steps(FOLLOW_S), steps(SCORED_S));
        let truth: Vec<(f64, [f64; 2])> = (0..follow)
            .map(|_| {
                simulator.step();
                (simulator.time_s(), *simulator.state())
            })
            .collect();
        let motion_hz = 0.5 * frequency_hz;
        let time_s: Vec<f64> = truth[follow - scored..].iter().map(|(t, _)| *t).collect();
        let sine_of = |angles: &[f64]| fit_sine_at(&time_s, angles, motion_hz);
        let true_angles: Vec<f64> = truth[follow - scored..].iter().map(|(_, x)| x[0]).collect();
        let moving = sine_of(&true_angles).filter(|sine| sine.amplitude > AT_REST_RAD);
        let Some(moving) = moving else { return Err(AdequacyError::NoMotion { settle_s: SETTLE_S }) };

        // The lines count from where the drive's sine rises through its mean, and the motion is a sine, not a cosine.
        let excitation = Excitation {
            offset,
            amplitude,
            drive_hz: frequency_hz,
            carrier: setting.carrier,
            carrier_hz: setting.carrier_hz,
        };
        let motion = SineMotion {
            amplitude_rad: moving.amplitude,
            phase_rad: moving.phase_rad + 0.5 * PI - 0.5 * phase_rad,
        };
        let reduced = ReducedCircuit::of(circuit, &excitation, &scanner.comb, &motion);
        let signal = CircuitOutput {
            harmonics: output_harmonics(circuit, &excitation, &scanner.comb, &motion),
            drive_hz: frequency_hz,
            earlier_s: phase_rad / (TAU * frequency_hz),
        };
        let heard: Vec<f64> = truth.iter().map(|(t, _)| signal.at(*t)).collect();
        let cost = |known: CircuitKnowledge| -> Result<Cost, FilterError> {
            let record = MotionAndSignal { scanner, drive, truth: &truth, heard: &heard, rate_hz, setting };
            let estimated = record.by(known, &reduced)?;
            let estimated = &estimated[follow - scored..];
            // θ → −θ is the same to the filter: the nearer of both counts, and phases count modulo half a cycle.
            let squares = [1.0, -1.0].map(|sign| -> f64 {
                estimated.iter().zip(&true_angles).map(|(a, b)| (sign * a - b).powi(2)).sum()
            });
            let square = squares[0].min(squares[1]);
            let found = sine_of(estimated).unwrap_or(Sine { amplitude: 0.0, ..moving });
            let behind = (moving.phase_rad - found.phase_rad + 0.5 * PI).rem_euclid(PI) - 0.5 * PI;
            Ok(Cost {
                phase_deg: behind.to_degrees(),
                amplitude_deg: (found.amplitude - moving.amplitude).to_degrees(),
                angle_rmse_deg: (square / scored as f64).sqrt().to_degrees(),
            })
        };
        Ok(Self {
            amplitude_deg: moving.amplitude.to_degrees(),
            motion_hz,
            reduced,
            affine: cost(CircuitKnowledge::Affine)?,
            poles: cost(CircuitKnowledge::Poles)?,
            poles_and_delay: cost(CircuitKnowledge::PolesAndDelay)?,
            setting: *setting,
        })
    }

    /// What it costs to know so much.
    pub fn cost(&self, known: CircuitKnowledge) -> &Cost {
        match known {
            CircuitKnowledge::Affine => &self.affine,
            CircuitKnowledge::Poles => &self.poles,
            CircuitKnowledge::PolesAndDelay => &self.poles_and_delay,
        }
    }

    /// Whether so much will do: phase, and angle by no more than such an error of phase makes.
    ///
    /// The second catches a motion of a wrong amplitude whose phase happens to be right.
    pub fn is_adequate(&self, known: CircuitKnowledge) -> bool {
        let (cost, permitted) = (self.cost(known), self.setting.permitted_phase_deg);
        let of_angle_deg = self.amplitude_deg * permitted.to_radians() * FRAC_1_SQRT_2;
        cost.phase_deg.abs() <= permitted && cost.angle_rmse_deg <= of_angle_deg
    }

    /// The simplest model that is adequate; `None` where none is.
    pub fn needed(&self) -> Option<CircuitKnowledge> {
        [CircuitKnowledge::Affine, CircuitKnowledge::Poles, CircuitKnowledge::PolesAndDelay]
            .into_iter()
            .find(|known| self.is_adequate(*known))
    }
}

/// What the circuit gives under a steady motion.
struct CircuitOutput {
    harmonics: [Complex<f64>; HARMONICS],
    drive_hz: f64,
    earlier_s: f64,
}

impl CircuitOutput {
    fn at(&self, time_s: f64) -> f64 {
        let cycles = self.drive_hz * (time_s + self.earlier_s);
        let [mean, moving @ ..] = &self.harmonics;
        (moving.iter().enumerate()).fold(mean.re, |sum, (n, line)| {
            let (sine, cosine) = turned((n + 1) as f64 * cycles);
            sum + 2.0 * (line * Complex::new(cosine, sine)).re
        })
    }
}

/// A motion and its signal, for filters to follow.
struct MotionAndSignal<'a> {
    scanner: &'a ParametricScanner<f64>,
    drive: &'a Drive,
    truth: &'a [(f64, [f64; 2])],
    heard: &'a [f64],
    rate_hz: f64,
    setting: &'a AdequacySettings,
}

impl MotionAndSignal<'_> {
    /// The angles of a filter that knows so much.
    fn by(&self, known: CircuitKnowledge, reduced: &ReducedCircuit) -> Result<Vec<f64>, FilterError> {
        let scanner = self.scanner;
        let model = reduced.with_poles_and_delay;
        let affine = DemodulatedComb { comb: scanner.comb, gain: model.gain, offset: model.offset };
        let [angle, rate] = self.truth.first().map_or([0.0; 2], |(_, state)| *state);
        let rate_sd = TAU * 0.5 * self.rate_hz / STEPS_PER_DRIVE_CYCLE * 0.05;
        let delay_s = match known {
            CircuitKnowledge::Affine => {
                return self.angles(*scanner, &affine, ([angle, rate], [0.05, rate_sd]));
            }
            CircuitKnowledge::Poles => 0.0,
            CircuitKnowledge::PolesAndDelay => reduced.front_delay_s,
        };
        let staged = LowPassedComb {
            device: DriveGain { scanner: *scanner, drive_gain: 1.0 },
            before: AngleBefore::of(delay_s, &scanner.resonator),
            gain: model.gain,
            offset: model.offset,
            poles: reduced.poles_hz.map(|hz| TAU * hz),
        };
        let (volts, volts_sd) = (affine.voltage(angle), (model.gain * scanner.comb.nominal).abs());
        let start = ([angle, rate, volts, volts], [0.05, rate_sd, volts_sd, volts_sd]);
        self.angles(staged, &staged, start)
    }

    /// The angles of an extended Kalman filter.
    fn angles<D, H, const N: usize>(
        &self,
        dynamics: D,
        readout: &H,
        (mean, sd): ([f64; N], [f64; N]),
    ) -> Result<Vec<f64>, FilterError>
    where
        D: Dynamics<f64, N, Input = f64>,
        H: Measurement<f64, N, 1>,
    {
        let noise = NoiseDensity::none().on::<1>(self.setting.acceleration_density);
        let step = Rk4::new(dynamics, 1.0 / self.rate_hz, &noise, (&[0.0; N], &0.0));
        let variance = Covariance::from_variances([self.setting.noise_variance]);
        let mut filter = Ekf::new(mean, Covariance::from_standard_deviations(sd));
        let mut angles = Vec::with_capacity(self.truth.len());
        let half = 0.5 / self.rate_hz;
        for ((time_s, _), volts) in self.truth.iter().zip(self.heard) {
            let at = |earlier_s: f64| self.drive.at(time_s - earlier_s);
            let nodes = Nodes { start: at(2.0 * half), middle: at(half), end: at(0.0) };
            if !angles.is_empty() {
                filter.predict(&step, &nodes)?;
            }
            filter.update(readout, &[*volts], &variance)?;
            angles.push(filter.mean()[0]);
        }
        Ok(angles)
    }
}

impl fmt::Display for Cost {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:.2} deg in phase and {:+.2} deg in amplitude", self.phase_deg.abs(), self.amplitude_deg)
    }
}

impl fmt::Display for Adequacy {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let lag_deg = self.reduced.affine.lag_deg;
        write!(
            f,
            "at {:.2} deg and {:.3} kHz the circuit is {}; its signal is {lag_deg:.1} deg of the motion late, of which the \
             poles explain {:.1} deg. A filter of q = {:.0e} rad²/s³ would be wrong by {} without either, by {} with the \
             poles, by {} with poles and delay: ",
            self.amplitude_deg,
            self.motion_hz / 1e3,
            self.reduced,
            lag_deg - self.reduced.with_poles.lag_deg,
            self.setting.acceleration_density,
            self.affine,
            self.poles,
            self.poles_and_delay,
        )?;
        let permitted = self.setting.permitted_phase_deg;
        match self.needed() {
            Some(CircuitKnowledge::Affine) => {
                write!(f, "y = a·C + b is adequate ({permitted} deg permitted)")
            }
            Some(CircuitKnowledge::Poles) => write!(
                f,
                "y = a·C + b is not adequate ({permitted} deg permitted), the poles are needed as states"
            ),
            Some(CircuitKnowledge::PolesAndDelay) => write!(
                f,
                "y = a·C + b is not adequate ({permitted} deg permitted), the poles are needed as states, and the delay \
                 besides"
            ),
            None => write!(f, "none of these is adequate ({permitted} deg permitted)"),
        }
    }
}
