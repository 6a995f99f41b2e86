//! What a reference of a device may know, and by which instruments.

use super::{BeamPosition, EdgeVelocity, ONE_ANGLE, ValueState};

/// The instruments whose voltage a reference may hold instead of an angle or a rate.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Instruments {
    /// The detector of a beam's position, from which an angle follows: the channel `position`.
    pub beam: Option<BeamPosition>,
    /// The vibrometer of an edge's velocity, from which a rate follows: the channel `edge_velocity`.
    pub edge: Option<EdgeVelocity>,
}

/// What a reference of a device may know: the states of an estimate that its channels can be compared with, and the
/// instruments that it may come from.
#[derive(Clone, Copy, Debug)]
pub struct ReferenceChannels {
    /// Each angle's name and that of its rate.
    pub angles: &'static [[&'static str; 2]],
    /// What is no angle; the first is what the device is for.
    pub values: &'static [ValueState],
    /// What its channels may hold instead.
    pub instruments: Instruments,
}

impl ReferenceChannels {
    /// One angle and its rate, or what these instruments make one of.
    pub const fn one_angle(instruments: Instruments) -> Self {
        Self { angles: &ONE_ANGLE, values: &[], instruments }
    }
}
