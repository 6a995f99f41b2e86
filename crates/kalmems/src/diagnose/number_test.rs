//! Whether innovations ask for another number than the filter is told.

use super::bench::TrialBench;
use super::sensitivity::NumberSensitivity;
use super::suspect::{NumberRole, Suspect};
use super::trial::DiagnosisTrial;
use crate::evaluate::{InnovationTest, TestPlace, TestResult, normal_tail};

/// Whether a number has a slope that the test can use: what makes another filter of it has none.
pub(super) fn has_slope(suspect: &Suspect) -> bool {
    match &suspect.what {
        NumberRole::LeftOut { left_out, .. } => left_out.filter_switch.is_none(),
        _ => true,
    }
}

/// The score test of each number but the noises: with the innovations z in units of their claimed standard deviations, and the slopes s
/// of the predictions in the same unit, Σ s z has the variance Σ s² where the filter is right, as a slope is a function of what came
/// before (Rao, Proceedings of the Cambridge Philosophical Society 44, 50, 1948). What is uncertain of the device by its statement adds
/// (Σ s u)² for each independent direction, of which u is the change of the predictions for one standard deviation.
///
/// The process noise of a filter may be larger than the true one: its gain is too large, its innovations are correlated, and they ask for
/// a smaller gain, as a larger noise of the measurement would give it. A number that changes the gain has a part of that in its score,
/// which is taken out of it; and as much again is taken off its size, as a number may change the gain in another way than a noise does.
/// Where the innovations ask for a larger gain, as they do where the model is wrong, nothing is taken out.
///
/// An innovation that a gate would reject does not count: it tells of a disturbance. `None` without a number.
pub(super) fn number_test(
    base: &DiagnosisTrial,
    numbers: &[NumberSensitivity],
    uncertain: &[Vec<f64>],
) -> Option<TestResult> {
    let z = base.innovations.in_sd();
    let is_known =
        |k: usize| numbers.iter().all(|number| number.slopes.get(k).is_some_and(|slope| slope.is_finite()));
    let counts = |k: usize| z[k].abs() < LARGEST && is_known(k);
    let kept: Vec<usize> = (0..z.len()).filter(|k| counts(*k)).collect();
    let of_kept = |all: &[f64]| -> Vec<f64> {
        kept.iter().map(|k| all.get(*k).copied().filter(|x| x.is_finite()).unwrap_or(0.0)).collect()
    };
    let (noises, numbers): (Vec<_>, Vec<_>) = numbers.iter().partition(|number| number.suspect.is_noise());
    let mut scores = Scores { z: of_kept(&z), gains: Vec::new(), uncertain: Vec::new() };
    for noise in noises {
        scores.take_noise(of_kept(&noise.slopes));
    }
    scores.uncertain = uncertain.iter().map(|direction| of_kept(direction)).collect();
    let deviations =
        (numbers.iter()).filter_map(|number| Some((number, scores.deviation(&of_kept(&number.slopes))?)));
    let (number, ScoreDeviation { size, in_sd }) =
        deviations.max_by(|a, b| a.1.in_sd.abs().total_cmp(&b.1.in_sd.abs()))?;
    let looks = numbers.len() as f64;
    let p_value = (looks * 2.0 * normal_tail(in_sd.abs())).min(1.0);
    let (name, by) = (number.suspect.name(), number.suspect.size_in_words(size));
    let place = Some(TestPlace::Number { name, by });
    Some(TestResult { test: InnovationTest::Numbers, p_value, size: in_sd.abs(), place, signal: None })
}

/// The largest innovation that counts, in standard deviations: beyond it the probability of a normal number is 1e-7.
const LARGEST: f64 = 5.33;

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// By how much the innovations ask for another value.
struct ScoreDeviation {
    /// In the unit of the number.
    size: f64,
    /// In standard deviations of that.
    in_sd: f64,
}

/// What scores are computed from.
struct Scores {
    /// Innovations in units of their claimed standard deviations.
    z: Vec<f64>,
    /// Orthonormal directions in which the gain becomes smaller, and by how many standard deviations the innovations ask for that.
    gains: Vec<(Vec<f64>, f64)>,
    /// What the device's stated uncertainty changes in the predictions.
    uncertain: Vec<Vec<f64>>,
}

impl Scores {
    /// Takes in the slopes by a noise of the measurement.
    fn take_noise(&mut self, mut slopes: Vec<f64>) {
        for (gain, _) in &self.gains {
            let along = dot(&slopes, gain);
            slopes.iter_mut().zip(gain).for_each(|(slope, gain)| *slope -= along * gain);
        }
        let length = dot(&slopes, &slopes).sqrt();
        if length > 0.0 {
            for slope in &mut slopes {
                *slope /= length;
            }
            let asked = dot(&self.z, &slopes);
            self.gains.push((slopes, asked));
        }
    }

