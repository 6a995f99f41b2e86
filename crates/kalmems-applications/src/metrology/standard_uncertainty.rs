//! Uncertainties as an operator states them.

use super::budget::coverage_factor;
use super::input::Distribution;
use crate::config::kinds::KindOf;
use crate::config::{NotNegative, Quantity, cholesky};
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::value::MapAccessDeserializer;
use serde::de::{Error, MapAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fmt;
use std::marker::PhantomData;

/// A standard uncertainty from elsewhere, with what is known of it: `"50 ppm"`, which is that of a normal distribution, or a table such as
/// `{ expanded = "0.01 %", coverage_factor = 2, source = "certificate 17" }` or `{ half_width = "2 um", distribution = "rectangular" }`.
#[derive(Clone, Debug, PartialEq)]
pub struct StandardUncertainty<K: KindOf> {
    keys: UncertaintyKeys<K>,
    standard: f64,
    /// Whether it was written as a value alone.
    plain: bool,
}

/// What a table says of an uncertainty, by one of `standard`, `expanded` and `half_width`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, bound = "K: KindOf")]
#[schemars(bound = "K: KindOf")]
struct UncertaintyKeys<K: KindOf> {
    /// The standard uncertainty.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    standard: Option<Quantity<K, NotNegative>>,
    /// An expanded uncertainty, such as a certificate states; the standard one is it by `coverage_factor`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    expanded: Option<Quantity<K, NotNegative>>,
    /// k of the expanded uncertainty; that of 95 % with the degrees of freedom if left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    coverage_factor: Option<f64>,
    /// Half of the distance between the limits of a rectangular, triangular or arcsine distribution.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    half_width: Option<Quantity<K, NotNegative>>,
    /// The distribution: normal if left out, rectangular beside a half width.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    distribution: Option<Distribution>,
    /// How many degrees of freedom the standard uncertainty has; infinitely many if left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    degrees_of_freedom: Option<f64>,
    /// Where it is known from: a certificate's number, a data sheet. The same words in two places mean the same error.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    source: Option<String>,
}

impl<K: KindOf> StandardUncertainty<K> {
    /// The standard uncertainty in SI.
    pub const fn standard(&self) -> f64 {
        self.standard
    }

    /// Its distribution.
    pub fn distribution(&self) -> Distribution {
        let of_limits =
            if self.keys.half_width.is_some() { Distribution::Rectangular } else { Distribution::Normal };
        self.keys.distribution.unwrap_or(of_limits)
    }

    /// The degrees of freedom; infinite where none are stated.
    pub fn degrees_of_freedom(&self) -> f64 {
        self.keys.degrees_of_freedom.unwrap_or(f64::INFINITY)
    }

    /// Where it is known from, where that is stated.
    pub fn source(&self) -> Option<&str> {
        self.keys.source.as_deref()
    }

    fn plain(standard: Quantity<K, NotNegative>) -> Self {
        let si = standard.si();
        let keys = UncertaintyKeys {
            standard: Some(standard),
            expanded: None,
            coverage_factor: None,
            half_width: None,
            distribution: None,
            degrees_of_freedom: None,
            source: None,
        };
        Self { keys, standard: si, plain: true }
    }

    fn of(keys: UncertaintyKeys<K>) -> Result<Self, String> {
        let freedom = keys.degrees_of_freedom.unwrap_or(f64::INFINITY);
        if freedom.is_nan() || freedom <= 0.0 {
            return Err(format!("`degrees_of_freedom` is {freedom}; expected a number above 0"));
        }
        if let Some(factor) = keys.coverage_factor
            && (!factor.is_finite() || factor <= 0.0)
        {
            return Err(format!("`coverage_factor` is {factor}; expected a number above 0, such as 2"));
        }
        if keys.coverage_factor.is_some() && keys.expanded.is_none() {
            return Err("`coverage_factor` belongs to `expanded`, which is not stated".to_owned());
        }
        let is_normal = keys.distribution == Some(Distribution::Normal);
        if keys.half_width.is_some() && is_normal {
            return Err("a normal distribution has no limits; expected `standard` or `expanded`, or another `distribution`".to_owned());
        }
        let standard = match (&keys.standard, &keys.expanded, &keys.half_width) {
            (Some(standard), None, None) => standard.si(),
            (None, Some(expanded), None) => {
                expanded.si() / keys.coverage_factor.unwrap_or_else(|| coverage_factor(0.95, freedom))
            }
            (None, None, Some(half)) => {
                half.si() * keys.distribution.unwrap_or(Distribution::Rectangular).deviation_of_half_width()
            }
            _ => {
                return Err("expected one of `standard`, `expanded` and `half_width`, such as `{ half_width = \"0.1 %\" }`".to_owned());
            }
        };
        Ok(Self { keys, standard, plain: false })
    }
}

impl<K: KindOf> Serialize for StandardUncertainty<K> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match &self.keys.standard {
            Some(standard) if self.plain => standard.serialize(serializer),
            _ => self.keys.serialize(serializer),
        }
    }
}

