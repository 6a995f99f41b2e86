//! What a calibration found.

use super::checks::CertificateCheck;
use super::comparison::ReferenceComparison;
use super::peaks::PeakToPeak;
use super::quantities::RecordOutcome;
use super::rest::AxisAtRest;
use super::tone::AXES;
use crate::calibration::file::GyroscopeCalibration;
use crate::metrology::{Combined, Input, PropagationComparison, or_null};
use crate::recording::RecordingSource;
use kalmems_figures::Figure;
use serde::Serialize;

/// A calibration.
#[derive(Clone, Debug)]
pub struct Calibration {
    /// The calibration file.
    pub file: GyroscopeCalibration,
    /// Each condition with each of its references.
    pub results: Vec<CalibratedGyroscope>,
    /// How scale factors change between conditions.
    pub changes: Vec<ScaleFactorChange>,
    /// Whether references of one condition agree.
    pub comparisons: Vec<ReferenceComparison>,
    /// The record at rest, axis by axis.
    pub rest: Vec<AxisAtRest>,
    /// Whether the biases under vibration are those at rest.
    pub bias_checks: Vec<CertificateCheck>,
    /// Motions in it, in sentences: it is none at rest then.
    pub rest_motions: Vec<String>,
    /// The still and the moving parts of the record at rest.
    pub rest_parts: Option<Figure>,
    /// The records of each condition with their still parts.
    pub condition_parts: Vec<Figure>,
    /// Records of other kinds, such as that of positions.
    pub records: Vec<RecordOutcome>,
    /// The files that were read, each once.
    pub sources: Vec<RecordingSource>,
    /// What was found in the files and does not keep them from being used.
    pub findings: Vec<String>,
}

/// A number with what it is known to.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct UncertainEstimate {
    /// In SI.
    pub value: f64,
    /// Its standard uncertainty by the records alone: noise, and any scatter beyond it.
    pub by_records: f64,
    /// Half of the interval of 95 % by the records alone.
    pub expanded_by_records: f64,
    /// The effective degrees of freedom of the records alone; `null` in JSON if infinite.
    #[serde(serialize_with = "or_null")]
    pub degrees_of_freedom_by_records: f64,
    /// By which the standard uncertainty by the records alone becomes the expanded one.
    pub coverage_factor_by_records: f64,
    /// Its standard uncertainty with all that is stated besides.
    pub uncertainty: f64,
    /// The effective degrees of freedom of that; `null` in JSON if infinite.
    #[serde(serialize_with = "or_null")]
    pub degrees_of_freedom: f64,
    /// By which the standard uncertainty becomes the expanded one.
    pub coverage_factor: f64,
    /// The interval that holds it 95 times in 100: the number and its expanded uncertainty; that of the trials where these were asked for and
    /// disagree (JCGM 101, 8), its half being the expanded uncertainty then.
    pub interval: [f64; 2],
}

impl UncertainEstimate {
    /// A number with its uncertainties.
    pub(super) fn of(value: f64, by_records: Combined, all: Combined) -> Self {
        let half = all.expanded_uncertainty;
        Self {
            value,
            by_records: by_records.standard_uncertainty,
            expanded_by_records: by_records.expanded_uncertainty,
            degrees_of_freedom_by_records: by_records.degrees_of_freedom,
            coverage_factor_by_records: by_records.coverage_factor,
            uncertainty: all.standard_uncertainty,
            degrees_of_freedom: all.degrees_of_freedom,
            coverage_factor: all.coverage_factor,
            interval: [value - half, value + half],
        }
    }

    /// So many times the number.
    pub(super) fn times(&self, factor: f64) -> Self {
        let [low, high] = self.interval.map(|end| factor * end);
        Self {
            value: factor * self.value,
            by_records: factor.abs() * self.by_records,
            expanded_by_records: factor.abs() * self.expanded_by_records,
            uncertainty: factor.abs() * self.uncertainty,
            interval: [low.min(high), low.max(high)],
            ..*self
        }
    }

    /// States this interval instead.
    fn state(&mut self, interval: [f64; 2]) {
        self.interval = interval;
        self.coverage_factor = 0.5 * (interval[1] - interval[0]) / self.uncertainty;
    }

    /// U, the expanded uncertainty.
    pub fn expanded(&self) -> f64 {
        self.coverage_factor * self.uncertainty
    }
}

/// A gyroscope at one temperature by one reference.
#[derive(Clone, Debug, Serialize)]
pub struct CalibratedGyroscope {
    /// As the settings call the condition of its records, such as `25 degC`.
    pub condition: String,
    /// Its temperature in K, where it is stated.
    pub temperature_k: Option<f64>,
    /// As the settings call the reference, such as a rate table.
    pub reference: String,
    /// The axis that moves most: 0 for x.
    pub main: usize,
    /// The scale factor of that axis, fitted to all records.
    pub scale_factor: UncertainEstimate,
    /// Why it is not to be used: the records exclude one factor for all of them.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub withheld: Option<String>,
    /// The factor at each frequency, where one for all is excluded.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub by_frequency: Vec<ScaleFactorAtFrequency>,
    /// K row by row; none where the records do not tell it.
    pub matrix: [[Option<UncertainEstimate>; 3]; 3],
    /// The bias of each axis in rad/s.
    pub bias: [Option<UncertainEstimate>; 3],
    /// What the scale factor's uncertainty is made of.
    pub budget: Vec<UncertaintyContribution>,
    /// The records.
    pub records: Vec<RecordFigures>,
    /// The sum of squared residuals by their variances, and how many are free.
    pub chi_square: f64,
    /// Residuals less parameters and phases.
    pub freedom: usize,
    /// The published method, where the reference shows rates.
    pub peak_to_peak: Option<PeakToPeak>,
    /// The singular values of the reference's rates in rad/s rms and their directions.
    pub excitation: Vec<(f64, [f64; 3])>,
    /// Scale along each axis, non-orthogonality xy, xz, yz and mounting about x, y, z, where all of K is known.
    pub alignment: Option<[[UncertainEstimate; 3]; 3]>,
    /// Where two columns are known: the axes, their non-orthogonality, and the turn about the third.
    pub in_plane: Option<InPlane>,
    /// The accelerometers' place from the centre of rotation in m, where there are any.
    pub centre: Option<Centred>,
    /// What these records cannot tell, and why.
    pub not_observed: Vec<String>,
    /// The same uncertainties by trials, where the file asks for them.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cross_check: Option<CrossCheck>,
    /// What a reader must know.
    pub warnings: Vec<String>,
}

