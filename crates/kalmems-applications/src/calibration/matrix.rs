//! Scale factors and cross-axis terms from phasors.

use crate::fit::{Fit, FitError, FitSettings, Regression, fit};
use crate::signal::PortableComplex;
use kalmems_core::{Dual, Mat, Portable, Scalar, Svd};
use kalmems_models::inertial::Alignment;
use realfft::num_complex::Complex64;
use statrs::distribution::{ChiSquared, ContinuousCDF};

/// A record: the rate that there was and what the gyroscope showed of it, each on a clock of its own.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RatePair {
    /// The phasors of the reference's rates in rad/s; 0 where it shows no axis.
    pub reference: [Complex64; 3],
    /// The standard deviation of either part of them.
    pub reference_deviation: [f64; 3],
    /// The phasors of the gyroscope, where it has the axis.
    pub shown: [Option<Complex64>; 3],
    /// The standard deviation of either part of them.
    pub shown_deviation: [f64; 3],
}

/// K of Ω_I = K·Ω, as far as the records tell it.
#[derive(Clone, Debug)]
pub struct CalibrationMatrix {
    fit: Fit<9>,
    /// What makes of the fit's covariance that of the noise as it is known: below 1 where records scatter by more.
    by_noise: f64,
    free: [bool; 9],
    /// By how much the phase of each record's gyroscope is ahead, in rad: its clock began when it wanted.
    pub turn_rad: Vec<f64>,
    /// The sum of squared residuals, each by its standard deviation.
    pub chi_square: f64,
    /// Residuals less parameters and less one phase for each record.
    pub freedom: usize,
    /// The singular values of the reference's rates over all records, in rad/s rms, largest first, and the direction of
    /// each: what is near 0 was not excited.
    pub excitation: Vec<(f64, [f64; 3])>,
    /// The part of the scale factor's variance by noise that is the gyroscope's, the rest being the reference's.
    pub shown_part: f64,
    /// What K leaves of the gyroscope's phasors, root mean square over all records by that of the phasors.
    pub left: f64,
}

/// A residual that no parameter changes: the covariance of a fit is in proportion to its sum of squares, which a single record leaves at 0, and what
/// noise makes of it must not be 0 for that.
const CONSTANT: f64 = 1.0;

/// Beyond this standard deviation an entry of K is not known.
const UNKNOWN: f64 = 0.3;

/// How many times its noise the rate about an axis is at least, root mean square, for the entries of its column to be fitted.
const STANDING_OUT: f64 = 10.0;

/// The part of the gyroscope's phasors that K may leave. What records of one unit scatter is a hundredth of that.
pub(super) const MOST_LEFT: f64 = 0.02;

/// The signs of the diagonal that records of several axes tell apart, those of all axes turned at once being the phase of a clock.
const TURNED: [[f64; 3]; 3] = [[-1.0, 1.0, 1.0], [1.0, -1.0, 1.0], [1.0, 1.0, -1.0]];

impl CalibrationMatrix {
    /// Fits K to records by least squares, each record with a phase of its own, which is what the gyroscope's clock
    /// leaves open.
    ///
    /// Only magnitudes and relative phases count, so that the sign of a column is open where records rotate about one axis each: its diagonal
    /// entry is taken as positive, and a gyroscope mounted upside down shows as one that is not. Where records rotate about several axes at
    /// once and contradict that, the sign is what describes them. An error of the reference enters with K times its standard deviation.
    pub fn fit(pairs: &[RatePair], axes_of_reference: [bool; 3]) -> Result<Self, FitError> {
        let upright = Self::from_signs(pairs, axes_of_reference, [1.0; 3])?;
        if upright.left <= MOST_LEFT {
            return Ok(upright);
        }
        let turned = TURNED.map(|signs| Self::from_signs(pairs, axes_of_reference, signs).ok());
        let best = turned.into_iter().flatten().min_by(|a, b| a.left.total_cmp(&b.left));
        Ok(best.filter(|best| best.left < 0.5 * upright.left).unwrap_or(upright))
    }

