//! How an input goes between two samples of a recording.

use super::ordered::{OfElement, Ordered};
use crate::config::inline_schema;
use crate::estimate::driven::{InterpolationLag, SegmentDrive};
use crate::signal::band_limited;
use kalmems_core::Nodes;
use kalmems_equations::VectorElement;
use schemars::{JsonSchema, json_schema};
use serde::de::value::{MapAccessDeserializer, StrDeserializer};
use serde::de::{Error, MapAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::fmt;

/// How an input goes between two samples.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Interpolation {
    /// Along the polynomial of fifth order through the six samples around.
    #[default]
    Quintic,
    /// Along the cubic through the four samples around.
    Cubic,
    /// Along a straight line.
    Linear,
    /// It stays at the sample before, as behind a converter that holds its output.
    Hold,
    /// It stays at the mean of the samples at both ends.
    Mean,
    /// Along the sine of the block of samples before, corrected by the quintic through what the samples differ from it: for few samples
    /// in a cycle of a steady drive. Along the quintic where the input follows no sine.
    Sine,
    /// Along the band-limited signal through the 16 samples on either side, for few samples in a cycle of any drive. Along the quintic
    /// where these are not at equal distances.
    BandLimited,
}

/// Samples on each side that a band-limited signal is computed from.
const REACH: usize = 16;

impl Interpolation {
    /// The rows before and behind the new ones of a part that it asks for.
    pub fn rows_around(self, lag: InterpolationLag) -> (usize, usize) {
        match self {
            Self::BandLimited => (REACH, REACH),
            Self::Quintic | Self::Sine => lag.rows_around(),
            Self::Cubic | Self::Linear | Self::Hold | Self::Mean => (4, 1),
        }
    }

    /// Whether the sine of an input has to be followed block by block.
    pub fn needs_sine(self) -> bool {
        self == Self::Sine
    }

    /// An input at the ends and in the middle of the interval that ends at sample `to`.
    pub fn nodes(self, input: &SegmentDrive<'_>, to: usize) -> Nodes<f64> {
        match self {
            Self::Quintic => input.nodes(to),
            Self::Cubic => input.nodes_on_cubic(to),
            Self::Linear | Self::Hold | Self::Mean => {
                let (start, end) = (input.sample(to - 1).0, input.sample(to).0);
                self.between_ends(Nodes { start, middle: f64::NAN, end })
            }
            Self::Sine => {
                input.continuation(to).map_or_else(|| input.nodes(to), |sine| input.nodes_along(sine, to))
            }
            Self::BandLimited => {
                let mut nodes = input.nodes(to);
                if let Some(middle) = band_limited_middle(input, to) {
                    nodes.middle = middle;
                }
                nodes
            }
        }
    }

    /// The same for an input of which the ends are known and, where neither a line nor a level is asked for, the middle.
    pub fn between_ends(self, nodes: Nodes<f64>) -> Nodes<f64> {
        let Nodes { start, end, .. } = nodes;
        match self {
            Self::Linear => Nodes { start, middle: start.midpoint(end), end },
            Self::Hold => Nodes::held(start),
            Self::Mean => Nodes::held(start.midpoint(end)),
            Self::Quintic | Self::Cubic | Self::Sine | Self::BandLimited => nodes,
        }
    }
}

/// The middle of the interval that ends at sample `to`, of a band-limited input; `None` where the samples around are not at equal
/// distances.
fn band_limited_middle(input: &SegmentDrive<'_>, to: usize) -> Option<f64> {
    let time_s = input.time_s();
    let last = time_s.len().checked_sub(1)?;
    let (from, until) = (to.saturating_sub(REACH), (to + REACH - 1).min(last));
    let interval_s = time_s[to] - time_s[to - 1];
    let expected_s = (until - from) as f64 * interval_s;
    if (time_s[until] - time_s[from] - expected_s).abs() > 0.1 * interval_s {
        return None;
    }
    let mut window = [0.0; 2 * REACH];
    for (place, value) in window.iter_mut().enumerate() {
        // Beyond its ends the input counts as held.
        let row = (to + place).saturating_sub(REACH).min(last);
        *value = input.sample(row).0;
    }
    Some(band_limited(&window, REACH as f64 - 0.5))
}

impl OfElement for Interpolation {
    fn of_element(&self, _: &VectorElement) -> Result<Self, String> {
        Ok(*self)
    }
}

/// What the table says: one way for all inputs, or one for each by its name.
#[derive(Clone, Debug, PartialEq)]
pub enum Interpolations {
    /// The same for all.
    All(Interpolation),
    /// One for each that is named; a quintic for the others.
    Each(Ordered<Interpolation>),
}

impl Default for Interpolations {
    fn default() -> Self {
        Self::All(Interpolation::default())
    }
}

impl Interpolations {
    /// Whether nothing but the default is asked for.
    pub fn is_left_out(&self) -> bool {
        match self {
            Self::All(all) => *all == Interpolation::default(),
            Self::Each(each) => each.is_empty(),
        }
    }

    /// That of an input.
    pub fn of(&self, input: &str) -> Interpolation {
        match self {
            Self::All(all) => *all,
            Self::Each(each) => each.get(input).copied().unwrap_or_default(),
        }
    }

