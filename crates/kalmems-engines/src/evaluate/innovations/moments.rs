//! Sums over the normalised innovations, and what they say of their level, size and distribution.

use super::{InnovationTest, TestPlace, TestResult, normal_tail};
use kalmems_core::Portable;
use statrs::distribution::{ChiSquared, ContinuousCDF};

/// Sums over normalised innovations z.
#[derive(Clone, Debug, Default)]
pub struct InnovationMoments {
    /// How many.
    pub count: f64,
    /// Σ z, Σ z², Σ z³ and Σ z⁴.
    powers: [f64; 4],
    /// The largest |z|, and its time in s.
    largest: (f64, f64),
}

/// Standard deviations by which the mean NIS of a careful filter is below 1: the lower end of its 95 % interval, below which that of a right one is
/// once in forty times.
const CAREFUL: f64 = 1.96;

/// Fewer values say nothing of the shape of a distribution; the approximations below hold from here on.
const FEWEST: f64 = 200.0;

impl InnovationMoments {
    /// Takes an innovation in.
    #[inline]
    pub fn take(&mut self, time_s: f64, z: f64) {
        let square = z * z;
        self.count += 1.0;
        for (sum, term) in self.powers.iter_mut().zip([z, square, square * z, square * square]) {
            *sum += term;
        }
        if z.abs() > self.largest.0 {
            self.largest = (z.abs(), time_s);
        }
    }

    /// The mean of z.
    pub fn mean(&self) -> f64 {
        self.powers[0] / self.count
    }

    /// The mean of z²: the mean NIS of one channel.
    pub fn mean_square(&self) -> f64 {
        self.powers[1] / self.count
    }

    /// The variance of z², as measured: 2 of a normal distribution with unit variance.
    pub fn variance_of_squares(&self) -> f64 {
        self.powers[3] / self.count - self.mean_square().powi(2)
    }

    /// Whether the innovations are larger than claimed: n·NIS is χ² with n degrees of freedom of a filter that is right.
    /// The upper tail alone: smaller ones are those of a careful filter.
    pub fn size(&self) -> Option<TestResult> {
        let chi = ChiSquared::new(self.count).ok()?;
        let (test, mean) = (InnovationTest::MeanNis, self.mean_square());
        Some(TestResult { test, p_value: chi.sf(self.powers[1]), size: mean, place: None, signal: None })
    }

    /// The same where nothing is known of how the innovations are correlated: as if they were all one.
    pub fn size_of_one(&self) -> Option<TestResult> {
        let found = self.size()?;
        Some(TestResult { p_value: ChiSquared::new(1.0).ok()?.sf(found.size), ..found })
    }

    /// Whether the distribution is normal: skewness and kurtosis, each made normal, in one sum of squares (D'Agostino
    /// & Pearson, Biometrika 60, 613, 1973; D'Agostino, Biometrika 57, 679, 1970; Anscombe & Glynn, Biometrika 70, 227,
    /// 1983). The test of Jarque and Bera has the same two numbers, and a law that is much too lax far out.
    ///
    /// `share` is how many of the innovations count, where they are correlated.
    pub fn shape(&self, share: f64) -> Option<TestResult> {
        let n = self.count * share;
        let (stated, excess) = (n >= FEWEST).then(|| self.shape_by_law(n))?;
        let p_value = calibrated(stated, n);
        Some(TestResult { test: InnovationTest::Shape, p_value, size: excess, place: None, signal: None })
    }

    /// The probability that the law of χ² states of the shape of n numbers, which is exact in the middle alone, and their excess
    /// kurtosis.
    pub fn shape_by_law(&self, n: f64) -> (f64, f64) {
        let [m1, r2, r3, r4] = self.powers.map(|sum| sum / self.count);
        let m2 = r2 - m1 * m1;
        let m3 = r3 - 3.0 * m1 * r2 + 2.0 * m1.powi(3);
        let m4 = r4 - 4.0 * m1 * r3 + 6.0 * m1 * m1 * r2 - 3.0 * m1.powi(4);
        let (skewness, kurtosis) = (m3 / m2.portable_powf(1.5), m4 / (m2 * m2));
        let statistic = normal_skewness(skewness, n).powi(2) + normal_kurtosis(kurtosis, n).powi(2);
        // That of two degrees of freedom.
        ((-0.5 * statistic).portable_exp(), kurtosis - 3.0)
    }

