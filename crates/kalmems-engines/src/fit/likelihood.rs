//! Maximum likelihood of innovations.

use super::triangle::Triangle;
use kalmems_core::Portable;

/// Innovations ν of a filter and their variances S, in the order of time; what is not finite is no update.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Innovations {
    /// Measured minus predicted, in the unit of the signal.
    pub value: Vec<f64>,
    /// The variance that the filter gives each of them.
    pub variance: Vec<f64>,
}

impl Innovations {
    /// Σ ln p(ν) = −½ Σ (ν²/S + ln 2πS) over those that are updates.
    pub fn log_likelihood(&self) -> f64 {
        let each = self.value.iter().zip(&self.variance).map(|(value, variance)| {
            -0.5 * (value * value / variance + (2.0 * std::f64::consts::PI * variance).portable_ln())
        });
        each.filter(|l| l.is_finite()).sum()
    }
}

impl Innovations {
    /// Each in units of its standard deviation.
    pub fn in_sd(&self) -> Vec<f64> {
        self.value.iter().zip(&self.variance).map(|(value, variance)| value / variance.sqrt()).collect()
    }

    /// The slope of each prediction by a parameter in units of the standard deviation of its innovation, by the innovations of the same
    /// samples with the parameter changed by a step; not finite of what is no update in one of both.
    pub fn slopes_in_sd(&self, there: &Self, step: f64) -> Vec<f64> {
        let own = self.value.iter().zip(&self.variance);
        own.zip(&there.value)
            .map(|((own, variance), there)| (own - there) / (step * variance.sqrt()))
            .collect()
    }
}

/// What innovations say of one parameter to first order.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InnovationScore {
    /// The slope of Σ ln p by the parameter.
    pub gradient: f64,
    /// What they tell of it, Σ ν'ν'/S + S'S'/2S²: the inverse of the variance with which they determine it alone.
    pub information: f64,
}

impl Innovations {
    /// By the innovations of the same samples with the parameter changed by a step. What is no update in one of both does not count.
    pub fn score(&self, there: &Self, step: f64) -> InnovationScore {
        let mut score = InnovationScore { gradient: 0.0, information: 0.0 };
        let own = self.value.iter().zip(&self.variance);
        for ((value, variance), (value_there, variance_there)) in
            own.zip(there.value.iter().zip(&there.variance))
        {
            let (slope, relative) =
                ((value_there - value) / step, (variance_there - variance) / (step * variance));
            let gradient = 0.5 * relative * (value * value / variance - 1.0) - value * slope / variance;
            let information = slope * slope / variance + 0.5 * relative * relative;
            if gradient.is_finite() && information.is_finite() {
                score.gradient += gradient;
                score.information += information;
            }
        }
        score
    }
}

impl AsRef<Self> for Innovations {
    fn as_ref(&self) -> &Self {
        self
    }
}

/// Parameters that make innovations the likeliest, with the run of the filter that has them.
#[derive(Clone, Debug, PartialEq)]
pub struct MostLikely<const P: usize, R = Innovations> {
    /// The parameters.
    pub at: [f64; P],
    /// Their standard errors by the information that the innovations hold; infinite of what they do not determine.
    pub sd: [f64; P],
    /// The correlations of their errors; zero beside what the innovations do not determine.
    pub correlation: [[f64; P]; P],
    /// Σ ln p of the innovations there.
    pub log_likelihood: f64,
    /// What ln p would still gain where the search ended: less than 0.005 at a maximum. By the slope and the information at the end of where
    /// `filter` can be run, and what the last step has gained where there were no more of them. What the slope promises is not counted if each
    /// step that it proposes was run and is less likely: where a gate takes a sample in or leaves it out, ln p has kinks and jumps.
    pub promised: f64,
    /// What `filter` gave there.
    pub run: R,
}

/// What is predicted to be gained below which the maximum is reached, in units of ln p: a tenth of a standard error.
const NEAR: f64 = 0.005;

/// Iterations at most; each but the first doubles the digits.
const ITERATIONS: usize = 12;

/// Attempts to find a step that gains anything.
const ATTEMPTS: usize = 6;

