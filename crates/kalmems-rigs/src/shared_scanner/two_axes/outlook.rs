//! What can be said of both axes before anything is recorded.

use super::band_plan::{BandPlan, PlannedDrive};
use super::hardware::TwoAxisHardware;
use crate::config::Experiment;
use crate::outlook::{Outlook, OutlookTopic};
use crate::simulate::{SimulateError, drive_of};

/// The resonances under the drive, whether each axis starts, and which lines come near which bands.
pub fn outlook(experiment: &Experiment, of_equations: Outlook) -> Result<Outlook, SimulateError> {
    let hardware = TwoAxisHardware::of(experiment)?;
    let drive = experiment.simulate.as_ref().map(|simulate| drive_of(experiment, simulate)).transpose()?;
    let planned = drive.and_then(|(drive, _)| PlannedDrive::of(&drive));
    let topic = match planned.map(|drive| BandPlan::of(&hardware.scanner, &drive, BandPlan::GUARD_HZ)) {
        Some(plan) => planned_topic(&plan),
        None => OutlookTopic::new("Drive").with(
            "drive",
            [],
            "The experiment states no drive of two sines, and a recorded one is not taken apart here: add the table `[simulate.drive.tones]`.",
        ),
    };
    let sign = "The sign of each motion is not observable: with θ of either axis also −θ moves the device and reads \
                the same. It is calibrated once for each axis.";
    let mut topics = vec![topic, OutlookTopic::new("What the signal determines").with("sign", [], sign)];
    topics.extend(of_equations.topics);
    Ok(Outlook::of(experiment, "shared_scanner with a second axis", topics))
}

fn planned_topic(plan: &BandPlan) -> OutlookTopic {
    let [x, y] = plan.resonance_hz.map(|hz| hz / 1e3);
    let topic = OutlookTopic::new("Drive").with(
        "resonance_hz",
        plan.resonance_hz,
        format!("Resonances at rest under both drives: x {x:.3} kHz, y {y:.3} kHz."),
    );
    plan.to_string().lines().fold(topic, |topic, line| topic.with("band_plan", [], line.trim_start()))
}
