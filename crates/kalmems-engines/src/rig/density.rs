//! Densities of process noise that a rig's filters know.

use crate::config::ExpectedEntry;

/// The density of white noise in the rate of change of a state.
#[derive(Clone, Copy, Debug)]
pub struct StateDensity {
    /// Its name in the table `process_noise`, and what it is.
    pub entry: ExpectedEntry,
    /// What wanders by it, in words: "the rate".
    pub wanders: &'static str,
    /// The unit of what wanders, whose square by second is that of the density's example.
    pub unit: &'static str,
}

impl StateDensity {
    /// A white angular acceleration, by which an angular rate wanders.
    pub const fn angular_acceleration(entry: ExpectedEntry, wanders: &'static str) -> Self {
        Self { entry, wanders, unit: "rad/s" }
    }

    /// The unit in which it is written.
    pub fn unit_of_density(&self) -> &'static str {
        self.entry.kind.example.split_once(' ').map_or("", |(_, unit)| unit)
    }
}
