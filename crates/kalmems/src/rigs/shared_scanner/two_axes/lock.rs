//! Whether a filter followed both axes.

use super::tones::DriveTones;
use crate::estimate::{Lock, LockEvent, Motion, Trajectory, judge_lock};

/// Judges each axis by its own motion, and the signal that both share.
pub fn judge(trajectory: &Trajectory, signal: &[f64], tones: &DriveTones, start_s: f64) -> Lock {
    let mut events = Vec::new();
    for (axis, tone) in tones.tones.iter().enumerate() {
        let motion = Motion { frequency_hz: 0.5 * tone.frequency_hz, is_driven: true };
        let angle = &trajectory.states[2 * axis].mean;
        let (innovation, nis) = (&trajectory.innovation, &trajectory.nis);
        let lock = judge_lock(&trajectory.time_s, (angle, signal), (innovation, nis), motion, start_s);
        // The signal is one: it is lost once, as the slower axis has it.
        events.extend(
            lock.events
                .into_iter()
                .filter(|event| matches!(event, LockEvent::Flipped { .. }) || is_slower(tones, axis)),
        );
    }
    events.sort_by(|a, b| a.time_s().total_cmp(&b.time_s()));
    Lock { events }
}

fn is_slower(tones: &DriveTones, axis: usize) -> bool {
    tones.tones[axis].frequency_hz <= tones.tones[1 - axis].frequency_hz
}