impl CalibratedGyroscope {
    /// The entries of K beside its diagonal: row, column and what is known of them.
    pub fn cross_terms(&self) -> impl Iterator<Item = (usize, usize, &UncertainEstimate)> {
        let entries = self.matrix.iter().enumerate().flat_map(|(i, row)| {
            row.iter().enumerate().filter_map(move |(j, entry)| Some((i, j, entry.as_ref()?)))
        });
        entries.filter(|(i, j, _)| i != j)
    }
}

/// The scale factor of the main axis at one frequency.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ScaleFactorAtFrequency {
    /// In Hz.
    pub frequency_hz: f64,
    /// How many records.
    pub records: usize,
    /// Whether its interval has what changes from record to record.
    pub has_scatter: bool,
    /// The factor.
    pub scale_factor: UncertainEstimate,
}

/// What two columns of K tell of the geometry.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct InPlane {
    /// The two axes.
    pub axes: [&'static str; 2],
    /// By how much the two are closer than square, in rad.
    pub non_orthogonality: UncertainEstimate,
    /// By how much the case is turned about the third axis, in rad.
    pub turn: UncertainEstimate,
}

/// The place of the accelerometers.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Centred {
    /// From the centre of rotation, in m; none along an axis that everything turned about.
    pub arm: [Option<UncertainEstimate>; 3],
    /// The sum of squared residuals by their variances.
    pub chi_square: f64,
    /// Residuals less parameters.
    pub freedom: usize,
}

/// A part of an uncertainty.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct UncertaintyContribution {
    /// What it comes from; a number of the device behind an estimated motion by its key.
    pub source: String,
    /// Its relative standard uncertainty in ppm; none where nobody said.
    pub ppm: Option<f64>,
    /// How it is known.
    pub origin: &'static str,
    /// The input behind it, with its distribution and degrees of freedom; none where nobody said.
    pub input: Option<Input>,
}

/// What trials found of the scale factor and of the entries of K (JCGM 101).
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CrossCheck {
    /// Of the scale factor.
    pub scale_factor: PropagationComparison,
    /// Of each other known entry of K, by its name, such as `k_xy`.
    pub entries: Vec<(String, PropagationComparison)>,
    /// Where both ways do not agree, in sentences, with the input that is the likely reason.
    pub disagreements: Vec<String>,
}

impl CrossCheck {
    /// Puts the trials' interval instead of that by JCGM 100 wherever the two disagree.
    pub(super) fn state_intervals(&self, main: usize, entries: &mut [[Option<UncertainEstimate>; 3]; 3]) {
        for (i, row) in entries.iter_mut().enumerate() {
            for (j, entry) in row.iter_mut().enumerate() {
                let name = format!("k_{}{}", AXES[i], AXES[j]);
                let found = if (i, j) == (main, main) {
                    Some(&self.scale_factor)
                } else {
                    self.entries.iter().find(|(own, _)| *own == name).map(|(_, found)| found)
                };
                if let (Some(entry), Some(found)) = (entry, found.filter(|found| !found.agrees)) {
                    entry.state(found.propagated.interval);
                }
            }
        }
    }
}

/// One record.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RecordFigures {
    /// Its name.
    pub record: String,
    /// The frequency by the reference in Hz.
    pub frequency_hz: f64,
    /// The rate of the gyroscope's clock by the reference's, in Hz.
    pub sample_rate_hz: f64,
    /// Its standard deviation.
    pub sample_rate_deviation_hz: f64,
    /// Periods of the reference and of the gyroscope.
    pub periods: [f64; 2],
    /// The amplitude of the main axis by the reference in rad/s.
    pub reference: f64,
    /// That by the gyroscope.
    pub shown: f64,
    /// The quotient of both.
    pub scale_factor: f64,
    /// Its standard deviation by noise.
    pub deviation: f64,
    /// What the gyroscope shows beyond all of K, as a part of what the fitted scale factor makes of the reference's rate; none where there is
    /// no rotation about the main axis.
    pub residual: Option<f64>,
    /// The harmonics of reference and gyroscope, as parts of the amplitude.
    pub distortion: [f64; 2],
}

/// A scale factor in two conditions.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ScaleFactorChange {
    /// The reference that both have.
    pub reference: String,
    /// From one condition.
    pub from: String,
    /// To the other.
    pub to: String,
    /// The change in ppm of the first.
    pub ppm: f64,
    /// Its standard uncertainty in ppm by the records: what is stated of the reference is common to both.
    pub deviation_ppm: f64,
    /// The same by the difference of the temperatures, in ppm/K.
    pub ppm_per_k: Option<f64>,
}
