//! A series for the capacitance, from a table of field simulations or measurements.

use super::plates::{COEFFICIENTS, Plates};
use crate::fit::{FitError, FitSettings, Regression, fit};
use kalmems_core::Covariance;

/// A series in powers of the inverse distance, and how far it may be trusted.
#[derive(Clone, Debug, PartialEq)]
pub struct Metamodel {
    /// C(d) = Σ c_k·(d_r/d)^k; coefficients behind its degree are 0.
    pub plates: Plates,
    /// The fit of the degree beside the chosen one: what the two differ by outside the table tells how wrong they are.
    pub beside: Plates,
    /// The degree that was chosen: the smallest one whose cross-validated error is within a tenth of the least.
    pub degree: usize,
    /// The largest error over the table, as the error of a distance, in m.
    pub worst_m: f64,
    /// The nearest and the farthest distance of the table, in m.
    pub range_m: [f64; 2],
    /// The fit of one degree more, where there is one, with the covariance of the errors of its coefficients, in F². The smallest degree that
    /// predicts as well as any leaves out a part of the series that is as large as its noise; with one degree more the noise is what is left, and
    /// the covariance that of all errors.
    pub above: (Plates, Covariance<f64, COEFFICIENTS>),
    /// The errors of each degree that was tried, from 1 on.
    pub degrees: Vec<DegreeError>,
}

/// The error of one degree.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DegreeError {
    /// The degree.
    pub degree: usize,
    /// The root mean square error at distances that the fit had not seen, in m.
    pub cross_validated_m: f64,
    /// The largest error over the table with all of it fitted, in m.
    pub worst_m: f64,
}

/// Why there is none.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum MetamodelError {
    /// A row of the table cannot be one.
    #[error(
        "row {row} of the table is {distance_m} m and {capacitance_f} F; expected a distance above 0, each once, and a \
         capacitance above 0"
    )]
    Row {
        /// Which, from 0.
        row: usize,
        /// Its distance.
        distance_m: f64,
        /// Its capacitance.
        capacitance_f: f64,
    },
    /// There are too few rows.
    #[error("the table has {found} rows; expected at least {MINIMUM}, spread over the whole stroke")]
    TooFew {
        /// How many there are.
        found: usize,
    },
    /// A fit did not settle.
    #[error("a series of degree {degree} cannot be fitted: {why}")]
    Fit {
        /// Its degree.
        degree: usize,
        /// Why.
        why: FitError,
    },
}

/// A distance for which a metamodel has no table.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error(
    "{distance_m} m is outside the table, which goes from {} m to {} m; there a series of one degree more or less differs by \
     {error_m:.1e} m of the distance, and both may be wrong: extend the table", range_m[0], range_m[1]
)]
pub struct OutsideTable {
    /// The distance.
    pub distance_m: f64,
    /// The range of the table.
    pub range_m: [f64; 2],
    /// By how much the series of the next degree differs there, as an error of the distance in m.
    pub error_m: f64,
}

/// The fewest rows: two more than coefficients in each part of the cross-validation.
const MINIMUM: usize = 16;
/// Into how many interleaved parts the table is divided.
const FOLDS: usize = 5;
/// How much worse than the best a smaller degree may be.
const AS_GOOD: f64 = 1.1;

