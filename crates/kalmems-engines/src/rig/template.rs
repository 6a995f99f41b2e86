//! What an experiment with a device begins from.

/// What an experiment with a device begins from, for a reader to change.
#[derive(Clone, Copy, Debug)]
pub struct Template {
    /// An experiment file with comments: its name and description, the device's tables, `[simulate]` and `[estimate]`, in this order.
    /// What it simulates, its filters estimate.
    pub text: &'static str,
    /// The channels of a recording whose motion is estimated.
    pub channels: &'static [TemplateChannel],
    /// What a recording may hold beside them that is a reference.
    pub references: &'static [TemplateChannel],
}

/// A channel that a recording of the device has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TemplateChannel {
    /// Its meaning, as in `channels` of a `[[recording]]`.
    pub meaning: &'static str,
    /// What it is, in words.
    pub what: &'static str,
    /// The unit of its values in SI.
    pub unit: &'static str,
    /// Words that the name of its column may have, in lower case.
    pub words: &'static [&'static str],
    /// Whether an estimate needs it.
    pub needed: bool,
}

impl TemplateChannel {
    /// The voltage that drives a device.
    pub const DRIVE: Self = Self::needed(
        "drive",
        ("the voltage that drives the device", "V"),
        &["drive", "actuat", "excit", "input", "vin", "vd"],
    );
    /// The output of a readout.
    pub const SIGNAL: Self =
        Self::needed("signal", ("the output of the readout", "V"), &["signal", "cap", "sens", "out", "vs"]);
    /// An angle as a reference.
    pub const ANGLE: Self =
        Self::optional("angle", ("the angle, measured otherwise", "rad"), &["angle", "theta", "tilt"]);
    /// Its rate.
    pub const RATE: Self =
        Self::optional("rate", ("the angular rate, measured otherwise", "rad/s"), &["rate", "omega"]);

    /// One that an estimate needs.
    pub const fn needed(
        meaning: &'static str,
        (what, unit): (&'static str, &'static str),
        words: &'static [&'static str],
    ) -> Self {
        Self { meaning, what, unit, words, needed: true }
    }

    /// One that a recording may lack.
    pub const fn optional(
        meaning: &'static str,
        (what, unit): (&'static str, &'static str),
        words: &'static [&'static str],
    ) -> Self {
        Self { needed: false, ..Self::needed(meaning, (what, unit), words) }
    }
}
