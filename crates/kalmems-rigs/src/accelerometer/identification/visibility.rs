//! Whether the innovations would show a wrong parameter that the acceleration suffers from.

use super::likelihood::{Likelihood, LikelihoodError, unknown};
use kalmems_core::Portable;
use unknown::{COUNT, DAMPING, MASS, SPRING};

/// What a filter with one parameter off says of the same recording.
#[derive(Clone, Copy, Debug)]
pub struct MistunedFilter {
    /// What the parameter is multiplied by.
    pub factor: f64,
    /// The mean of its normalised innovations squared.
    pub mean_nis: f64,
    /// How far its acceleration is from that of the filter with the right parameter, root mean square in m/s².
    pub moved: f64,
}

/// The same for several factors of one parameter.
#[derive(Clone, Debug)]
pub struct Visibility {
    /// Its place among the unknowns.
    pub parameter: usize,
    /// In the order of the factors, that of 1 among them.
    pub shifted: Vec<MistunedFilter>,
}

/// What the parameters of the mechanics are multiplied by.
pub const FACTORS: [f64; 5] = [0.8, 0.9, 1.0, 1.1, 1.2];

/// Runs the filter with each of spring, damping and mass off by each factor, and all else as it is in `logs`.
///
/// With the parameters changed by hand and the innovations counted again nothing is taken for small or linear, and the
/// feedback is the one that was applied, dither included.
pub fn visibility(likelihood: &Likelihood, logs: &[f64; COUNT]) -> Result<[Visibility; 3], LikelihoodError> {
    let mut right = Vec::new();
    let nis = run(likelihood, logs, &mut |acceleration| right.push(acceleration))?;
    let of = |parameter: usize| -> Result<Visibility, LikelihoodError> {
        let one = |factor: f64| {
            if factor == 1.0 {
                return Ok(MistunedFilter { factor, mean_nis: nis, moved: 0.0 });
            }
            let mut shifted = *logs;
            shifted[parameter] += factor.portable_ln();
            let (mut square, mut all) = (0.0, right.iter());
            let mean_nis = run(likelihood, &shifted, &mut |acceleration| {
                let right = all.next().copied().unwrap_or(acceleration);
                square += (acceleration - right).powi(2);
            })?;
            Ok(MistunedFilter { factor, mean_nis, moved: (square / right.len().max(1) as f64).sqrt() })
        };
        let shifted = FACTORS.iter().map(|factor| one(*factor)).collect::<Result<_, _>>()?;
        Ok(Visibility { parameter, shifted })
    };
    Ok([of(SPRING)?, of(DAMPING)?, of(MASS)?])
}

/// Each acceleration in m/s²; the mean NIS.
fn run(
    likelihood: &Likelihood,
    logs: &[f64; COUNT],
    each: &mut impl FnMut(f64),
) -> Result<f64, LikelihoodError> {
    let (mut nis, mut count) = (0.0, 0_usize);
    likelihood.follow(logs, &mut |innovation, acceleration| {
        nis += innovation.nis;
        count += 1;
        each(acceleration);
    })?;
    Ok(nis / count.max(1) as f64)
}

/// The standard deviation of the mean NIS of a right filter over so many samples.
pub fn chance(samples: usize) -> f64 {
    (2.0 / samples.max(1) as f64).sqrt()
}

impl Visibility {
    /// The factor that moves the acceleration most, of those whose mean NIS differs from that of the right filter by less
    /// than a 95 % interval of chance; `None` where each would be seen.
    pub fn worst_hidden(&self, samples: usize) -> Option<MistunedFilter> {
        let right = self.shifted.iter().find(|one| one.factor == 1.0).map_or(1.0, |one| one.mean_nis);
        let hidden = |one: &&MistunedFilter| {
            one.factor != 1.0 && (one.mean_nis - right).abs() < 1.96 * chance(samples)
        };
        self.shifted.iter().filter(hidden).max_by(|a, b| a.moved.total_cmp(&b.moved)).copied()
    }
}