    /// Whether the filter claims larger innovations than it has, by more than chance. That is no fault, but its innovations are neither white nor
    /// of one variance then, and are held against the claim alone.
    pub fn are_careful(&self) -> bool {
        // Heavy tails make a mean square vary by more than normal numbers do.
        let variance = self.variance_of_squares().max(2.0);
        self.mean_square() < 1.0 - CAREFUL * (variance / self.count).sqrt()
    }

    /// Whether the largest innovation is one of a normal distribution of their measured size, or of the claimed one where that is
    /// larger.
    pub fn outlier(&self) -> Option<TestResult> {
        if self.count < FEWEST {
            return None;
        }
        let (largest, at_s) = self.largest;
        let size = largest / self.mean_square().max(1.0).sqrt();
        let p_value = (2.0 * self.count * normal_tail(size)).min(1.0);
        Some(TestResult {
            test: InnovationTest::Outlier,
            p_value,
            size,
            place: Some(TestPlace::Time { at_s }),
            signal: None,
        })
    }
}

/// How probable a statistic of the shape is of n normal numbers, for which the law of χ² states this probability.
///
/// Both numbers are nearly normal, but not far out, and not independent. The difference in decades was taken from simulated normal
/// numbers (`slow_the_test_of_shape_fails_as_often_as_it_says`): of 500 the law states 10⁻⁶ for what happens 4·10⁻⁵ times.
fn calibrated(stated: f64, n: f64) -> f64 {
    let decades = -stated.max(f64::MIN_POSITIVE).portable_log10();
    let missing = 0.35 * (1.0 + n / 2000.0).portable_powf(-1.1) * (decades - 2.0).max(0.0).portable_powf(1.3);
    10.0_f64.portable_powf((missing - decades).min(0.0))
}

/// A skewness of n normal numbers as a standard normal number (D'Agostino 1970).
fn normal_skewness(skewness: f64, n: f64) -> f64 {
    let y = skewness * ((n + 1.0) * (n + 3.0) / (6.0 * (n - 2.0))).sqrt();
    let beta = 3.0 * (n * n + 27.0 * n - 70.0) * (n + 1.0) * (n + 3.0)
        / ((n - 2.0) * (n + 5.0) * (n + 7.0) * (n + 9.0));
    let w = (2.0 * (beta - 1.0)).sqrt() - 1.0;
    let scaled = y / (2.0 / (w - 1.0)).sqrt();
    scaled.portable_asinh() / (0.5 * w.portable_ln()).sqrt()
}

/// A kurtosis of n normal numbers, 3 on average, as a standard normal number (Anscombe & Glynn 1983).
fn normal_kurtosis(kurtosis: f64, n: f64) -> f64 {
    let mean = 3.0 * (n - 1.0) / (n + 1.0);
    let variance = 24.0 * n * (n - 2.0) * (n - 3.0) / ((n + 1.0).powi(2) * (n + 3.0) * (n + 5.0));
    let x = (kurtosis - mean) / variance.sqrt();
    let skewness = 6.0 * (n * n - 5.0 * n + 2.0) / ((n + 7.0) * (n + 9.0))
        * (6.0 * (n + 3.0) * (n + 5.0) / (n * (n - 2.0) * (n - 3.0))).sqrt();
    let a = 6.0 + 8.0 / skewness * (2.0 / skewness + (1.0 + 4.0 / (skewness * skewness)).sqrt());
    let below = 1.0 + x * (2.0 / (a - 4.0)).sqrt();
    let root = ((1.0 - 2.0 / a) / below.abs()).portable_cbrt().copysign(below);
    (1.0 - 2.0 / (9.0 * a) - root) / (2.0 / (9.0 * a)).sqrt()
}