    /// Adds one for a further input beside these.
    pub fn set(&mut self, inputs: &[String], input: &str, own: Interpolation) {
        let mut each = Ordered::default();
        for name in inputs.iter().map(String::as_str).chain(self.names()) {
            if each.get(name).is_none() {
                each.push(name, self.of(name));
            }
        }
        each.push(input, own);
        *self = Self::Each(each);
    }

    /// The names that it has.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        let each = match self {
            Self::All(_) => None,
            Self::Each(each) => Some(each),
        };
        each.into_iter().flat_map(|each| each.iter().map(|(name, _)| name))
    }
}

impl Serialize for Interpolations {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::All(all) => all.serialize(serializer),
            Self::Each(each) => each.serialize(serializer),
        }
    }
}

impl<'de> Deserialize<'de> for Interpolations {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct InterpolationsVisitor;
        impl<'de> Visitor<'de> for InterpolationsVisitor {
            type Value = Interpolations;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a word such as `\"hold\"`, or a table with one for each input by its name")
            }

            fn visit_str<E: Error>(self, word: &str) -> Result<Interpolations, E> {
                Interpolation::deserialize(StrDeserializer::new(word)).map(Interpolations::All)
            }

            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Interpolations, A::Error> {
                Ordered::deserialize(MapAccessDeserializer::new(map)).map(Interpolations::Each)
            }
        }
        deserializer.deserialize_any(InterpolationsVisitor)
    }
}

inline_schema!(Interpolations, "Interpolations", |generator| json_schema!({
    "anyOf": [
        generator.subschema_for::<Interpolation>(),
        { "type": "object", "additionalProperties": generator.subschema_for::<Interpolation>() },
    ],
    "examples": ["hold"],
}));

#[cfg(test)]
mod tests {
    use super::*;
    use crate::estimate::SampleSelection;
    use crate::estimate::driven::DrivePast;
    use crate::progress::Interruption;
    use std::f64::consts::TAU;

    /// Largest errors of the middle of each interval, away from the ends, of this many samples per cycle.
    fn errors(per_cycle: f64, sweep: f64) -> [(Interpolation, f64); 5] {
        let wave = |k: f64| (TAU * k / per_cycle * (1.0 + sweep * k) + 0.3).sin();
        let time_s: Vec<f64> = (0..9000).map(|k| f64::from(k) * 1e-6).collect();
        let values: Vec<f64> = (0..9000).map(|k| wave(f64::from(k))).collect();
        let mut past = DrivePast::default();
        past.foresees = true;
        let samples = SampleSelection::whole(time_s.len(), 1e-6);
        let input = SegmentDrive::of(&time_s, &values, &samples, &mut past, &Interruption::never());
        let ways = [
            Interpolation::Linear,
            Interpolation::Cubic,
            Interpolation::Quintic,
            Interpolation::Sine,
            Interpolation::BandLimited,
        ];
        ways.map(|way| {
            let error = |to: usize| way.nodes(&input, to).middle - wave(to as f64 - 0.5);
            (way, (20..8980).map(|to| error(to).abs()).fold(0.0, f64::max))
        })
    }

    #[test]
    fn a_steady_sine_of_few_samples_is_followed_by_its_sine_and_any_drive_within_the_band() {
        // The cubic's error is 3/128 of the fourth power of the phase between two samples, the quintic's 5/1024 of the sixth.
        let [(_, linear), (_, cubic), (_, quintic), (_, sine), (_, band)] = errors(8.0, 0.0);
        let of_quintic = 5.0 / 1024.0 * (TAU / 8.0).powi(6);
        assert!((quintic / of_quintic - 1.0).abs() < 0.2, "{quintic} {of_quintic}");
        let expected = 3.0 / 128.0 * (TAU / 8.0).powi(4);
        assert!((cubic / expected - 1.0).abs() < 0.2, "{cubic} {expected}");
        assert!((linear / (TAU / 8.0).powi(2) * 8.0 - 1.0).abs() < 0.2, "{linear}");
        assert!(sine < 1e-9 && band < 1e-5, "{sine:e} {band:e}");
        // A sweep follows no sine: the quintic stands in, and the band-limited signal is as good as before.
        let [_, _, (_, quintic), (_, sine), (_, band)] = errors(8.0, 2e-5);
        assert!(
            quintic > 1e-3 && (sine / quintic - 1.0).abs() < 0.1 && band < 1e-5,
            "{quintic:e} {sine:e} {band:e}"
        );
    }

    #[test]
    fn a_word_stands_for_all_inputs_and_a_table_for_each() {
        let read = |text: &str| {
            toml::from_str::<toml::Table>(text).unwrap()["i"].clone().try_into::<Interpolations>()
        };
        assert_eq!(read("i = 'hold'").unwrap().of("any"), Interpolation::Hold);
        let each = read("i = { a = 'mean', b = 'band_limited' }").unwrap();
        assert_eq!(
            ["a", "b", "c"].map(|name| each.of(name)),
            [Interpolation::Mean, Interpolation::BandLimited, Interpolation::Quintic,]
        );
        let refused = read("i = 'spline'").unwrap_err().to_string();
        assert!(refused.contains("spline") && refused.contains("band_limited"), "{refused}");
    }
}
