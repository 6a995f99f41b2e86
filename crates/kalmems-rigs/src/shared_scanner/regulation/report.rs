//! What a regulated run was like, as the truth has it.

use serde::Serialize;

/// A run in the loop.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct RegulationReport {
    /// A* in rad.
    pub wanted_amplitude: f64,
    /// φ* in rad.
    pub wanted_phase: f64,
    /// When the regulator first said that the motion is regulated, in s; none if it never did.
    pub regulated_from_s: Option<f64>,
    /// From when on the commands were held, in s.
    pub held_from_s: Option<f64>,
    /// Sweeps that had to begin again.
    pub sweeps_again: u32,
    /// How often the filter lost the motion.
    pub losses: u32,
    /// Marks that the trigger did not tell.
    pub marks_missed: u64,
    /// The run, a window at a time.
    #[serde(skip)]
    pub windows: Vec<RegulationWindow>,
    /// The events of the trigger.
    #[serde(skip)]
    pub events: Vec<TriggerCheck>,
    /// The errors from the first regulated sample on; none if there was no such.
    pub worst: Option<WorstErrors>,
    /// The trigger's times against the true ones.
    pub trigger: Option<TriggerErrors>,
}

/// A short stretch of a run: the true motion as the fundamental of the angle on the drive's phase, under a Hann window.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct RegulationWindow {
    /// Its middle, in s.
    pub time_s: f64,
    /// The true amplitude in rad.
    pub amplitude: f64,
    /// The true phase against the drive in rad.
    pub phase: f64,
    /// The amplitude as the regulator has it, in rad; 0 while there is no estimate.
    pub estimated_amplitude: f64,
    /// The phase as the regulator has it, in rad.
    pub estimated_phase: f64,
    /// The drive's frequency.
    pub drive_hz: f64,
    /// The amplitude of the drive's sine in V.
    pub voltage: f64,
    /// The change of temperature in K.
    pub temperature_k: f64,
    /// What it has done to stiffness, damping and gain, relative, and to the offset in V.
    pub true_parameters: [f64; 4],
    /// What the filter says of the same; not a number where it does not track it.
    pub estimated_parameters: [f64; 4],
    /// Whether the regulator had called the motion regulated by its begin.
    pub regulated: bool,
}

/// An event of the trigger.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct TriggerCheck {
    /// When it was told, in s.
    pub told_s: f64,
    /// How long after that it was to happen, in s.
    pub after_s: f64,
    /// The standard deviation of that.
    pub sd_s: f64,
    /// Told less true, in s.
    pub error_s: f64,
}

/// The errors of the true motion against what was wanted.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct WorstErrors {
    /// The largest of the amplitude, relative.
    pub amplitude: f64,
    /// Their root mean square.
    pub amplitude_rms: f64,
    /// The largest of the phase in rad.
    pub phase: f64,
    /// Their root mean square.
    pub phase_rms: f64,
}

/// The errors of the trigger's times.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct TriggerErrors {
    /// How many.
    pub events: usize,
    /// Their mean in s.
    pub mean_s: f64,
    /// Their root mean square in s.
    pub rms_s: f64,
    /// The mean of (error/sd)², 1 where sd is right.
    pub nees: f64,
}

impl RegulationReport {
    /// Adds up what is judged.
    #[must_use]
    pub(super) fn judged(mut self) -> Self {
        let judged: Vec<[f64; 2]> = (self.windows.iter().filter(|window| window.regulated))
            .map(|window| [window.amplitude / self.wanted_amplitude - 1.0, window.phase - self.wanted_phase])
            .collect();
        let over = |i: usize| {
            let largest = judged.iter().map(|error| error[i].abs()).fold(0.0, f64::max);
            let square = judged.iter().map(|error| error[i].powi(2)).sum::<f64>() / judged.len() as f64;
            (largest, square.sqrt())
        };
        if !judged.is_empty() {
            let ((amplitude, amplitude_rms), (phase, phase_rms)) = (over(0), over(1));
            self.worst = Some(WorstErrors { amplitude, amplitude_rms, phase, phase_rms });
        }
        if !self.events.is_empty() {
            let count = self.events.len() as f64;
            let mean = |of: &dyn Fn(&TriggerCheck) -> f64| self.events.iter().map(of).sum::<f64>() / count;
            self.trigger = Some(TriggerErrors {
                events: self.events.len(),
                mean_s: mean(&|event| event.error_s),
                rms_s: mean(&|event| event.error_s.powi(2)).sqrt(),
                nees: mean(&|event| (event.error_s / event.sd_s).powi(2)),
            });
        }
        self
    }
}
