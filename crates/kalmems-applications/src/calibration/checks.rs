//! The checks of what a calibration assumes, each of which forbids the certificate if it fails.

use serde::Serialize;

/// Defines the kinds of checks from one list, so that none of them is missing in [`CheckKind::ALL`].
macro_rules! check_kinds {
    ($($kind:ident: $what:literal,)*) => {
        /// What a check looks at.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum CheckKind {
            $(#[doc = $what] $kind,)*
        }

        impl CheckKind {
            /// All kinds.
            pub const ALL: &[Self] = &[$(Self::$kind,)*];

            const fn what(self) -> &'static str {
                match self {
                    $(Self::$kind => $what,)*
                }
            }
        }
    };
}

check_kinds! {
    RecordScatter: "the interval has what changes from record to record",
    OneScaleFactor: "one scale factor describes the records, or each frequency has its own",
    SineMotion: "the motion is a sine",
    EnoughTrials: "the trials are enough to tell whether the expanded uncertainty holds",
    References: "the scale factors agree",
    SquareReference: "the angle between the axes is that by the positions",
    BiasUnderVibration: "the bias under vibration is that at rest",
    StillAtRest: "the unit is still during the record at rest",
    Gravity: "the specific force has the magnitude of gravity in each position",
    AxesOfPositions: "the gyroscopes' axes are those of the accelerometers, with the same signs",
    RateSteps: "bias, asymmetry, a polynomial of third order and hysteresis describe the steps",
    SettledRates: "the gyroscope has settled where the steps begin",
    AxisOfTable: "the gyroscope turns with the table",
    StatedTurns: "each turn is one by the stated angle or a multiple of it",
    WholeTurns: "the integrals are near to multiples of the angle",
    AxisOfTurns: "the unit turns about the stated axis",
    FollowedReference: "the sensor follows the reference at the lowest frequency",
    ReferenceHarmonics: "the second and third harmonic of the reference are at most 5 % of it",
    StillCycle: "the unit is still during the cycle",
}

/// A check of what was assumed.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CertificateCheck {
    /// Which check it is.
    #[serde(skip)]
    pub kind: CheckKind,
    /// What is looked at, with the record or condition.
    pub what: String,
    /// Whether it passes.
    pub passes: bool,
    /// What was found.
    pub found: String,
}

impl CertificateCheck {
    /// A check of a record or a condition; `place` is empty if there is only one.
    pub(super) fn new(kind: CheckKind, place: &str, passes: bool, found: impl Into<String>) -> Self {
        let what = kind.what();
        let what = if place.is_empty() { what.to_owned() } else { format!("{place}: {what}") };
        Self { kind, what, passes, found: found.into() }
    }
}
