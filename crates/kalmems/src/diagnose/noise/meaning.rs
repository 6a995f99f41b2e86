//! What a density of process noise means, in words.

use crate::diagnose::trial::DiagnosisTrial;
use crate::rigs::StateDensity;
use kalmems_figures::significant;

/// The fewest crossings of its mean by which a motion has a period.
const CROSSINGS: usize = 4;

/// How far that wanders whose rate has this noise: in a second, between two samples, and over a period of the motion, where it has one.
pub(super) fn meaning(
    density: &StateDensity,
    number: f64,
    interval_s: f64,
    trial: &DiagnosisTrial,
) -> String {
    let StateDensity { wanders, unit, .. } = density;
    let by = |time_s: f64| format!("{} {unit}", short((number * time_s).sqrt()));
    let samples = format!("{wanders} wanders by {} in one second (standard deviation)", by(1.0));
    match period_s(&trial.answer_time_s, &trial.answer) {
        Some(period_s) => format!(
            "{samples}, by {} between two samples, and by {} over one period of the motion at {} Hz",
            by(interval_s),
            by(period_s),
            significant(period_s.recip())
        ),
        None => format!("{samples}, and by {} between two samples", by(interval_s)),
    }
}

/// Three digits, with an exponent where there would be many zeros.
fn short(number: f64) -> String {
    if (1e-3..1e6).contains(&number) { significant(number) } else { format!("{number:.2e}") }
}

/// The mean time between every second crossing of its mean, where noise is no crossing of its own: once left, the mean is crossed anew only
/// from beyond a quarter of the standard deviation.
fn period_s(times: &[f64], values: &[f64]) -> Option<f64> {
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count;
    let sd = (values.iter().map(|value| (value - mean) * (value - mean)).sum::<f64>() / count).sqrt();
    let (mut is_above, mut crossings) = (None, Vec::new());
    for (time, value) in times.iter().zip(values) {
        let beyond = (value - mean).abs() > 0.25 * sd;
        if beyond && is_above != Some(*value > mean) {
            is_above = Some(*value > mean);
            crossings.push(*time);
        }
    }
    // The first is where the samples begin.
    let (first, last) = (crossings.get(1)?, crossings.last()?);
    let halves = crossings.len().checked_sub(2).filter(|halves| *halves >= CROSSINGS)?;
    Some(2.0 * (last - first) / halves as f64).filter(|period| *period > 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sine_has_its_period_and_a_slope_none() {
        let times: Vec<f64> = (0..1000).map(|k| 1e-3 * f64::from(k)).collect();
        let sine: Vec<f64> = times.iter().map(|t| 3.0 + f64::sin(std::f64::consts::TAU * 20.0 * t)).collect();
        assert!((period_s(&times, &sine).unwrap() * 20.0 - 1.0).abs() < 2e-3);
        assert_eq!(period_s(&times, &times), None);
        assert_eq!(period_s(&[], &[]), None);
    }
}
