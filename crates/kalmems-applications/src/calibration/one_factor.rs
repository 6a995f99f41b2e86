//! Whether one scale factor describes records of several frequencies and amplitudes.

use super::matrix::{CalibrationMatrix, MOST_LEFT, RatePair};
use super::tone::{AXES, VibrationTone};
use crate::metrology::coverage_factor;
use crate::signal::PortableComplex;
use kalmems_core::Portable;
use std::fmt;

/// Frequencies that differ by more than this part are different ones.
const SAME_FREQUENCY: f64 = 0.01;
/// How often noise and scatter alone contradict one factor.
const FALSE_ALARMS: f64 = 1e-3;
/// Records that a trend is looked for in.
const FEWEST_RECORDS: usize = 4;

/// The part of an axis's own scale factor that it may show of another axis. A mounting is not off by half a right angle; channels are exchanged.
const MOST_CROSSED: f64 = 0.5;

/// Standard deviations by noise from which on that is certain.
const CERTAIN: f64 = 5.0;

/// Why one number is not the whole truth.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Contradiction {
    /// An axis does not show the rate about the axis of its name.
    Axes { axis: &'static str, own: f64, other: Option<(String, f64)> },
    /// No matrix describes the records.
    Records { left: f64, chi_square: f64, freedom: usize },
    /// Records of different frequencies have different factors.
    Frequencies {
        /// The places of the records of each frequency, lowest first.
        groups: Vec<Vec<usize>>,
        ends_hz: [f64; 2],
        chi_square: f64,
        freedom: usize,
    },
    /// The factor changes with the amplitude: from the smallest rate to the largest by this part.
    Amplitude { change: f64, ends: [f64; 2] },
}

impl fmt::Display for Contradiction {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Axes { axis, own, other: None } => write!(
                f,
                "the gyroscope of {axis} shows {own:+.3} of the rate about {axis}: its sign is turned against that of the other axes; the scale \
                 factors are withheld. Correct `scale` of its column, or the mounting"
            ),
            Self::Axes { axis, own, other: Some((name, other)) } => write!(
                f,
                "k_{axis}{axis} is {own:+.3} and {name} {other:+.3}: axes are exchanged, or the case is turned against the reference; the scale \
                 factors are withheld. Correct `channels`, or the mounting"
            ),
            Self::Records { left, chi_square, freedom } => write!(
                f,
                "no matrix of scale factors describes the records: the best leaves {:.1} % of what the gyroscope shows (χ² {chi_square:.3e} at \
                 {freedom} degrees of freedom); it is withheld. Look for records of another run, a channel of another clock, and clipping",
                100.0 * left
            ),
            Self::Frequencies { ends_hz: [low, high], chi_square, freedom, .. } => write!(
                f,
                "one scale factor does not describe records from {low:.1} to {high:.1} Hz (χ² {chi_square:.3e} at {freedom} degrees of freedom): \
                 it is withheld, and stated for each frequency"
            ),
            Self::Amplitude { change, ends: [low, high] } => write!(
                f,
                "the scale factor changes with the rate, by {:+.1} ppm from {low:.3} to {high:.3} rad/s: it is withheld. Calibrate at the rates of \
                 use, or look for clipping and for a drive that moves the case",
                1e6 * change
            ),
        }
    }
}

/// Whether the records exclude one factor. Records that are repeated at one frequency and rate may scatter, which enters the interval.
pub(super) fn contradiction(
    pairs: &[RatePair],
    tones: &[VibrationTone],
    main: usize,
    matrix: &CalibrationMatrix,
) -> Option<Contradiction> {
    if let Some(crossed) = crossed(matrix) {
        return Some(crossed);
    }
    if matrix.probability() >= FALSE_ALARMS {
        return None;
    }
    let groups = of_one_frequency(tones);
    if groups.len() > 1 {
        let frequency = |place: &usize| tones[*place].frequency_hz;
        let ends_hz = [groups.first()?.first().map(frequency)?, groups.last()?.last().map(frequency)?];
        let (chi_square, freedom) = (matrix.chi_square, matrix.freedom);
        return Some(Contradiction::Frequencies { groups, ends_hz, chi_square, freedom });
    }
    if matrix.left > MOST_LEFT {
        let CalibrationMatrix { left, chi_square, freedom, .. } = *matrix;
        return Some(Contradiction::Records { left, chi_square, freedom });
    }
    with_amplitude(pairs, main, matrix)
}

