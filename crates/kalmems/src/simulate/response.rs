//! Amplitudes of a driven motion: over the drive's frequency, and from a small start.

use super::{Drive, Simulator};
use kalmems_core::Dynamics;

/// How to hold each frequency of a [`stepped_sweep`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SweepSettings {
    /// The offset of the drive in V.
    pub offset: f64,
    /// Its amplitude in V.
    pub amplitude: f64,
    /// How many periods of the drive each frequency is held; the last tenth is judged.
    pub periods: u32,
    /// Integration steps per period.
    pub steps_per_period: u32,
    /// What keeps a device from lying perfectly still, in rad: at each new frequency the motion is at least this
    /// large.
    pub disturbance: f64,
}

/// The amplitude of the motion at one drive frequency.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SweepPoint {
    /// The frequency of the drive.
    pub drive_hz: f64,
    /// The largest deflection in the judged time, in the unit of the first state.
    pub amplitude: f64,
}

/// The amplitude at each of these frequencies of a sine drive, in their order, each from the motion before.
///
/// Slow sweeps up and down differ where a device has two steady motions at one frequency. Frequencies change
/// when the drive's phase is 0, so that the drive has no jump.
pub fn stepped_sweep<D: Dynamics<f64, 2, Input = f64> + Copy>(
    dynamics: D,
    frequencies_hz: impl IntoIterator<Item = f64>,
    settings: &SweepSettings,
) -> Vec<SweepPoint> {
    let SweepSettings { offset, amplitude, periods, steps_per_period, disturbance } = *settings;
    let steps = periods * steps_per_period;
    let mut state = [disturbance, 0.0];
    frequencies_hz
        .into_iter()
        .map(|drive_hz| {
            let drive = Drive::Sine { offset, amplitude, frequency_hz: drive_hz, phase_rad: 0.0 };
            let rate_hz = drive_hz * f64::from(steps_per_period);
            let mut simulator = Simulator::new(dynamics, drive, rate_hz, state);
            let mut largest = 0.0_f64;
            for step in 0..steps {
                simulator.step();
                if step >= steps - steps / 10 {
                    largest = largest.max(simulator.state()[0].abs());
                }
            }
            state = if largest < disturbance { [disturbance, 0.0] } else { *simulator.state() };
            SweepPoint { drive_hz, amplitude: largest }
        })
        .collect()
}

/// How a motion started.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StartUp {
    /// When the motion first reached nine tenths of its final amplitude.
    pub time_s: f64,
    /// The final amplitude, in the unit of the first state.
    pub amplitude: f64,
}

/// Starts a device from a small displacement and waits until `limit_s`. `None` where it is not ten times as large
/// then.
///
/// The final amplitude is the largest deflection in the last tenth of the time.
pub fn start_up<D: Dynamics<f64, 2, Input = f64> + Copy>(
    dynamics: D,
    drive: &Drive,
    displacement: f64,
    rate_hz: f64,
    limit_s: f64,
) -> Option<StartUp> {
    let run = || Simulator::new(dynamics, drive.clone(), rate_hz, [displacement, 0.0]);
    let mut simulator = run();
    let mut amplitude = 0.0_f64;
    while simulator.time_s() < limit_s {
        simulator.step();
        if simulator.time_s() >= 0.9 * limit_s {
            amplitude = amplitude.max(simulator.state()[0].abs());
        }
    }
    if amplitude.is_nan() || amplitude < 10.0 * displacement.abs() {
        return None;
    }
    let mut again = run();
    while again.state()[0].abs() < 0.9 * amplitude {
        again.step();
    }
    Some(StartUp { time_s: again.time_s(), amplitude })
}
