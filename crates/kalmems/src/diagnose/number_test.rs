//! Whether innovations ask for another number than the filter is told.

use super::bench::TrialBench;
use super::sensitivity::NumberSensitivity;
use super::suspect::{NumberRole, Suspect};
use super::trial::DiagnosisTrial;
use crate::evaluate::{InnovationTest, TestPlace, TestResult, normal_tail};

/// Whether a suspect is a direction of the test: what makes another filter of it, or is seen in the variance alone, is none.
pub(super) fn is_tested(suspect: &Suspect) -> bool {
    match &suspect.what {
        NumberRole::Noise { .. } => false,
        NumberRole::LeftOut { left_out, .. } => left_out.filter_switch.is_none(),
        _ => true,
    }
}

/// The score test of each number: with the innovations z in units of their claimed standard deviations, and the slopes s of the
/// predictions in the same unit, Σ s z has the variance Σ s² where the filter is right, as a slope is a function of what came before
/// (Rao, Proceedings of the Cambridge Philosophical Society 44, 50, 1948). A filter whose process noise is larger than the true one has a
/// smaller variance. What is uncertain of the device by its statement adds (Σ s u)² for each independent direction, of which u is the
/// change of the predictions for one standard deviation.
///
/// An innovation that a gate would reject does not count: it tells of a disturbance. `None` without a number.
pub(super) fn number_test(
    base: &DiagnosisTrial,
    numbers: &[NumberSensitivity],
    uncertain: &[Vec<f64>],
) -> Option<TestResult> {
    let z = base.innovations.in_sd();
    let worst = numbers.iter().filter_map(|number| Some((number, deviation(&z, &number.slopes, uncertain)?)));
    let (number, deviation) = worst.max_by(|a, b| a.1.of_sd.abs().total_cmp(&b.1.of_sd.abs()))?;
    let looks = numbers.len() as f64;
    let p_value = (looks * 2.0 * normal_tail(deviation.of_sd.abs())).min(1.0);
    let (name, by) = (number.suspect.name(), number.suspect.size_in_words(deviation.size));
    let place = Some(TestPlace::Number { name, by });
    Some(TestResult {
        test: InnovationTest::Numbers,
        p_value,
        size: deviation.of_sd.abs(),
        place,
        signal: None,
    })
}

/// By how much the innovations ask for another value.
struct Deviation {
    /// In the unit of the number.
    size: f64,
    /// In standard deviations of that.
    of_sd: f64,
}

/// The largest innovation that counts, in standard deviations: beyond it the probability of a normal number is 1e-7.
const LARGEST: f64 = 5.33;

fn deviation(z: &[f64], slopes: &[f64], uncertain: &[Vec<f64>]) -> Option<Deviation> {
    let (mut score, mut information) = (0.0, 0.0);
    let mut across = vec![0.0; uncertain.len()];
    for (k, (z, slope)) in z.iter().zip(slopes).enumerate() {
        if !(z.abs() < LARGEST && slope.is_finite()) {
            continue;
        }
        score += z * slope;
        information += slope * slope;
        for (sum, direction) in across.iter_mut().zip(uncertain) {
            sum += direction.get(k).filter(|u| u.is_finite()).map_or(0.0, |u| slope * u);
        }
    }
    let variance = information + across.iter().map(|sum| sum * sum).sum::<f64>();
    (variance > 0.0).then(|| Deviation { size: score / information, of_sd: score / variance.sqrt() })
}

/// What one standard deviation in each direction of the device's stated uncertainty changes in the predictions, in standard deviations
/// of the innovations; nothing of a direction with which the filter cannot be run.
pub(super) fn uncertain_directions(bench: &TrialBench, base: &DiagnosisTrial) -> Vec<Vec<f64>> {
    let changed = bench.in_uncertain_directions();
    changed.map(|changed| base.innovations.slopes_in_sd(&changed.innovations, 1.0)).collect()
}
