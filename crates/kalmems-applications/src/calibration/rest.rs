//! A record without motion: static bias, and how it wanders.

use super::outcome::UncertainEstimate;
use crate::metrology::{Combined, coverage_factor};
use crate::signal::{Confident, Deviation, octaves};
use serde::Serialize;

/// Pieces whose means tell how well the mean is known.
const PIECES: usize = 8;

/// Half of a normal distribution's quartile distance: the floor of flicker noise in Allan's deviation by its bias
/// instability, √(2·ln 2/π).
pub(super) const FLOOR: f64 = 0.664_280_6;

/// What one axis does at rest.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct AxisAtRest {
    /// `x`, `y` or `z`.
    pub axis: &'static str,
    /// How many samples.
    pub samples: usize,
    /// How long they last without the gaps between them, in s.
    pub duration_s: f64,
    /// How many gaps are between them: missing samples, and such without a number. No difference is taken across one.
    #[serde(skip_serializing_if = "is_zero")]
    pub gaps: usize,
    /// The mean in rad/s.
    pub bias: f64,
    /// The interval that holds it 95 times in 100, by the spread of the means of eight pieces: right for noise that is
    /// white beyond an eighth of the record.
    pub bias_interval: [f64; 2],
    /// Its standard uncertainty in rad/s.
    pub bias_uncertainty: f64,
    /// The degrees of freedom of that.
    pub bias_freedom: f64,
    /// The root mean square about the mean in rad/s.
    pub noise: f64,
    /// Allan's deviation, overlapping, with intervals of 95 %.
    #[serde(skip)]
    pub deviations: Vec<Confident>,
    /// The angle random walk in rad/√s, σ·√τ where the noise is white; none where it nowhere is.
    pub angle_random_walk: Option<f64>,
    /// The bias instability in rad/s, the smallest deviation by 0.664, and at which averaging time in s. An upper bound
    /// where the deviation still falls at the record's end.
    pub bias_instability: Option<[f64; 2]>,
    /// Whether the deviation has a floor within the record.
    pub floor_is_seen: bool,
}

#[allow(clippy::trivially_copy_pass_by_ref)] // as serde calls it
const fn is_zero(count: &usize) -> bool {
    *count == 0
}

/// The runs of finite numbers.
pub(super) fn finite_runs(values: &[f64]) -> impl Iterator<Item = &[f64]> {
    values.split(|value| !value.is_finite()).filter(|run| !run.is_empty())
}

impl AxisAtRest {
    /// From equidistant samples; those that are not finite are gaps. `None` of fewer than 64.
    pub fn of(axis: &'static str, values: &[f64], interval_s: f64) -> Option<Self> {
        Self::of_stretches(axis, &finite_runs(values).collect::<Vec<_>>(), interval_s)
    }

    /// From stretches of equidistant finite samples with gaps between them. `None` of fewer than 64.
    pub fn of_stretches(axis: &'static str, stretches: &[&[f64]], interval_s: f64) -> Option<Self> {
        let values: Vec<f64> = stretches.concat();
        let samples = values.len();
        let longest = stretches.iter().map(|stretch| stretch.len()).max().unwrap_or(0);
        if samples < 64 || interval_s.is_nan() || interval_s <= 0.0 {
            return None;
        }
        let mean = |part: &[f64]| part.iter().sum::<f64>() / part.len() as f64;
        let bias = mean(&values);
        let square: f64 = values.iter().map(|v| (v - bias).powi(2)).sum();
        let means: Vec<f64> = values.chunks_exact(samples / PIECES).take(PIECES).map(mean).collect();
        let middle = mean(&means);
        let freedom = (PIECES - 1) as f64;
        let spread = means.iter().map(|m| (m - middle).powi(2)).sum::<f64>() / freedom;
        let by_pieces = (spread / PIECES as f64).sqrt();
        let deviations = Deviation::Overlapping.of_stretches_with_confidence(
            stretches,
            interval_s,
            &octaves(longest),
            0.95,
        );
        let half = coverage_factor(super::inputs::PROBABILITY, freedom) * by_pieces;
        // The longest times have so few differences that their smallest value would be chance.
        let known: Vec<&Confident> = deviations.iter().filter(|d| d.freedom >= 5.0).collect();
        let lowest = known.iter().min_by(|a, b| a.averaged.deviation.total_cmp(&b.averaged.deviation));
        let white = known.iter().filter(|d| d.exponent == 0);
        let (weights, walks) = white.fold((0.0, 0.0), |(weights, walks), d| {
            let walk = d.averaged.deviation * d.averaged.time_s.sqrt();
            (weights + d.freedom, walks + d.freedom * walk)
        });
        Some(Self {
            axis,
            samples,
            duration_s: samples as f64 * interval_s,
            gaps: stretches.len() - 1,
            bias,
            bias_interval: [bias - half, bias + half],
            bias_uncertainty: by_pieces,
            bias_freedom: freedom,
            noise: (square / (samples - 1) as f64).sqrt(),
            angle_random_walk: (weights > 0.0).then(|| walks / weights),
            bias_instability: lowest.map(|d| [d.averaged.deviation / FLOOR, d.averaged.time_s]),
            floor_is_seen: lowest.zip(known.last()).is_some_and(|(low, last)| {
                last.interval[0] > low.averaged.deviation || (last.exponent < 0 && low.exponent < 0)
            }),
            deviations,
        })
    }

    /// The bias with its uncertainty.
    pub fn bias_estimate(&self) -> UncertainEstimate {
        let combined = Combined::of(self.bias_uncertainty, self.bias_freedom, super::inputs::PROBABILITY);
        UncertainEstimate::of(self.bias, combined, combined)
    }
}
