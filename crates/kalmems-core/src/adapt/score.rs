//! Parameters of the noise, or of anything else, by maximum likelihood while filtering.

use crate::linalg::Ldl;
use crate::notation::{lower, sum, vector};
use crate::{Covariance, Dual, Innovation, Scalar};

/// The slope of the log-likelihood with respect to `P` parameters, and how much the data say of them.
///
/// The filter itself runs over [`Dual`] numbers whose variables are the parameters θ: R(θ), Q(θ) and the
/// models are made of them, and every innovation carries its derivatives with it. Summed are the score ∂ ln
/// p(y)/∂θ and Fisher's information in the form of Gupta and Mehra (IEEE Trans. Automatic Control 19, 774,
/// 1974),
///
/// I_ij = Σ ∂rᵀ/∂θᵢ·S⁻¹·∂r/∂θⱼ + ½·tr(S⁻¹·∂S/∂θᵢ·S⁻¹·∂S/∂θⱼ),
///
/// positive semi-definite by construction. θ + I⁻¹·score is the better θ; at the end the diagonal of I⁻¹ is
/// its variance.
///
/// With θ the logarithm of a scale, R(θ) = R₀·e^θ, an estimate is positive whatever the step. The logarithms
/// of a scale of R and of one of Q are found together: the innovations tell the first by their size and the
/// ratio by their correlation in time.
///
/// What cannot be found: two parameters with the same effect (the scales of two noise sources that enter the
/// same combination of states; a gain and the amplitude seen through it); both, or all three, if R, Q and the
/// sensor's unit are free; the scale of Q where nothing of it reaches the sensor within the recording. The
/// information is singular there and [`step`](Self::step) says so. More sources of process noise than one are
/// found as long as their effects on the sensor differ in spectrum.
///
/// ```
/// use kalmems_core::adapt::Score;
/// use kalmems_core::{Covariance, Dual, Ekf, Filter, LinearMeasurement, Mat, Scalar};
/// type D = Dual<f64, 1>;
/// let seen = LinearMeasurement { matrix: Mat([[D::of(1.0)]]) };
/// let mut log_r = 0.0;
/// for _ in 0..8 {
///     let r = Covariance::from_variances([D::variable(log_r, 0).exp()]);
///     let mut filter = Ekf::new([D::of(0.0)], Covariance::from_variances([D::of(1e-12)]));
///     let mut score = Score::new();
///     for k in 0..100 {
///         let y = D::of(if k % 2 == 0 { 0.2 } else { -0.2 });
///         score.add(&filter.update(&seen, &[y], &r)?);
///     }
///     let step = score.step().unwrap();
///     assert!((step.standard_deviation[0] - (2.0 / 100_f64).sqrt()).abs() < 1e-6);
///     log_r += step.change[0].clamp(-1.0, 1.0);
/// }
/// assert!((log_r.exp() - 0.04).abs() < 1e-6);
/// # Ok::<(), kalmems_core::FilterError>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Score<T, const P: usize> {
    score: [T; P],
    information: Covariance<T, P>,
}

/// Where the data point from here.
#[derive(Clone, Copy, Debug)]
pub struct ScoreStep<T, const P: usize> {
    /// I⁻¹·score: what to add to θ. Far from the answer it may be much too long; hold it by
    /// [`Bounds`](super::Bounds) around θ, a factor of e for a scale.
    pub change: [T; P],
    /// The standard deviation of each estimate, when the steps have become short against it.
    pub standard_deviation: [T; P],
}

/// The share of a parameter's information that must be left when the others are unknown as well.
const SEPARABLE: f64 = 1e-6;

impl<T: Scalar, const P: usize> Score<T, P> {
    /// Nothing yet.
    pub fn new() -> Self {
        Self { score: [T::of(0.0); P], information: Covariance::zero() }
    }

    /// Counts one innovation of a filter over dual numbers. One that was refused is not counted.
    #[inline(always)]
    pub fn add<const M: usize>(&mut self, innovation: &Innovation<Dual<T, P>, M>) {
        let s = Covariance::<T, M>::lower(|i, j| innovation.covariance.get(i, j).value());
        let ldl = Ldl::of(&s);
        let usable = ldl.positive & innovation.nis.value().is_finite();
        let roots = ldl.diagonal.map(|d| d.sqrt().recip());
        let white = |v: &[T; M]| -> [T; M] {
            let v = ldl.decorrelate(v);
            vector!(|i| v[i] * roots[i])
        };
        let residuals: [[T; M]; P] = vector!(|p| white(&vector!(|m| innovation.residual[m].gradient()[p])));
        // D^{-1/2}·L⁻¹·∂S·L⁻ᵀ·D^{-1/2}: first the columns, then the rows, of a symmetric matrix.
        let spreads: [[[T; M]; M]; P] = vector!(|p| {
            let half: [[T; M]; M] =
                vector!(|j| white(&vector!(|i| innovation.covariance.get(i, j).gradient()[p])));
            vector!(|i| white(&vector!(|j| half[j][i])))
        });
        let gradient = innovation.log_likelihood().gradient();
        let zero = T::of(0.0);
        self.score = vector!(|p| self.score[p] + T::select(usable, gradient[p], zero));
        self.information = lower!(|p, q| {
            let mean = sum!(M, |i| residuals[p][i] * residuals[q][i]);
            let spread = sum!(M, |i| sum!(M, |j| spreads[p][i][j] * spreads[q][i][j])).half();
            self.information.get(p, q) + T::select(usable, mean + spread, zero)
        });
    }

    /// ∂ ln p(y)/∂θ.
    pub const fn score(&self) -> &[T; P] {
        &self.score
    }

    /// I.
    pub const fn information(&self) -> &Covariance<T, P> {
        &self.information
    }
}

impl<T: Scalar, const P: usize> Score<T, P> {
    /// One step of the scoring method; none where the data do not tell the parameters apart.
    ///
    /// That is where some parameter keeps less than a millionth of its information when those before it are
    /// unknown.
    pub fn step(&self) -> Option<ScoreStep<T, P>> {
        // In units of each parameter's own standard deviation.
        let units: [T; P] = vector!(|p| self.information.get(p, p).sqrt().recip());
        let ldl = Ldl::of(&Covariance::<T, P>::lower(|p, q| {
            if p == q { T::of(1.0) } else { self.information.get(p, q) * units[p] * units[q] }
        }));
        let separable = ldl.diagonal.iter().all(|left| left.gt(T::of(SEPARABLE)));
        let told = units.iter().all(|unit| unit.is_finite());
        if !(separable && told && ldl.positive) {
            return None;
        }
        let change = ldl.solve(&vector!(|p| self.score[p] * units[p]));
        Some(ScoreStep {
            change: vector!(|p| change[p] * units[p]),
            standard_deviation: vector!(|p| {
                let column = ldl.solve(&vector!(|q| T::of(if p == q { 1.0 } else { 0.0 })));
                column[p].sqrt() * units[p]
            }),
        })
    }
}

impl<T: Scalar, const P: usize> Default for Score<T, P> {
    fn default() -> Self {
        Self::new()
    }
}