/// The parameters, near these, that make the innovations of a filter the likeliest: Fisher's scoring, damped as Levenberg and
/// Marquardt do it (Gupta & Mehra, IEEE Transactions on Automatic Control 19, 774, 1974).
///
/// With ν and S and their derivatives ν' and S' by a parameter the gradient of −ln p is Σ νν'/S + S'(1 − ν²/S)/2S, and the
/// information Σ ν'ν'/S + S'S'/2S². Both are those of a least-squares problem with two rows for each innovation. The
/// derivatives are differences over `steps` at first, then over a third of a standard error.
///
/// `filter` runs the filter with some parameters, and gives `None` where it cannot: as many innovations at each call. `None`
/// where it cannot at the start.
pub fn most_likely<const P: usize, R: AsRef<Innovations>>(
    start: [f64; P],
    mut steps: [f64; P],
    filter: &mut dyn FnMut(&[f64; P]) -> Option<R>,
) -> Option<MostLikely<P, R>> {
    let (mut at, mut run) = (start, filter(&start)?);
    let mut likelihood = run.as_ref().log_likelihood();
    let (mut damping, mut sd, mut correlation) = (0.0, [f64::INFINITY; P], [[0.0; P]; P]);
    let mut promised = f64::INFINITY;
    // Whether the steps that were last given up for shorter ones are some with which the filter cannot be run.
    let mut is_obstructed = false;
    for _ in 0..ITERATIONS {
        let slopes = slopes(&at, run.as_ref(), &steps, filter);
        let mut triangle = triangle(run.as_ref(), &slopes);
        let norms = triangle.column_norms();
        hold_what_has_no_effect(&mut triangle, &norms);
        (sd, correlation) = errors(&triangle, &norms);
        for (step, norm) in steps.iter_mut().zip(norms) {
            *step = if norm > 0.0 { step.min(0.3 / norm) } else { *step };
        }
        let gain = |by: &[f64; P]| -0.5 * by.iter().zip(triangle.gradient()).map(|(d, g)| d * g).sum::<f64>();
        let by_slope = gain(&triangle.solve());
        let mut gained = None;
        for attempt in 0..ATTEMPTS {
            let by = damped(&triangle, &norms, damping).solve();
            if gain(&by) < NEAR {
                promised = if is_obstructed { by_slope } else { gain(&by) };
                return Some(MostLikely { at, sd, correlation, log_likelihood: likelihood, promised, run });
            }
            let mut next = at;
            next.iter_mut().zip(by).for_each(|(x, d)| *x += d);
            let there = filter(&next);
            let can_be_run = there.is_some();
            if let Some(there) = there {
                let found = there.as_ref().log_likelihood();
                if found > likelihood {
                    gained = Some(found - likelihood);
                    (at, run, likelihood) = (next, there, found);
                    damping *= 0.1;
                    break;
                }
            }
            is_obstructed = !can_be_run || (attempt > 0 && is_obstructed);
            damping = f64::max(10.0 * damping, 0.1);
        }
        promised = if is_obstructed { by_slope } else { gained.unwrap_or(0.0) };
        if gained.is_none() {
            break;
        }
    }
    Some(MostLikely { at, sd, correlation, log_likelihood: likelihood, promised, run })
}

/// ν' and S' by each parameter; nothing of one by which the filter cannot be run.
fn slopes<const P: usize, R: AsRef<Innovations>>(
    at: &[f64; P],
    own: &Innovations,
    steps: &[f64; P],
    filter: &mut dyn FnMut(&[f64; P]) -> Option<R>,
) -> [Innovations; P] {
    std::array::from_fn(|i| {
        let mut beside = |step: f64| {
            let mut there = *at;
            there[i] += step;
            filter(&there).map(|run| (run, step))
        };
        let Some((there, step)) = beside(steps[i]).or_else(|| beside(-steps[i])) else {
            return Innovations::default();
        };
        let there = there.as_ref();
        let slope = |there: &[f64], own: &[f64]| there.iter().zip(own).map(|(b, a)| (b - a) / step).collect();
        Innovations {
            value: slope(&there.value, &own.value),
            variance: slope(&there.variance, &own.variance),
        }
    })
}