    /// The fit that begins with a diagonal of these signs.
    fn from_signs(
        pairs: &[RatePair],
        axes_of_reference: [bool; 3],
        signs: [f64; 3],
    ) -> Result<Self, FitError> {
        let rows: [bool; 3] = std::array::from_fn(|i| pairs.iter().all(|pair| pair.shown[i].is_some()));
        let columns = excited(pairs, axes_of_reference);
        let free: [bool; 9] = std::array::from_fn(|k| rows[k / 3] && columns[k % 3]);
        let mut start = [0.0; 9];
        for axis in (0..3).filter(|axis| free[4 * axis]) {
            let size = |of: &dyn Fn(&RatePair) -> f64| pairs.iter().map(of).sum::<f64>();
            let along = size(&|pair| {
                pair.reference[axis].portable_norm() * pair.shown[axis].map_or(0.0, Complex64::portable_norm)
            });
            let square = size(&|pair| pair.reference[axis].norm_sqr()).max(f64::MIN_POSITIVE);
            start[4 * axis] = signs[axis] * along / square;
        }
        let settings = FitSettings { free, ..FitSettings::from_start(start) };
        // The weights hold K: twice is enough, as they depend on it weakly.
        let mut found = fit(&MatrixResiduals { pairs, at: start }, &settings)?;
        found = fit(
            &MatrixResiduals { pairs, at: found.parameters },
            &FitSettings { start: found.parameters, ..settings },
        )?;
        let records = MatrixResiduals { pairs, at: found.parameters };
        let freedom = found.degrees_of_freedom.saturating_sub(pairs.len() + 1);
        let by_noise = found.degrees_of_freedom.max(1) as f64 / found.sum_of_squares.max(f64::MIN_POSITIVE);
        Ok(Self {
            turn_rad: pairs.iter().map(|pair| records.turn(pair, &found.parameters).portable_arg()).collect(),
            chi_square: (found.sum_of_squares - CONSTANT * CONSTANT).max(0.0),
            excitation: excitation(pairs),
            shown_part: shown_part(pairs, &found.parameters),
            left: records.left(&found.parameters),
            by_noise: by_noise.sqrt(),
            fit: found,
            free,
            freedom,
        })
    }

    /// An entry of K with its standard deviation by noise alone; `None` where the records do not tell it.
    pub fn entry(&self, row: usize, column: usize) -> Option<(f64, f64)> {
        let index = 3 * row + column;
        let found = self.fit.parameter(index);
        let deviation = found.deviation * self.by_noise;
        (self.free[index] && deviation < UNKNOWN).then_some((found.value, deviation))
    }

    /// How often noise alone leaves a larger χ²; 1 where nothing is left over.
    pub fn probability(&self) -> f64 {
        ChiSquared::new(self.freedom as f64).map_or(1.0, |law| law.sf(self.chi_square))
    }

    /// The scales, non-orthogonality and mounting, each with its standard deviation by noise; `None` where an entry that
    /// they depend on is not known.
    pub fn alignment(&self) -> Option<[[(f64, f64); 3]; 3]> {
        if !(0..9).all(|k| self.entry(k / 3, k % 3).is_some()) {
            return None;
        }
        let of = |pick: fn(&Alignment<MatrixDual>) -> [MatrixDual; 3]| {
            std::array::from_fn(|i| {
                let derived = self.fit.derived(|k| {
                    pick(&Alignment::of(&[[k[0], k[1], k[2]], [k[3], k[4], k[5]], [k[6], k[7], k[8]]]))[i]
                });
                (derived.value, derived.deviation * self.by_noise)
            })
        };
        Some([of(|a| a.scale), of(|a| a.non_orthogonality), of(|a| a.mounting)])
    }

