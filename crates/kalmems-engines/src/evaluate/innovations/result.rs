//! What a test of innovations finds.

use crate::inspect::quantity;
use serde::Serialize;

/// The probability below which a finding is not by chance: a filter that is right fails a test once in a million times.
pub const WRONG: f64 = 1e-6;

/// What is looked for in the innovations; what tells most of a cause comes first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum InnovationTest {
    /// The largest one is none of a normal distribution.
    Outlier,
    /// Their variance changes over the recording.
    Windows,
    /// The motion or a harmonic of it is in them.
    Harmonics,
    /// A single frequency stands out.
    Line,
    /// Their mean is not zero, in all or in a part of the recording.
    Level,
    /// A band of frequencies has more in it than claimed.
    Bands,
    /// Their variance changes over the cycle of the motion.
    Phase,
    /// One tells of the next.
    Whiteness,
    /// They are not normally distributed.
    Shape,
    /// Their mean square is larger than claimed.
    MeanNis,
    /// They follow what another number of the device would change in the predictions.
    Numbers,
    /// A smoother changes its filter's answer by more than the variance that it takes off it.
    Smoothing,
}

/// Where a test found what it found.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum TestPlace {
    /// At a time.
    Time {
        /// In s.
        at_s: f64,
    },
    /// In a part of the recording.
    Span {
        /// From here, in s.
        from_s: f64,
        /// To here.
        to_s: f64,
    },
    /// At a frequency.
    Frequency {
        /// In Hz.
        hz: f64,
    },
    /// In a band of frequencies.
    Band {
        /// From here, in Hz.
        from_hz: f64,
        /// To here.
        to_hz: f64,
    },
    /// At a harmonic of a motion.
    Harmonic {
        /// Which; 1 is the motion itself.
        number: usize,
        /// The frequency of the motion in Hz.
        of_hz: f64,
    },
    /// At a part of the cycle of a motion.
    Phase {
        /// Its middle, in degrees from the beginning of the segment.
        degrees: f64,
        /// The frequency of the motion in Hz.
        of_hz: f64,
    },
    /// Between innovations that are so far apart.
    Lag {
        /// In updates.
        updates: usize,
    },
    /// Along a number of the device or of the recording.
    Number {
        /// Its key below the device's table, or its description.
        name: String,
        /// By how much the innovations ask for another value, with its unit.
        by: String,
    },
    /// Of a state.
    State {
        /// Its name.
        name: &'static str,
    },
}

/// What a test of innovations found.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TestResult {
    /// What was looked for.
    #[serde(skip)]
    pub test: InnovationTest,
    /// How probable a finding as large is for a filter that is right, all places that were looked at considered.
    #[serde(serialize_with = "super::super::three_digits")]
    pub p_value: f64,
    /// How large it is.
    #[serde(serialize_with = "super::super::three_digits")]
    pub size: f64,
    /// Where it is largest.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub place: Option<TestPlace>,
    /// The signal whose innovations these are, where it is not the first one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub signal: Option<String>,
}

impl TestResult {
    /// Whether a filter that is right does not look like this.
    pub fn fails(&self) -> bool {
        self.p_value < WRONG
    }
}

impl TestResult {
    /// What was found, in a word or two with its place.
    pub fn in_short(&self) -> String {
        let at = self.place.as_ref().map_or_else(String::new, |place| format!(" {place}"));
        let of = self.signal.as_ref().map_or_else(String::new, |of| format!(" of {of}"));
        let found = match self.test {
            InnovationTest::MeanNis => format!("a mean NIS of {}", nis(self.size)),
            InnovationTest::Level => format!("a mean{at}"),
            InnovationTest::Bands => format!("too much power{at}"),
            InnovationTest::Line => format!("a line{at}"),
            InnovationTest::Harmonics => format!("the motion{at}"),
            InnovationTest::Phase => "a variance that changes over the cycle".to_owned(),
            InnovationTest::Windows => format!("another variance{at}"),
            InnovationTest::Shape => "a distribution that is not normal".to_owned(),
            InnovationTest::Outlier => format!("an outlier{at}"),
            InnovationTest::Whiteness => "correlation".to_owned(),
            InnovationTest::Numbers => format!("another value{at}"),
            InnovationTest::Smoothing => format!("changes by the smoother{at}"),
        };
        found + &of
    }
}