impl<'de, K: KindOf> Deserialize<'de> for StandardUncertainty<K> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct StatedVisitor<K>(PhantomData<K>);
        impl<'de, K: KindOf> Visitor<'de> for StatedVisitor<K> {
            type Value = StandardUncertainty<K>;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                let kind = K::kind();
                write!(
                    f,
                    "a standard uncertainty as text in quotes, such as `\"{}\"`, or a table such as `{{ half_width = \"{}\", source = \
                     \"data sheet\" }}`",
                    kind.example, kind.example
                )
            }

            fn visit_str<E: Error>(self, text: &str) -> Result<StandardUncertainty<K>, E> {
                Quantity::parse(text).map(StandardUncertainty::plain).map_err(E::custom)
            }

            fn visit_i64<E: Error>(self, number: i64) -> Result<StandardUncertainty<K>, E> {
                self.visit_str(&number.to_string())
            }

            fn visit_f64<E: Error>(self, number: f64) -> Result<StandardUncertainty<K>, E> {
                self.visit_str(&format!("{number:?}"))
            }

            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<StandardUncertainty<K>, A::Error> {
                let keys = UncertaintyKeys::deserialize(MapAccessDeserializer::new(map))?;
                StandardUncertainty::of(keys).map_err(A::Error::custom)
            }
        }
        deserializer.deserialize_any(StatedVisitor(PhantomData))
    }
}

impl<K: KindOf> JsonSchema for StandardUncertainty<K> {
    fn schema_name() -> Cow<'static, str> {
        format!("Uncertainty of {}", K::kind().name).into()
    }

    fn inline_schema() -> bool {
        true
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let value = Quantity::<K, NotNegative>::json_schema(generator);
        let table = UncertaintyKeys::<K>::json_schema(generator);
        json_schema!({
            "description": "A standard uncertainty from elsewhere, or a table with its distribution, degrees of freedom and source.",
            "anyOf": [value, table],
        })
    }
}

/// Correlations of stated errors, each pair once, by their keys: `lever_arm = { vibrometer = 0.4 }`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(transparent)]
pub struct StatedCorrelations(BTreeMap<String, BTreeMap<String, f64>>);

impl StatedCorrelations {
    /// Whether none are stated.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Both names and the correlation.
    pub fn pairs(&self) -> impl Iterator<Item = (&str, &str, f64)> {
        self.0.iter().flat_map(|(first, others)| {
            others.iter().map(move |(second, correlation)| (first.as_str(), second.as_str(), *correlation))
        })
    }

    /// Why no errors with these names can have such correlations: a name that is not among them, an error with itself, a pair that
    /// stands twice, a number beyond ±1, or a matrix that is not positive semi-definite.
    pub fn check(&self, known: &[&str]) -> Result<(), String> {
        let mut matrix = vec![vec![0.0; known.len()]; known.len()];
        for (i, row) in matrix.iter_mut().enumerate() {
            row[i] = 1.0;
        }
        for (first, second, correlation) in self.pairs() {
            let place = |name: &str| {
                known.iter().position(|own| *own == name).ok_or_else(|| {
                    format!("`{name}` is no uncertainty that is stated; expected one of {}", known.join(", "))
                })
            };
            let (i, j) = (place(first)?, place(second)?);
            if i == j {
                return Err(format!("`{first}` is correlated with itself; expected two different errors"));
            }
            if matrix[i][j] != 0.0 {
                return Err(format!(
                    "the correlation of `{first}` and `{second}` stands twice; expected it once"
                ));
            }
            if correlation.is_nan() || correlation.abs() > 1.0 {
                return Err(format!(
                    "the correlation of `{first}` and `{second}` is {correlation}; expected one from -1 to 1"
                ));
            }
            (matrix[i][j], matrix[j][i]) = (correlation, correlation);
        }
        if cholesky(&matrix).is_none() {
            return Err(
                "no errors have these correlations together: their matrix is not positive semi-definite"
                    .to_owned(),
            );
        }
        Ok(())
    }
}
