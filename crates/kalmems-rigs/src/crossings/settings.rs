//! How crossings are found, in SI.

use super::kernel::KernelWindow;
use crate::config::{Crossings, Quantity};

/// How crossings of a level are found: by the derivative of the signal averaged by a Gaussian, above a limit.
#[derive(Clone, Copy, Debug)]
pub struct DetectorSettings {
    /// The standard deviation of the Gaussian in s.
    pub width_s: f64,
    /// The least distance between crossings in s.
    pub separation_s: f64,
    /// Which responses count.
    pub acceptance: Acceptance,
}

impl DetectorSettings {
    /// What suits a device that moves with this cycle in s: in parts of it as the published detector at 625 Hz.
    pub(crate) fn usual(cycle_s: f64) -> Self {
        Self { width_s: 0.02 * cycle_s, separation_s: 0.2 * cycle_s, acceptance: Acceptance::Deviations(4.0) }
    }

    /// How many samples of this interval in s it needs around a crossing.
    pub(super) fn window(&self, interval_s: f64) -> KernelWindow {
        KernelWindow::of(self.width_s / interval_s, self.separation_s / interval_s)
    }
}

impl From<&Crossings> for DetectorSettings {
    fn from(crossings: &Crossings) -> Self {
        Self {
            width_s: crossings.width.si(),
            separation_s: crossings.separation.si(),
            acceptance: match (crossings.threshold, &crossings.false_alarms) {
                (Some(deviations), _) => Acceptance::Deviations(deviations),
                // The file was refused where it states neither.
                (None, rate) => Acceptance::FalseAlarms {
                    per_s: rate.as_ref().map_or(1.0, Quantity::si),
                    keep: crossings.keep,
                },
            },
        }
    }
}

/// Which responses of the detector count.
#[derive(Clone, Copy, Debug)]
pub enum Acceptance {
    /// From so many standard deviations of the response to noise on.
    Deviations(f64),
    /// As many as give this rate of false alarms.
    FalseAlarms {
        /// Per second of noise without motion.
        per_s: f64,
        /// The standard deviations that are enough while crossings follow each other.
        keep: Option<f64>,
    },
}
