//! What a result depends on.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize, Serializer};

/// The distribution that stands for what is known of a quantity (JCGM 101, 6.4).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Distribution {
    /// Normal; with finite degrees of freedom the scaled and shifted t distribution.
    #[default]
    Normal,
    /// Equally probable between two limits: a resolution, a tolerance of which no more is known.
    Rectangular,
    /// The sum of two rectangular ones of equal width.
    Triangular,
    /// Of a sine of unknown phase between its limits.
    Arcsine,
}

impl Distribution {
    /// The standard deviation of a distribution whose limits are ±1; of the normal one, which has none, 1.
    pub fn deviation_of_half_width(self) -> f64 {
        match self {
            Self::Normal => 1.0,
            Self::Rectangular => 3.0_f64.sqrt().recip(),
            Self::Triangular => 6.0_f64.sqrt().recip(),
            Self::Arcsine => std::f64::consts::FRAC_1_SQRT_2,
        }
    }

    /// Its name in tables.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Normal => "normal",
            Self::Rectangular => "rectangular",
            Self::Triangular => "triangular",
            Self::Arcsine => "arcsine",
        }
    }
}

/// How an uncertainty was evaluated (JCGM 100, 4.2 and 4.3).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub enum Evaluation {
    /// By statistics of the records.
    A,
    /// By other means: a certificate, a data sheet, experience.
    B,
}

/// An input of a measurement.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Input {
    /// What it is, unique in a budget.
    pub name: String,
    /// The unit of value and standard uncertainty.
    pub unit: &'static str,
    /// Its best estimate.
    pub value: f64,
    /// Its standard uncertainty u.
    pub standard_uncertainty: f64,
    /// Its distribution.
    pub distribution: Distribution,
    /// ν, the degrees of freedom of u; infinite where u is taken as exact, and then `null` in JSON.
    #[serde(serialize_with = "or_null")]
    pub degrees_of_freedom: f64,
    /// How u was evaluated.
    pub evaluation: Evaluation,
    /// Where it is known from: a certificate, the records.
    pub source: String,
    /// c, by how much the result changes with a unit of it.
    pub sensitivity: f64,
}

impl Input {
    /// c·u, what it contributes to the result's uncertainty.
    pub fn contribution(&self) -> f64 {
        self.sensitivity * self.standard_uncertainty
    }
}

/// A number; `null` where it is infinite, which JSON cannot write.
#[allow(clippy::trivially_copy_pass_by_ref)] // as serde calls it
pub(crate) fn or_null<S: Serializer>(number: &f64, serializer: S) -> Result<S::Ok, S::Error> {
    if number.is_finite() { serializer.serialize_f64(*number) } else { serializer.serialize_none() }
}
