//! What innovations say of numbers to first order: what one of them promises to gain by itself, and two of them together.

use crate::fit::Innovations;

/// The change of each innovation and of its variance for one unit of a number, over what they are claimed to vary by; and the innovations in the
/// same form.
pub(super) struct NumberSlopes {
    rows: Vec<f64>,
    gradient: f64,
    information: f64,
}

/// What a number or two promise: the sizes, and what ln p gains by them.
pub(super) struct SlopePromise<const N: usize> {
    pub(super) sizes: [f64; N],
    pub(super) gain: f64,
}

/// The part of the information on each of two numbers that has to remain beside the other one: those below are one number to the recording.
const DISTINCT: f64 = 1e-4;

impl NumberSlopes {
    /// By the innovations of the same samples with the number changed by a step; `None` of one that changes nothing.
    pub(super) fn of(own: &Innovations, there: &Innovations, step: f64) -> Option<Self> {
        let score = own.score(there, step);
        let mut rows = own.slopes_in_sd(there, step);
        let of_variance = own.variance.iter().zip(&there.variance);
        rows.extend(
            of_variance.map(|(own, there)| (there - own) / (step * own) * -std::f64::consts::FRAC_1_SQRT_2),
        );
        // What is no update in one of both does not count.
        let (first, second) = rows.split_at_mut(own.value.len());
        for (a, b) in first.iter_mut().zip(second) {
            if !(a.is_finite() && b.is_finite()) {
                (*a, *b) = (0.0, 0.0);
            }
        }
        let (gradient, information) = (score.gradient, score.information);
        (information > 0.0).then_some(Self { rows, gradient, information })
    }

    /// g/I, and g²/2I.
    pub(super) fn alone(&self) -> SlopePromise<1> {
        let size = self.gradient / self.information;
        SlopePromise { sizes: [size], gain: 0.5 * self.gradient * size }
    }

    /// The same of two numbers together; `None` of two that are one to the recording.
    pub(super) fn with(&self, other: &Self) -> Option<SlopePromise<2>> {
        let both: f64 = self.rows.iter().zip(&other.rows).map(|(a, b)| a * b).sum();
        let [a, b] = [self.information, other.information];
        let determinant = a * b - both * both;
        let sizes = [
            (b * self.gradient - both * other.gradient) / determinant,
            (a * other.gradient - both * self.gradient) / determinant,
        ];
        let gain = 0.5 * (sizes[0] * self.gradient + sizes[1] * other.gradient);
        (determinant > DISTINCT * a * b).then_some(SlopePromise { sizes, gain })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// y = 0.5·a + 2·b + noise of variance 1 over two signals that are orthogonal to each other, so that the likeliest sizes are those of least squares.
    #[test]
    fn two_numbers_promise_what_least_squares_gains() {
        let basis =
            |k: u32| [(0.05 * f64::from(k)).sin(), (0.05 * f64::from(k)).cos() + (0.05 * f64::from(k)).sin()];
        let noise = |k: u32| 1.4 * (f64::from(k) * 1.7).sin();
        let with = |a: f64, b: f64| Innovations {
            value: (0..4000).map(|k| noise(k) + (0.5 - a) * basis(k)[0] + (2.0 - b) * basis(k)[1]).collect(),
            variance: vec![1.0; 4000],
        };
        let own = with(0.0, 0.0);
        let [a, b] =
            [with(1e-3, 0.0), with(0.0, 1e-3)].map(|there| NumberSlopes::of(&own, &there, 1e-3).unwrap());
        let found = a.with(&b).unwrap();
        for (size, expected) in found.sizes.iter().zip([0.5, 2.0]) {
            assert!((size - expected).abs() < 0.05, "{:?}", found.sizes);
        }
        let gained = with(found.sizes[0], found.sizes[1]).log_likelihood() - own.log_likelihood();
        assert!((found.gain / gained - 1.0).abs() < 1e-6, "{} {gained}", found.gain);
        assert!(a.alone().gain < found.gain && a.with(&a).is_none());
    }
}