/// An axis that does not show the rate about the axis of its name, or less of it than of another.
fn crossed(matrix: &CalibrationMatrix) -> Option<Contradiction> {
    (0..3).find_map(|i| {
        let ((own, deviation), axis) = (matrix.entry(i, i)?, AXES[i]);
        if own < -CERTAIN * deviation {
            return Some(Contradiction::Axes { axis, own, other: None });
        }
        let others = (0..3).filter(|j| *j != i).flat_map(|j| [(i, j), (j, i)]);
        let sizes = others.filter_map(|(i, j)| Some((i, j, matrix.entry(i, j)?)));
        let (i, j, (other, uncertain)) = sizes.max_by(|a, b| a.2.0.abs().total_cmp(&b.2.0.abs()))?;
        let name = format!("k_{}{}", AXES[i], AXES[j]);
        let beyond = other.abs() - MOST_CROSSED * own;
        (beyond > CERTAIN * uncertain.portable_hypot(deviation)).then_some(Contradiction::Axes {
            axis,
            own,
            other: Some((name, other)),
        })
    })
}

fn of_one_frequency(tones: &[VibrationTone]) -> Vec<Vec<usize>> {
    let mut places: Vec<usize> = (0..tones.len()).collect();
    places.sort_by(|a, b| tones[*a].frequency_hz.total_cmp(&tones[*b].frequency_hz));
    let mut groups: Vec<Vec<usize>> = Vec::new();
    for place in places {
        let frequency = tones[place].frequency_hz;
        match groups.last_mut() {
            Some(group)
                if group.first().is_some_and(|first| {
                    frequency <= (1.0 + SAME_FREQUENCY) * tones[*first].frequency_hz
                }) =>
            {
                group.push(place);
            }
            _ => groups.push(vec![place]),
        }
    }
    groups
}

/// The slope of the residuals over the rate, where it stands out of what they scatter about it.
fn with_amplitude(pairs: &[RatePair], main: usize, matrix: &CalibrationMatrix) -> Option<Contradiction> {
    let points: Vec<(f64, f64, f64)> = pairs
        .iter()
        .enumerate()
        .filter_map(|(place, pair)| {
            let rate = pair.reference[main].portable_norm();
            Some((rate, matrix.residual(pairs, place, main)?, rate * rate))
        })
        .collect();
    if points.len() < FEWEST_RECORDS {
        return None;
    }
    let weight: f64 = points.iter().map(|(.., w)| w).sum();
    let mean =
        |of: &dyn Fn(&(f64, f64, f64)) -> f64| points.iter().map(|p| p.2 * of(p)).sum::<f64>() / weight;
    let (rate, residual) = (mean(&|p| p.0), mean(&|p| p.1));
    let spread = mean(&|p| (p.0 - rate).powi(2));
    let slope = mean(&|p| (p.0 - rate) * (p.1 - residual)) / spread;
    let freedom = (points.len() - 2) as f64;
    let left: f64 = points.iter().map(|p| p.2 * (p.1 - residual - slope * (p.0 - rate)).powi(2)).sum();
    let deviation = (left / freedom / (weight * spread)).sqrt();
    let ends = points.iter().fold([f64::INFINITY, 0.0], |[low, high], p| [p.0.min(low), p.0.max(high)]);
    // Rates that hardly differ have no slope.
    let differ = ends[1] > (1.0 + 10.0 * SAME_FREQUENCY) * ends[0];
    let stands_out = slope.abs() > coverage_factor(1.0 - FALSE_ALARMS, freedom) * deviation;
    (differ && stands_out).then(|| Contradiction::Amplitude { change: slope * (ends[1] - ends[0]), ends })
}
