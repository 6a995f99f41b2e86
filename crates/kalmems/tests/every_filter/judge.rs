//! Whether a filter did what it should.

use crate::follow::{Said, Trace};
use crate::recording::Recording;

/// The largest error in any state at any sample, in standard deviations as the filter states them.
///
/// Of a Gaussian 2 in 10⁹ lie beyond six, and 6 in 10⁷ beyond five, which is too many for all samples of all devices.
pub fn worst_error<const N: usize, const M: usize>(trace: &Trace<N>, recording: &Recording<N, M>) -> f64 {
    trace.iter().zip(&recording.truth).map(|(said, truth)| error(said, truth)).fold(0.0, f64::max)
}

/// The largest error of any state in standard deviations.
pub fn error<const N: usize>(said: &Said<N>, truth: &[f64; N]) -> f64 {
    (0..N).map(|i| (said.mean[i] - truth[i]).abs() / said.deviation[i]).fold(0.0, f64::max)
}

/// How far two filters are ever apart: in a mean, in standard deviations of the second, and in the logarithm of a
/// standard deviation.
pub fn apart<const N: usize>(one: &Trace<N>, other: &Trace<N>) -> (f64, f64) {
    let (mut means, mut deviations) = (0.0_f64, 0.0_f64);
    for (one, other) in one.iter().zip(other) {
        means = means.max(error(&Said { mean: one.mean, ..*other }, &other.mean));
        for (a, b) in one.deviation.iter().zip(other.deviation) {
            deviations = deviations.max((a / b).ln().abs());
        }
    }
    (means, deviations)
}

/// The mean NIS of many traces less its number of components, in standard deviations of such a mean.
pub fn nis_excess<const N: usize>(traces: &[Trace<N>], components: usize) -> f64 {
    let nis: Vec<f64> = traces.iter().flatten().filter_map(|said| said.nis).collect();
    let (n, m) = (nis.len() as f64, components as f64);
    (nis.iter().sum::<f64>() / n - m) / (2.0 * m / n).sqrt()
}

/// How many corrections were taken.
pub fn taken<const N: usize>(trace: &Trace<N>) -> usize {
    trace.iter().filter(|said| said.taken).count()
}

/// The smallest ratio of standard deviations, state by state and sample by sample.
pub fn least_ratio<const N: usize>(one: &Trace<N>, other: &Trace<N>) -> f64 {
    let ratios = |(one, other): (&Said<N>, &Said<N>)| {
        (0..N).map(|i| one.deviation[i] / other.deviation[i]).fold(f64::INFINITY, f64::min)
    };
    one.iter().zip(other).map(ratios).fold(f64::INFINITY, f64::min)
}