    /// By the slopes of a number; `None` where it changes no prediction.
    fn deviation(&self, slopes: &[f64]) -> Option<ScoreDeviation> {
        let information = dot(slopes, slopes);
        let (mut of_gain, mut size_of_gain) = (0.0, 0.0);
        for (gain, asked) in &self.gains {
            let part = asked.max(0.0) * dot(slopes, gain);
            of_gain += part;
            size_of_gain += part * part;
        }
        let score = dot(&self.z, slopes) - of_gain;
        let beyond = (score.abs() - size_of_gain.sqrt()).max(0.0).copysign(score);
        let uncertain: f64 = self.uncertain.iter().map(|u| dot(slopes, u).powi(2)).sum();
        let in_sd = beyond / (information + uncertain).sqrt();
        (information > 0.0).then(|| ScoreDeviation { size: score / information, in_sd })
    }
}

/// What one standard deviation in each direction of the device's stated uncertainty changes in the predictions, in standard deviations
/// of the innovations; nothing of a direction with which the filter cannot be run.
pub(super) fn uncertain_directions(bench: &TrialBench, base: &DiagnosisTrial) -> Vec<Vec<f64>> {
    let changed = bench.in_uncertain_directions();
    changed.map(|changed| base.innovations.slopes_in_sd(&changed.innovations, 1.0)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::Innovations;
    use crate::simulate::WhiteNoise;

    const SAMPLES: usize = 2000;

    /// A Kalman filter of a random walk x with the signal y = c·sin(k/20) + x and noise.
    #[derive(Clone, Copy)]
    struct Told {
        c: f64,
        noise: f64,
        process_noise: f64,
    }

    const RIGHT: Told = Told { c: 1.0, noise: 1.0, process_noise: 1e-4 };

    impl Told {
        fn signal(self, seed: u64) -> Vec<f64> {
            let (mut of_walk, mut of_samples, mut x) =
                (WhiteNoise::new(seed, 0), WhiteNoise::new(seed, 1), 0.0);
            (0..SAMPLES)
                .map(|k| {
                    x += self.process_noise.sqrt() * of_walk.sample();
                    self.c * (k as f64 / 20.0).sin() + x + self.noise.sqrt() * of_samples.sample()
                })
                .collect()
        }

        fn innovations(self, signal: &[f64]) -> Innovations {
            let (mut x, mut p, mut found) = (0.0, 0.0, Innovations::default());
            for (k, y) in signal.iter().enumerate() {
                p += self.process_noise;
                let (value, variance) = (y - self.c * (k as f64 / 20.0).sin() - x, p + self.noise);
                found.value.push(value);
                found.variance.push(variance);
                x += p / variance * value;
                p -= p * p / variance;
            }
            found
        }

        /// By how many standard deviations the innovations ask for another c, and for another process noise, of a filter that is told this.
        fn deviations(self, signal: &[f64]) -> [f64; 2] {
            let own = self.innovations(signal);
            let slopes = |other: Self| own.slopes_in_sd(&other.innovations(signal), 1e-3);
            let mut scores = Scores { z: own.in_sd(), gains: Vec::new(), uncertain: Vec::new() };
            scores.take_noise(slopes(Self { noise: self.noise * 1.001, ..self }));
            let of_c = slopes(Self { c: self.c + 1e-3, ..self });
            let of_walk = slopes(Self { process_noise: self.process_noise * 1.001, ..self });
            [of_c, of_walk].map(|slopes| scores.deviation(&slopes).unwrap().in_sd)
        }
    }

    fn squares(told: Told, real: Told) -> [f64; 2] {
        let mut sums = [0.0; 2];
        for seed in 500..700 {
            let found = told.deviations(&real.signal(seed));
            sums.iter_mut().zip(found).for_each(|(sum, one)| *sum += one * one / 200.0);
        }
        sums
    }

    #[test]
    fn of_a_right_filter_the_scores_are_as_large_as_they_claim() {
        // The mean of 200 squares is within 0.7 and 1.36 in 99.9 % of cases; what a smaller gain may explain is taken off.
        let [of_c, of_walk] = squares(RIGHT, RIGHT);
        assert!((0.5..1.36).contains(&of_c) && of_walk < 1.36, "{of_c} {of_walk}");
    }

    #[test]
    fn a_gain_that_is_too_large_asks_for_no_other_number() {
        for process_noise in [1e-3, 1e-2, 0.1, 1.0] {
            let [of_c, of_walk] = squares(Told { process_noise, ..RIGHT }, RIGHT);
            assert!(of_c < 1.36 && of_walk < 1.36, "{process_noise}: {of_c} {of_walk}");
        }
    }

    #[test]
    fn a_number_that_is_wrong_is_asked_for() {
        // With the information Σ s² the innovations ask for 1 − c by (1 − c)·√Σ s² standard deviations on average.
        let told = Told { c: 0.75, ..RIGHT };
        let own = told.innovations(&RIGHT.signal(1));
        let slopes = own.slopes_in_sd(&Told { c: 0.76, ..RIGHT }.innovations(&RIGHT.signal(1)), 0.01);
        let expected = 0.25 * dot(&slopes, &slopes).sqrt();
        let [of_c, _] = squares(told, RIGHT);
        assert!(expected > 5.0 && (of_c.sqrt() / expected - 1.0).abs() < 0.1, "{} {expected}", of_c.sqrt());
    }
}