impl std::fmt::Display for TestResult {
    /// What was found, how probable it is for a filter that is right, and what it usually means.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { test, size, place, .. } = self;
        let at = place.as_ref().map_or_else(String::new, ToString::to_string);
        if let Some(of) = &self.signal {
            write!(f, "of {of} ")?;
        }
        match test {
            InnovationTest::MeanNis => write!(
                f,
                "the innovations are {:.2} times as large as the filter claims (mean NIS {})",
                size.sqrt(),
                nis(*size)
            ),
            InnovationTest::Level => {
                write!(f, "the mean of the innovations is {size:.2} standard deviations {at}")
            }
            InnovationTest::Bands => write!(f, "the innovations have {size:.2} times the claimed power {at}"),
            InnovationTest::Line => {
                write!(
                    f,
                    "the innovations have a line {at}, with an amplitude of {size:.3} standard deviations"
                )
            }
            InnovationTest::Harmonics => {
                write!(
                    f,
                    "the innovations repeat with the motion, most {at}, with an amplitude of {size:.3} standard deviations"
                )
            }
            InnovationTest::Phase => write!(
                f,
                "the variance of the innovations changes over the motion's cycle by {:.1} %, most {at}",
                100.0 * size
            ),
            InnovationTest::Windows => {
                write!(f, "the variance of the innovations is {size:.2} times its mean {at}")
            }
            InnovationTest::Shape => {
                write!(f, "the innovations are not normally distributed (excess kurtosis {size:.2})")
            }
            InnovationTest::Outlier => {
                write!(f, "the innovation {at} is {size:.1} standard deviations of the others")
            }
            InnovationTest::Whiteness => write!(f, "innovations {at} have a correlation of {size:.3}"),
            InnovationTest::Numbers => write!(
                f,
                "the innovations ask for another value {at}, by {size:.1} standard deviations of what they tell of it"
            ),
            InnovationTest::Smoothing => write!(
                f,
                "the smoother changes the filter's answer {at} by {:.2} times as much as the variance that it takes off allows",
                size.sqrt()
            ),
        }?;
        let chance = self.p_value.max(1e-300);
        let about = if self.p_value < 1e-300 { "below 1e-300".to_owned() } else { format!("{chance:.0e}") };
        write!(
            f,
            "; with a true model the probability of this is {about}. The usual cause: {}",
            test.usual_cause()
        )
    }
}

impl InnovationTest {
    /// What it looks at, in a few words.
    pub const fn words(self) -> &'static str {
        self.texts()[0]
    }

    /// What a finding of this test usually means.
    const fn usual_cause(self) -> &'static str {
        self.texts()[1]
    }

    const fn texts(self) -> [&'static str; 2] {
        match self {
            Self::MeanNis => ["mean square", "the noise is stated too small, or the model is wrong"],
            Self::Level => {
                ["mean, in all and in parts", "an offset of the readout or its drift is not in the model"]
            }
            Self::Bands => [
                "power in bands",
                "the model lacks a motion, a pole of the readout or a disturbance there, or its damping is wrong",
            ],
            Self::Line => ["lines", "interference, or a motion that the model does not have"],
            Self::Harmonics => [
                "harmonics of the motion",
                "a parameter of the readout or the drive is wrong, such as its gain, shape, delay or feedthrough",
            ],
            Self::Phase => [
                "variance over the motion's cycle",
                "the noise depends on the signal, or the slope of the readout is wrong",
            ],
            Self::Windows => [
                "variance over the recording",
                "the noise changes over the recording, or something disturbed a part of it",
            ],
            Self::Shape => ["normal distribution", "outliers, clipping, or coarse digits"],
            Self::Outlier => ["largest innovation", "a disturbance of a single sample"],
            Self::Whiteness => ["correlation", "the process noise, a pole or a delay is wrong"],
            Self::Numbers => [
                "numbers of the device",
                "this number is wrong, or one that has the same effect on the signal",
            ],
            Self::Smoothing => [
                "what smoothing changes",
                "the model is wrong over the memory of the filter, or the smoother's arithmetic fails, as without process noise",
            ],
        }
    }
}

impl std::fmt::Display for TestPlace {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Number { name, by } => write!(f, "of {name} ({by})"),
            Self::State { name } => write!(f, "of {name}"),
            Self::Time { at_s } => write!(f, "at {}", quantity(*at_s, "s")),
            Self::Span { from_s, to_s } => {
                write!(f, "from {} to {}", quantity(*from_s, "s"), quantity(*to_s, "s"))
            }
            Self::Frequency { hz } => write!(f, "at {}", quantity(*hz, "Hz")),
            Self::Band { from_hz, to_hz } => {
                write!(f, "from {} to {}", quantity(*from_hz, "Hz"), quantity(*to_hz, "Hz"))
            }
            Self::Harmonic { number: 1, of_hz } => write!(f, "at its frequency, {}", quantity(*of_hz, "Hz")),
            Self::Harmonic { number, of_hz } => {
                write!(f, "at harmonic {number} of {}", quantity(*of_hz, "Hz"))
            }
            Self::Phase { degrees, of_hz } => {
                write!(f, "around {degrees:.0}° of its cycle at {}", quantity(*of_hz, "Hz"))
            }
            Self::Lag { updates: 1 } => write!(f, "that follow each other"),
            Self::Lag { updates } => write!(f, "{updates} updates apart"),
        }
    }
}

/// A mean NIS with three decimals, or with none where it is large.
pub fn nis(mean: f64) -> String {
    if mean < 100.0 { format!("{mean:.3}") } else { format!("{mean:.0}") }
}