/// Fits a series to a table of distances in m and capacitances in F, its degree chosen by cross-validation.
///
/// Errors are those of the distance, (C_fit − C)/|dC/dd|, so that near and far rows count alike. Each of five
/// interleaved parts of the table is left out in turn and predicted from the others; the nearest and the farthest row
/// are never left out, since a series predicts nothing beyond its table.
pub fn fit_table(
    distance_m: &[f64],
    capacitance_f: &[f64],
    reference_distance_m: f64,
) -> Result<Metamodel, MetamodelError> {
    let mut rows: Vec<(f64, f64)> = distance_m.iter().copied().zip(capacitance_f.iter().copied()).collect();
    let usable = |v: f64| v > 0.0 && v.is_finite();
    let bad = |row: usize| {
        let (distance_m, capacitance_f) = (distance_m[row], capacitance_f[row]);
        Err(MetamodelError::Row { row, distance_m, capacitance_f })
    };
    if let Some(row) = rows.iter().position(|(d, c)| !(usable(*d) && usable(*c))) {
        return bad(row);
    }
    rows.sort_by(|a, b| a.0.total_cmp(&b.0));
    if let Some(pair) = rows.windows(2).find(|pair| pair[0].0 == pair[1].0) {
        return bad(distance_m.iter().rposition(|d| *d == pair[0].0).unwrap_or(0));
    }
    if rows.len() < MINIMUM {
        return Err(MetamodelError::TooFew { found: rows.len() });
    }
    let mut tried = Vec::new();
    for degree in 1..COEFFICIENTS {
        let fitted = |rows: &[(f64, f64)]| {
            of_degree(rows, reference_distance_m, degree).map_err(|why| MetamodelError::Fit { degree, why })
        };
        let mut squares = 0.0;
        for fold in 0..FOLDS {
            let (left_out, kept): (Vec<_>, Vec<_>) = rows
                .iter()
                .enumerate()
                .partition(|(k, _)| k % FOLDS == fold && *k != 0 && *k != rows.len() - 1);
            let kept: Vec<(f64, f64)> = kept.into_iter().map(|(_, row)| *row).collect();
            let (plates, _) = fitted(&kept)?;
            squares += left_out.iter().map(|(_, row)| error_m(&plates, row).powi(2)).sum::<f64>();
        }
        let (plates, covariance) = fitted(&rows)?;
        let worst_m = rows.iter().map(|row| error_m(&plates, row).abs()).fold(0.0, f64::max);
        let cross_validated_m = (squares / (rows.len() - 2) as f64).sqrt();
        tried.push((plates, covariance, DegreeError { degree, cross_validated_m, worst_m }));
    }
    let least = tried.iter().map(|(.., error)| error.cross_validated_m).fold(f64::INFINITY, f64::min);
    let degrees = tried.iter().map(|(.., error)| *error).collect();
    let chosen = tried.iter().position(|(.., error)| error.cross_validated_m <= AS_GOOD * least);
    // The least is one of them, unless none is a number.
    let index = chosen.ok_or(MetamodelError::TooFew { found: rows.len() })?;
    let (plates, _, chosen) = tried[index];
    let (above, covariance, _) = tried[(index + 1).min(tried.len() - 1)];
    let (beside, ..) = tried[if index == 0 { 1 } else { index - 1 }];
    Ok(Metamodel {
        plates,
        beside,
        degree: chosen.degree,
        worst_m: chosen.worst_m,
        range_m: [rows[0].0, rows[rows.len() - 1].0],
        above: (above, covariance),
        degrees,
    })
}

impl Metamodel {
    /// C(d) in F, d in m, within the table.
    pub fn capacitance(&self, distance_m: f64) -> Result<f64, OutsideTable> {
        let [near, far] = self.range_m;
        if (near..=far).contains(&distance_m) {
            Ok(self.plates.capacitance(distance_m))
        } else {
            let other = self.beside.capacitance(distance_m);
            let error_m = error_m(&self.plates, &(distance_m, other)).abs();
            Err(OutsideTable { distance_m, range_m: self.range_m, error_m })
        }
    }
}

/// (C_fit − C)/|dC/dd| in m.
fn error_m(plates: &Plates, &(distance, capacitance): &(f64, f64)) -> f64 {
    (plates.capacitance(distance) - capacitance) / plates.slope(distance).abs()
}

fn of_degree(
    rows: &[(f64, f64)],
    reference_m: f64,
    degree: usize,
) -> Result<(Plates, Covariance<f64, COEFFICIENTS>), FitError> {
    let table = SeriesResiduals { rows, reference_m };
    let free = std::array::from_fn(|k| k <= degree);
    let settings = FitSettings { free, ..FitSettings::from_start([0.0; COEFFICIENTS]) };
    let found = fit(&table, &settings)?;
    Ok((Plates { reference_distance: reference_m, coefficients: found.parameters }, found.covariance))
}

/// The rows less the series, as distances by the slope of a parallel plate.
struct SeriesResiduals<'a> {
    rows: &'a [(f64, f64)],
    reference_m: f64,
}

impl SeriesResiduals<'_> {
    fn each(&self, coefficients: &[f64; COEFFICIENTS], each: &mut impl FnMut(f64, &[f64; COEFFICIENTS])) {
        for (distance, capacitance) in self.rows {
            let weight = distance / capacitance;
            let mut power = weight;
            let row: [f64; COEFFICIENTS] = std::array::from_fn(|_| {
                let now = power;
                power *= self.reference_m / distance;
                now
            });
            let sum: f64 = row.iter().zip(coefficients).map(|(r, c)| r * c).sum();
            each(sum - distance, &row);
        }
    }
}

impl Regression<COEFFICIENTS> for SeriesResiduals<'_> {
    fn residuals(&self, coefficients: &[f64; COEFFICIENTS], each: &mut impl FnMut(f64)) {
        self.each(coefficients, &mut |residual, _| each(residual));
    }

    fn linearize(
        &self,
        coefficients: &[f64; COEFFICIENTS],
        each: &mut impl FnMut(f64, &[f64; COEFFICIENTS]),
    ) {
        self.each(coefficients, each);
    }
}