/// The least-squares problem of one step.
fn triangle<const P: usize>(own: &Innovations, slopes: &[Innovations; P]) -> Triangle<P> {
    let mut triangle = Triangle::new();
    for (k, (value, variance)) in own.value.iter().zip(&own.variance).enumerate() {
        let of = |all: &[f64]| all.get(k).copied().filter(|slope| slope.is_finite()).unwrap_or(0.0);
        let (sd, z) = (variance.sqrt(), value / variance.sqrt());
        if !z.is_finite() {
            continue;
        }
        triangle.push(std::array::from_fn(|i| of(&slopes[i].value) / sd), z);
        let relative = 1.0 / (std::f64::consts::SQRT_2 * variance);
        let excess = (1.0 - z * z) * std::f64::consts::FRAC_1_SQRT_2;
        triangle.push(std::array::from_fn(|i| of(&slopes[i].variance) * relative), excess);
    }
    triangle
}

/// The same with steps that are long against the lengths of the columns made dear.
fn damped<const P: usize>(triangle: &Triangle<P>, norms: &[f64; P], damping: f64) -> Triangle<P> {
    let mut damped = *triangle;
    for (i, norm) in norms.iter().enumerate() {
        let mut row = [0.0; P];
        row[i] = damping.sqrt() * norm;
        damped.push(row, 0.0);
    }
    damped
}

/// Holds each parameter that changes no innovation where it is, so that the others are found all the same.
fn hold_what_has_no_effect<const P: usize>(triangle: &mut Triangle<P>, norms: &[f64; P]) {
    for (i, _) in norms.iter().enumerate().filter(|(_, norm)| **norm == 0.0) {
        let mut row = [0.0; P];
        row[i] = 1.0;
        triangle.push(row, 0.0);
    }
}