    /// Of two axes with two columns: the sine of the angle by which they are closer than square, and the angle by which
    /// their case is turned about the third, both to first order in what is not seen; with standard deviations by noise.
    pub fn alignment_in_plane(&self, [a, b]: [usize; 2]) -> Option<[(f64, f64); 2]> {
        if [a, b].iter().any(|i| [a, b].iter().any(|j| self.entry(*i, *j).is_none())) {
            return None;
        }
        let at = |i: usize, j: usize| 3 * i + j;
        let non_orthogonality = self.fit.derived(|k| {
            let first = (k[at(a, a)] * k[at(a, a)] + k[at(a, b)] * k[at(a, b)]).sqrt();
            let second = (k[at(b, a)] * k[at(b, a)] + k[at(b, b)] * k[at(b, b)]).sqrt();
            (k[at(a, a)] * k[at(b, a)] + k[at(a, b)] * k[at(b, b)]) / (first * second)
        });
        let turn = self.fit.derived(|k| k[at(a, b)] / k[at(a, a)]);
        Some([non_orthogonality, turn].map(|found| (found.value, found.deviation * self.by_noise)))
    }

    /// K as an axis of the reference that is tilted mixes it: with 0 for unknown entries beside the diagonal, and for those on it the scale
    /// factor of this axis, as axes of one unit are alike.
    pub fn mixed(&self, main: usize) -> [[f64; 3]; 3] {
        let mut known = self.known();
        let alike = known[main][main];
        for (i, row) in known.iter_mut().enumerate() {
            if self.entry(i, i).is_none() {
                row[i] = alike;
            }
        }
        known
    }

    /// What an axis shows in a record beyond all of K, in phase with the reference's rate about that axis, over what its scale factor makes
    /// of that rate; `None` where the record does not rotate about it. `pairs` are those of the fit.
    pub fn residual(&self, pairs: &[RatePair], record: usize, axis: usize) -> Option<f64> {
        let (pair, turn_rad) = (pairs.get(record)?, self.turn_rad.get(record)?);
        let rate = pair.reference[axis];
        let (sine, cosine) = turn_rad.portable_sin_cos();
        let shown = pair.shown[axis]? * Complex64::new(cosine, -sine);
        let beyond = (shown - product(&self.fit.parameters, axis, &pair.reference)) * rate.conj();
        let expected = self.fit.parameters[4 * axis] * rate.norm_sqr();
        (expected > 0.0).then(|| beyond.re / expected)
    }

    /// K with 0 where it is not known.
    pub fn known(&self) -> [[f64; 3]; 3] {
        std::array::from_fn(|i| std::array::from_fn(|j| self.entry(i, j).map_or(0.0, |(value, _)| value)))
    }
}

/// The fits without one record after the other, for what a number scatters from record to record.
#[derive(Clone, Debug, Default)]
pub struct LeaveOneOut {
    fits: Vec<CalibrationMatrix>,
    /// How many records of equal weight tell of each column.
    effective: [f64; 3],
}

/// A standard uncertainty by what the records scatter (type A).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Repeatability {
    /// The standard uncertainty of the number from all records.
    pub uncertainty: f64,
    /// Its degrees of freedom.
    pub freedom: f64,
}

/// Records that tell of a column at least, by their weights.
const FEWEST_RECORDS: f64 = 1.5;

impl LeaveOneOut {
    /// Of the records of a fit; of none that cannot do without each of its records.
    pub fn of(pairs: &[RatePair], axes_of_reference: [bool; 3]) -> Self {
        if pairs.len() < 2 {
            return Self::default();
        }
        let without = |left_out: usize| {
            let others = pairs.iter().enumerate().filter(|(place, _)| *place != left_out);
            CalibrationMatrix::fit(&others.map(|(_, pair)| *pair).collect::<Vec<_>>(), axes_of_reference)
        };
        let fits: Result<Vec<_>, _> = (0..pairs.len()).map(without).collect();
        let effective = std::array::from_fn(|column| {
            effective_count(pairs.iter().map(|pair| pair.reference[column].norm_sqr()))
        });
        fits.map_or_else(|_| Self::default(), |fits| Self { fits, effective })
    }

