//! What can be said of the stage before anything is recorded.

use super::hardware::StageHardware;
use crate::config::{DriveSource, Experiment};
use crate::inspect::quantity;
use crate::outlook::OutlookTopic;
use crate::simulate::SimulateError;
use kalmems_core::Portable;
use std::f64::consts::TAU;

/// The resonance, what each electrode says of a motion, and the angles at which an outer and an inner one balance.
pub fn topics(experiment: &Experiment) -> Result<Vec<OutlookTopic>, SimulateError> {
    let hardware = StageHardware::of(experiment)?;
    let mut topics = vec![resonance(&hardware)];
    if let Some(DriveSource::Sine(sine)) = experiment.simulate.as_ref().map(|simulate| &simulate.drive) {
        topics.push(driven(&hardware, sine.amplitude.si(), sine.frequency.si()));
    }
    topics.push(electrodes(&hardware));
    topics.push(thresholds(&hardware));
    Ok(topics)
}

fn resonance(hardware: &StageHardware) -> OutlookTopic {
    let resonator = &hardware.stage.resonator;
    let hz = hardware.natural_hz();
    let quality = 0.5 / resonator.damping_ratio;
    let (re, im) = hardware.stage.response(resonator.natural_rate);
    let peak = resonator.natural_rate * re.portable_hypot(im);
    OutlookTopic::new("Resonance").with(
        "resonance_hz_quality_rad_per_s_per_v",
        [hz, quality, peak],
        format!(
            "The stage tilts at {} with Q = {quality:.1}; there a drive of 1 V turns it at up to {peak:.2} rad/s.",
            quantity(hz, "Hz")
        ),
    )
}

/// The clearance over the gap from which on a motion is said to come near contact.
const NEAR: f64 = 0.2;

fn driven(hardware: &StageHardware, volts: f64, frequency_hz: f64) -> OutlookTopic {
    let rate = TAU * frequency_hz;
    let (re, im) = hardware.stage.response(rate);
    let angle = volts * re.portable_hypot(im);
    let mut topic = OutlookTopic::new("Under the drive").with(
        "motion_rad_and_rad_per_s",
        [angle, angle * rate],
        format!(
            "{volts} V at {} tilt it by {:.4} mrad, and turn it at up to {:.2} rad/s.",
            quantity(frequency_hz, "Hz"),
            1e3 * angle,
            angle * rate
        ),
    );
    for channel in &hardware.channels {
        let plate = channel.current.plate;
        let clearance = plate.clearance(0.0, angle).min(plate.clearance(0.0, -angle)) / plate.gap;
        if clearance < NEAR {
            let words = if clearance > 0.0 {
                format!("Electrode {} comes to {:.0} % of its gap.", channel.name, 100.0 * clearance)
            } else {
                format!("Electrode {} is touched: lower the drive.", channel.name)
            };
            topic = topic.with("clearance_of_gap", [clearance], words);
        }
    }
    topic
}

fn electrodes(hardware: &StageHardware) -> OutlookTopic {
    let mut topic = OutlookTopic::new("What the electrodes say");
    for channel in &hardware.channels {
        let per_rate = channel.current.gain * channel.current.plate.slope(0.0);
        let mut words = format!("{}: {:.2} uV per rad/s at a small angle", channel.name, 1e6 * per_rate);
        let mut numbers = vec![per_rate];
        if let Some(variance) = channel.noise_variance {
            let noise = variance.sqrt() / per_rate.abs();
            numbers.push(noise);
            words += &format!("; a sample's noise is {noise:.3} rad/s");
        }
        topic = topic.with("sensitivity_v_s_per_rad", numbers, words + ".");
    }
    topic
}

/// An angle in rad that is none: thousands of times less than the stage moves.
const AT_REST: f64 = 1e-7;

/// The angles at which the capacitances of electrodes on different sides of the axis are equal.
fn thresholds(hardware: &StageHardware) -> OutlookTopic {
    let mut topic = OutlookTopic::new("Threshold angles");
    for (i, one) in hardware.channels.iter().enumerate() {
        for other in &hardware.channels[i + 1..] {
            let (a, b) = (&one.current.plate, &other.current.plate);
            if (a.slope(0.0) > 0.0) == (b.slope(0.0) > 0.0) {
                continue;
            }
            // A pair that balances at rest, as equal ones do, has no angle of its own.
            if let Some(angle) = a.balance(b).filter(|angle| angle.abs() > AT_REST) {
                topic = topic.with(
                    "threshold_rad",
                    [angle],
                    format!(
                        "{} and {} have the same capacitance at {:+.4} mrad.",
                        one.name,
                        other.name,
                        1e3 * angle
                    ),
                );
            }
        }
    }
    topic
}