/// Roots of the diagonal of (RᵀR)⁻¹, and what is left of it when rows and columns are divided by them; infinite and uncorrelated
/// of what has no effect.
fn errors<const P: usize>(triangle: &Triangle<P>, norms: &[f64; P]) -> ([f64; P], [[f64; P]; P]) {
    let determined = (0..P).all(|i| triangle.r[i][i] != 0.0);
    if !determined {
        return ([f64::INFINITY; P], [[0.0; P]; P]);
    }
    let columns: [[f64; P]; P] = std::array::from_fn(|i| {
        let mut unit = [0.0; P];
        unit[i] = 1.0;
        triangle.solve_transposed(&unit)
    });
    let product =
        |i: usize, j: usize| -> f64 { columns[i].iter().zip(&columns[j]).map(|(a, b)| a * b).sum() };
    let sd: [f64; P] =
        std::array::from_fn(|i| if norms[i] == 0.0 { f64::INFINITY } else { product(i, i).sqrt() });
    (sd, std::array::from_fn(|i| std::array::from_fn(|j| product(i, j) / (sd[i] * sd[j]))))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Numbers of zero mean and variance 1: sums of twelve of a linear congruential generator.
    fn noise() -> impl FnMut() -> f64 {
        let mut state = 5_u64;
        let mut uniform = move || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1_u64 << 53) as f64
        };
        move || (0..12).map(|_| uniform()).sum::<f64>() - 6.0
    }

    /// y = a·sin t + noise of variance v: innovations of the filter that is told a and v. Both have closed maxima.
    #[test]
    fn mean_and_variance_are_those_of_the_closed_form() {
        let mut noise = noise();
        let basis: Vec<f64> = (0..4000).map(|k| (0.05 * f64::from(k)).sin()).collect();
        let data: Vec<f64> = basis.iter().map(|s| 1.7 * s + 0.3 * noise()).collect();
        let square: f64 = basis.iter().map(|s| s * s).sum();
        let a = basis.iter().zip(&data).map(|(s, y)| s * y).sum::<f64>() / square;
        let v = basis.iter().zip(&data).map(|(s, y)| (y - a * s).powi(2)).sum::<f64>() / 4000.0;
        let mut filter = |at: &[f64; 2]| {
            let value = basis.iter().zip(&data).map(|(s, y)| y - at[0] * s).collect();
            Some(Innovations { value, variance: vec![at[1].exp(); basis.len()] })
        };
        let found = most_likely([1.0, 0.0], [1e-3, 1e-3], &mut filter).unwrap();
        let expected_sd = [(v / square).sqrt(), (2.0_f64 / 4000.0).sqrt()];
        for ((found, expected), sd) in found.at.iter().zip([a, v.ln()]).zip(expected_sd) {
            assert!((found - expected).abs() < 0.1 * sd, "{found} {expected}");
        }
        for (found, expected) in found.sd.iter().zip(expected_sd) {
            assert!((found / expected - 1.0).abs() < 0.02, "{found} {expected}");
        }
        // Mean and variance of a Gaussian are estimated independently of one another.
        assert!(found.correlation[0][1].abs() < 0.02 && (found.correlation[1][1] - 1.0).abs() < 1e-12);
    }

    /// y = a + noise of variance v: the slope of Σ ln p by a is Σ (y − a)/v, and the information n/v.
    #[test]
    fn the_score_of_a_mean_is_that_of_the_closed_form() {
        let mut noise = noise();
        let data: Vec<f64> = (0..500).map(|_| 1.7 + 0.3 * noise()).collect();
        let with = |a: f64| Innovations {
            value: data.iter().map(|y| y - a).chain([f64::NAN]).collect(),
            variance: vec![0.09; 501],
        };
        let score = with(1.5).score(&with(1.51), 0.01);
        let gradient = data.iter().map(|y| (y - 1.5) / 0.09).sum::<f64>();
        assert!((score.gradient / gradient - 1.0).abs() < 1e-9, "{score:?} {gradient}");
        assert!((score.information / (500.0 / 0.09) - 1.0).abs() < 1e-9, "{score:?}");
        // And by the variance: n/2v of information for its logarithm's square.
        let wider = Innovations { variance: vec![0.09 * 1.001; 501], ..with(1.7) };
        let score = with(1.7).score(&wider, 0.001);
        assert!((score.information / 250.0 - 1.0).abs() < 1e-9, "{score:?}");
    }

    /// 100 samples of mean 1 and variance 1 around a, and one more whose innovation jumps from −2 to 3 where a passes 0.905, as that of a sample
    /// does that a gate takes in there. Below, ln p rises by 0.45 to the maximum without the jump, and falls by 2.5 at it.
    #[test]
    fn a_rise_that_no_step_finds_is_not_promised() {
        let with = |a: f64| {
            let of_gate = if a < 0.905 { -2.0 } else { 3.0 };
            let value = (0..100).map(|k| f64::from(2 * (k % 2)) - a).chain([of_gate]).collect();
            Some(Innovations { value, variance: vec![1.0; 101] })
        };
        let found = most_likely([0.8], [0.03], &mut |at: &[f64; 1]| with(at[0])).unwrap();
        assert!((0.89..0.905).contains(&found.at[0]) && found.promised < 0.05, "{found:?}");
        // Where the filter cannot be run, what the slope promises stands.
        let mut ends = |at: &[f64; 1]| if at[0] < 0.905 { with(at[0]) } else { None };
        let found = most_likely([0.8], [0.03], &mut ends).unwrap();
        assert!((0.89..0.905).contains(&found.at[0]) && found.promised > 0.3, "{found:?}");
    }

    #[test]
    fn what_is_not_determined_has_no_standard_error() {
        let mut filter = |at: &[f64; 2]| {
            let value = (0..100).map(|k| f64::from(k % 7) - 3.0 - at[0] - at[1]).collect();
            Some(Innovations { value, variance: vec![1.0; 100] })
        };
        let found = most_likely([0.0, 0.0], [0.1, 0.1], &mut filter).unwrap();
        assert!(found.sd.iter().all(|sd| *sd > 1e3), "{found:?}");
        assert!(most_likely([0.0], [0.1], &mut |_| None::<Innovations>).is_none());
    }

    #[test]
    fn what_has_no_effect_does_not_keep_the_others_from_being_found() {
        let mut filter = |at: &[f64; 2]| {
            let value = (0..100).map(|k| f64::from(k % 7) - at[0]).collect();
            Some(Innovations { value, variance: vec![1.0; 100] })
        };
        let found = most_likely([0.0, 5.0], [0.1, 0.1], &mut filter).unwrap();
        let mean = (0..100).map(|k| f64::from(k % 7)).sum::<f64>() / 100.0;
        assert!((found.at[0] - mean).abs() < 0.02 && (found.sd[0] - 0.1).abs() < 1e-9, "{found:?}");
        assert_eq!((found.at[1], found.sd[1]), (5.0, f64::INFINITY));
    }
}