    /// The jackknife of a number: n − 1 times the mean square by which it changes without a record (Tukey; for a mean it is s²/n). The degrees of
    /// freedom are those of as many records of equal weight as tell of these columns. `None` where the number is not known without one of the
    /// records, or one record has nearly all the weight.
    pub fn repeatability(
        &self,
        columns: impl IntoIterator<Item = usize>,
        number: impl Fn(&CalibrationMatrix) -> Option<f64>,
    ) -> Option<Repeatability> {
        let values: Vec<f64> = self.fits.iter().map(number).collect::<Option<_>>()?;
        let effective =
            columns.into_iter().map(|column| self.effective[column]).fold(f64::INFINITY, f64::min);
        if values.len() < 2 || !(effective.is_finite() && effective >= FEWEST_RECORDS) {
            return None;
        }
        let count = values.len() as f64;
        let mean = values.iter().sum::<f64>() / count;
        let square: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
        Some(Repeatability { uncertainty: ((count - 1.0) / count * square).sqrt(), freedom: effective - 1.0 })
    }
}

/// (Σw)²/Σw².
pub(super) fn effective_count(weights: impl Iterator<Item = f64>) -> f64 {
    let (sum, square) = weights.fold((0.0, 0.0), |(sum, square), w| (sum + w, square + w * w));
    if square > 0.0 { sum * sum / square } else { 0.0 }
}

/// A number with its derivatives by the entries of K.
type MatrixDual = Dual<f64, 9>;

/// Residuals of G = e^{jφ}·K·Ω, the phase φ of each record the best for the K at hand.
struct MatrixResiduals<'a> {
    pairs: &'a [RatePair],
    /// The K for the weights.
    at: [f64; 9],
}

impl MatrixResiduals<'_> {
    /// The standard deviation of one residual.
    fn deviation(&self, pair: &RatePair, row: usize) -> f64 {
        let of_reference = (0..3).map(|j| (self.at[3 * row + j] * pair.reference_deviation[j]).powi(2));
        let variance = pair.shown_deviation[row].powi(2) + of_reference.sum::<f64>();
        // A record without any noise has the weight of one with the noise of rounding.
        let rounding = 1e-15 * pair.shown[row].map_or(0.0, Complex64::portable_norm);
        variance.sqrt().max(rounding).max(f64::MIN_POSITIVE)
    }

    /// e^{jφ}.
    fn turn(&self, pair: &RatePair, k: &[f64; 9]) -> Complex64 {
        let terms = (0..3).filter_map(|i| {
            let weight = self.deviation(pair, i).powi(-2);
            Some(pair.shown[i]? * product(k, i, &pair.reference).conj() * weight)
        });
        let sum: Complex64 = terms.sum();
        if sum.portable_norm() > 0.0 { sum / sum.portable_norm() } else { Complex64::new(1.0, 0.0) }
    }
}

impl MatrixResiduals<'_> {
    /// What this K leaves of what is shown.
    fn left(&self, k: &[f64; 9]) -> f64 {
        let (mut left, mut all) = (0.0, 0.0);
        for pair in self.pairs {
            let turn = self.turn(pair, k);
            for (i, shown) in pair.shown.iter().enumerate() {
                let Some(shown) = shown else { continue };
                left += (turn * product(k, i, &pair.reference) - shown).norm_sqr();
                all += shown.norm_sqr();
            }
        }
        if all > 0.0 { (left / all).sqrt() } else { 0.0 }
    }
}

/// Row i of K·Ω.
fn product(k: &[f64; 9], row: usize, reference: &[Complex64; 3]) -> Complex64 {
    (0..3).map(|j| reference[j] * k[3 * row + j]).sum()
}

impl Regression<9> for MatrixResiduals<'_> {
    fn residuals(&self, k: &[f64; 9], each: &mut impl FnMut(f64)) {
        for pair in self.pairs {
            let turn = self.turn(pair, k);
            for (i, shown) in pair.shown.iter().enumerate() {
                let Some(shown) = shown else { continue };
                let residual = (turn * product(k, i, &pair.reference) - shown) / self.deviation(pair, i);
                each(residual.re);
                each(residual.im);
            }
        }
        each(CONSTANT);
    }

    /// The phase follows the parameters: of each column of the Jacobian, what it has of the phase's own is taken off
    /// (Kaufman, BIT 15, 49, 1975).
    fn linearize(&self, k: &[f64; 9], each: &mut impl FnMut(f64, &[f64; 9])) {
        for pair in self.pairs {
            let turn = self.turn(pair, k);
            let mut rows = [(0.0, [0.0; 9]); 6];
            let mut phase = [0.0; 6];
            for (i, shown) in pair.shown.iter().enumerate() {
                let Some(shown) = shown else { continue };
                let weight = self.deviation(pair, i).recip();
                let model = turn * product(k, i, &pair.reference);
                let residual = (model - shown) * weight;
                let by_phase = Complex64::i() * model * weight;
                (rows[2 * i].0, rows[2 * i + 1].0) = (residual.re, residual.im);
                (phase[2 * i], phase[2 * i + 1]) = (by_phase.re, by_phase.im);
                for j in 0..3 {
                    let by_entry = turn * pair.reference[j] * weight;
                    (rows[2 * i].1[3 * i + j], rows[2 * i + 1].1[3 * i + j]) = (by_entry.re, by_entry.im);
                }
            }
            let square: f64 = phase.iter().map(|p| p * p).sum();
            for column in 0..9 {
                let part = rows.iter().zip(&phase).map(|(row, p)| row.1[column] * p).sum::<f64>();
                let part = if square > 0.0 { part / square } else { 0.0 };
                rows.iter_mut().zip(&phase).for_each(|(row, p)| row.1[column] -= part * p);
            }
            for (parts, shown) in rows.chunks(2).zip(&pair.shown) {
                if shown.is_some() {
                    for (residual, gradient) in parts {
                        each(*residual, gradient);
                    }
                }
            }
        }
        each(CONSTANT, &[0.0; 9]);
    }
}

/// The axes of the reference whose rates stand out of its noise, and the one with the largest rate in any case. An entry of K for another one would
/// take on any size, and with it the noise that it makes of the reference's, in which every contradiction is lost.
fn excited(pairs: &[RatePair], axes_of_reference: [bool; 3]) -> [bool; 3] {
    let squares: [f64; 3] =
        std::array::from_fn(|axis| pairs.iter().map(|pair| pair.reference[axis].norm_sqr()).sum());
    let most = squares.iter().copied().fold(0.0, f64::max);
    std::array::from_fn(|axis| {
        let noise: f64 = pairs.iter().map(|pair| 2.0 * pair.reference_deviation[axis].powi(2)).sum();
        let stands_out = squares[axis] > STANDING_OUT * STANDING_OUT * noise;
        axes_of_reference[axis] && (squares[axis] >= most || stands_out)
    })
}

fn excitation(pairs: &[RatePair]) -> Vec<(f64, [f64; 3])> {
    let mut gram = Mat::<f64, 3, 3>::zero();
    for pair in pairs {
        for i in 0..3 {
            for j in 0..3 {
                gram.0[i][j] +=
                    (pair.reference[i] * pair.reference[j].conj()).re / (2.0 * pairs.len() as f64);
            }
        }
    }
    let svd = Svd::of(&gram);
    (0..3).map(|k| (svd.values[k].sqrt(), std::array::from_fn(|i| svd.right.0[i][k]))).collect()
}

/// Weighted by what each record tells of the scale factor.
fn shown_part(pairs: &[RatePair], k: &[f64; 9]) -> f64 {
    let (mut of_shown, mut of_all) = (0.0, 0.0);
    for pair in pairs {
        let axis = (0..3)
            .max_by(|a, b| pair.reference[*a].portable_norm().total_cmp(&pair.reference[*b].portable_norm()));
        let Some(axis) = axis else { continue };
        let shown = pair.shown_deviation[axis].powi(2);
        let all = shown + (k[4 * axis] * pair.reference_deviation[axis]).powi(2);
        if all > 0.0 {
            let weight = pair.reference[axis].norm_sqr() / all;
            of_shown += weight * shown / all;
            of_all += weight;
        }
    }
    if of_all > 0.0 { of_shown / of_all } else { 1.0 }
}
