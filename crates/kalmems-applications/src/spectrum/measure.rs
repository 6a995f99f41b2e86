//! From a spectrum file to a spectrum.

use super::budget::{LineErrorContribution, budget, systematic_error};
use super::coadd::{CoaddedNoise, MeasuredLine};
use super::grid::WavenumberGrid;
use super::input::SpectrumInput;
use super::light::detect;
use super::mertz::MertzError;
use super::process::{ProcessedScans, along, of_steps};
use super::recalibrate::{KnownLine, Recalibration, recalibrate};
use super::resample::ResampleError;
use super::scans::{DetectorSignal, ScanCounts};
use super::track::PositionTrackError;
use super::transform::TransformError;
use crate::config::{ConfigError, ConfigFault, Quantity};
use crate::named_files::NamedFiles;
use crate::progress::Progress;
use crate::recording::{Finding, Purpose, ReadError, RecordingSource};
use crate::signal::cubic_between;
use crate::spectrum::file::{PathDifference, SpectrumFile, SpectrumLine, SpectrumReference, WavenumberBand};
use kalmems_core::Portable;
use kalmems_engines::rig::{LengthScale, Workbench};

/// A spectrum, and what is known of it.
#[derive(Clone, Debug)]
pub struct SpectrumOutcome {
    /// What it was computed from.
    pub file: SpectrumFile,
    /// The spectra of the scans.
    pub processed: ProcessedScans,
    /// Their mean.
    pub spectrum: Vec<f64>,
    /// Its standard error by the differences of the scans, where there are several.
    pub standard_error: Option<Vec<f64>>,
    /// What it may be wrong by in the same way in all scans, where errors of the path are stated.
    pub systematic_error: Option<Vec<f64>>,
    /// Its noise over the number of scans.
    pub noise: Vec<CoaddedNoise>,
    /// The lines that were asked for, in their order; `None` where there is none.
    pub lines: Vec<Option<MeasuredLine>>,
    /// For each of them, what its wavenumber may be off by.
    pub budgets: Vec<Vec<LineErrorContribution>>,
    /// How much later than taken the detector shows the motion, by what forward and backward scans differ by; with its
    /// standard error.
    pub residual_delay_s: Option<(f64, f64)>,
    /// The scale of the positions, where a line is known.
    pub recalibration: Option<Recalibration>,
    /// What to write in the experiment of the positions' estimate, where the file names one and a line is known.
    pub correction: Option<DeviceCorrection>,
    /// What a trajectory may be off by between its samples, in m of position.
    pub interpolation_error_m: Option<f64>,
    /// Gaps in the trajectory.
    pub gaps: usize,
    /// Against what it should be.
    pub comparison: Option<SpectrumComparison>,
    /// What a simulated detector gave.
    pub simulated: Option<DetectorSignal>,
    /// The files that were read.
    pub sources: Vec<RecordingSource>,
    /// What was found in them that does not keep them from being used, with the file's name.
    pub findings: Vec<(String, Finding)>,
}

/// What a recalibration means for a device.
#[derive(Clone, Debug, PartialEq)]
pub struct DeviceCorrection {
    /// The key of the experiment file.
    pub key: &'static str,
    /// What it is in the experiment, as written there.
    pub was: String,
    /// What it is by the known lines, in m.
    pub is_m: f64,
    /// The standard error of that, where it is known.
    pub sd_m: Option<f64>,
}

/// A spectrum against what it should be.
#[derive(Clone, Debug)]
pub struct SpectrumComparison {
    /// Wavenumbers in 1/m.
    pub wavenumber_per_m: Vec<f64>,
    /// Our values there.
    pub ours: Vec<f64>,
    /// What they should be, times `scale`.
    pub theirs: Vec<f64>,
    /// What the reference was multiplied by; 1 for the spectrum along a true trajectory.
    pub scale: f64,
    /// The root mean square of the difference over the largest value of the reference.
    pub rms_over_peak: f64,
    /// Where it differs most, and by how much there, ours less theirs over the same.
    pub worst: (f64, f64),
    /// The lines of the reference, in the order of the file; `None` where there is none, or none is measured.
    pub lines: Vec<Option<MeasuredLine>>,
}

/// Why there is no spectrum.
#[derive(Debug, thiserror::Error)]
pub enum SpectrumError {
    /// The spectrum file is wrong.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// A file that it names cannot be read.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// A trajectory cannot be used.
    #[error("{place}: {fault}")]
    Track {
        /// The file and the column.
        place: String,
        /// What is wrong.
        fault: PositionTrackError,
    },
    /// An interferogram cannot be transformed.
    #[error(transparent)]
    Transform(#[from] TransformError),
    /// Its phase cannot be corrected.
    #[error(transparent)]
    Mertz(#[from] MertzError),
    /// It cannot be brought to equal steps.
    #[error(transparent)]
    Resample(#[from] ResampleError),
    /// No sample is a number.
    #[error("an interferogram has no finite sample; expected a column of numbers")]
    NoZeroPath,
    /// Scans are too short.
    #[error(
        "a path difference of {wanted_m} m is wanted and all scans reach {found_m} m; write a smaller \
         `transform.largest_path_difference`, or phase = \"mertz\" for scans with one long side"
    )]
    Reach {
        /// What is wanted.
        wanted_m: f64,
        /// What is there.
        found_m: f64,
    },
    /// There is no scan.
    #[error(
        "no scan leads through all wanted path differences: of {} samples {} lie before or after the trajectory, {} in its \
         gaps, {} have no value; {} passes are incomplete and {} in the other direction; lower \
         `transform.largest_path_difference`, or look whether all times are on one clock",
        .0.samples, .0.beyond_trajectory, .0.in_gap, .0.without_value, .0.incomplete_scans, .0.unwanted_scans
    )]
    NoScan(ScanCounts),
    /// More wavenumbers than a weighted sum is meant for.
    #[error(
        "the band has {points} wavenumbers; narrow `transform.band`, lower `zero_filling`, or write method = \"resampled\""
    )]
    TooManyPoints {
        /// How many.
        points: usize,
    },
    /// The reference and the spectrum have nothing in common.
    #[error(
        "the reference has {found} wavenumbers within the spectrum's {from_per_cm} to {to_per_cm} 1/cm; expected at least 4"
    )]
    NoOverlap {
        /// How many it has.
        found: usize,
        /// Where the spectrum begins.
        from_per_cm: f64,
        /// Where it ends.
        to_per_cm: f64,
    },
    /// Stopped from outside.
    #[error("interrupted")]
    Interrupted,
}

impl SpectrumError {
    /// Whether it was stopped from outside.
    pub const fn is_interruption(&self) -> bool {
        matches!(self, Self::Read(ReadError::Interrupted { .. }) | Self::Interrupted)
    }
}

/// Reads, or simulates, all interferograms of a spectrum file and computes the spectrum.
pub fn measure(
    workbench: &Workbench,
    file: &SpectrumFile,
    progress: &dyn Progress,
) -> Result<SpectrumOutcome, SpectrumError> {
    let mut input = SpectrumInput {
        file,
        origin: None,
        files: NamedFiles::new("spectrum file", Purpose::Evaluation, progress),
    };
    let simulated = match &file.light {
        Some(light) => Some(detect(light, &input.track("light.trajectory", &light.trajectory)?)),
        None => None,
    };
    let detectors = match &simulated {
        Some(detector) => vec![detector.clone()],
        None => input.detectors()?,
    };
    let settings = &file.transform;
    let (mut interpolation_error_m, mut gaps) = (None, 0);
    let processed = match &file.path {
        PathDifference::Step(step) => of_steps(&detectors, step.si(), settings)?,
        PathDifference::Laser(laser) => {
            let step_m = (laser.wavenumber.si() * laser.samples_per_fringe.si()).recip();
            of_steps(&detectors, step_m, settings)?
        }
        PathDifference::Trajectory(trajectory) => {
            let track = input.track("path.trajectory", trajectory)?;
            (interpolation_error_m, gaps) = (track.interpolation_error_m(), track.gaps());
            along(&detectors, &track, trajectory, settings, progress)?
        }
    };
    let spectrum = processed.scans.mean();
    let lines = measured(file, &processed);
    let comparison = match &file.reference {
        Some(reference) => {
            Some(compare(&mut input, reference, &detectors, (processed.scans.grid, &spectrum))?)
        }
        None => None,
    };
    let errors = file.errors.as_ref();
    let half_angle = errors.and_then(|e| e.half_angle.as_ref()).map_or(0.0, Quantity::si);
    let scale_sd = errors.and_then(|e| e.scale_sd.as_ref()).map_or(0.0, Quantity::si);
    let skew = errors.and_then(|e| e.clock_skew.as_ref()).map_or(0.0, Quantity::si);
    let known = file.lines.iter().zip(&lines).filter_map(|(asked, found)| known(asked, found.as_ref()?));
    let NamedFiles { sources, findings, .. } = input.files;
    let recalibration = recalibrate(&known.collect::<Vec<_>>(), half_angle, scale_sd.portable_hypot(skew));
    let correction = match recalibration {
        Some(recalibration) => correction(workbench, file, recalibration)?,
        None => None,
    };
    Ok(SpectrumOutcome {
        recalibration,
        correction,
        budgets: lines.iter().map(|line| budget(errors, &processed, *line)).collect(),
        residual_delay_s: residual_delay(&processed),
        standard_error: processed.scans.standard_error(),
        systematic_error: systematic_error(errors, &processed, &spectrum),
        noise: processed.scans.noise(),
        file: file.clone(),
        processed,
        spectrum,
        lines,
        interpolation_error_m,
        gaps,
        comparison,
        simulated,
        sources,
        findings,
    })
}

/// A capacitance that is a series in (reference distance)/d keeps its values if the reference distance grows by the same
/// share as all distances.
fn correction(
    workbench: &Workbench,
    file: &SpectrumFile,
    Recalibration { scale, scale_sd, .. }: Recalibration,
) -> Result<Option<DeviceCorrection>, SpectrumError> {
    let Some(experiment) = &file.experiment else { return Ok(None) };
    let experiment = workbench.load(&file.resolve(experiment))?;
    let Some(LengthScale { key, length }) = workbench.rig(&experiment)?.length_scale(&experiment)? else {
        let why = "its device states no length in which it measures distances, which is what a known line corrects; \
                   leave `experiment` out"
            .to_owned();
        return Err(file.error("experiment", ConfigFault::Value { why }).into());
    };
    Ok(Some(DeviceCorrection {
        key,
        was: length.text().to_owned(),
        is_m: scale * length.si(),
        sd_m: scale_sd.map(|sd| sd * length.si()),
    }))
}

fn measured(file: &SpectrumFile, processed: &ProcessedScans) -> Vec<Option<MeasuredLine>> {
    let resolved = file.transform.apodisation.line_width() / processed.largest_m;
    let find = |line: &SpectrumLine| {
        let within = line.within.as_ref().map_or(resolved, Quantity::si);
        let sign = if line.absorption { -1.0 } else { 1.0 };
        processed.scans.line(line.wavenumber.si(), within, sign)
    };
    file.lines.iter().map(find).collect()
}

fn known(asked: &SpectrumLine, found: &MeasuredLine) -> Option<KnownLine> {
    Some(KnownLine {
        found_per_m: found.line.wavenumber_per_m,
        found_sd_per_m: found.standard_error.map(|error| error.wavenumber_per_m),
        known_per_m: asked.known.as_ref()?.si(),
        known_sd_per_m: asked.known_sd.as_ref().map_or(0.0, Quantity::si),
    })
}

/// Forward scans lie later by v·τ, backward ones earlier: half the difference over the speed, which counts where the light
/// is by which scans are laid over each other.
fn residual_delay(processed: &ProcessedScans) -> Option<(f64, f64)> {
    let energy: f64 = processed.samples.iter().map(|s| s.energy).sum();
    let speed = processed.samples.iter().map(|s| s.energy * s.speed_m_per_s.abs()).sum::<f64>() / energy;
    let of = |direction: bool| {
        let shifts: Vec<f64> = (processed.misregistration_m.iter().zip(&processed.scans.forward))
            .filter(|(_, forward)| **forward == direction)
            .map(|(shift, _)| *shift)
            .collect();
        let n = shifts.len() as f64;
        let mean = shifts.iter().sum::<f64>() / n;
        let square: f64 = shifts.iter().map(|shift| (shift - mean).powi(2)).sum();
        (shifts.len() > 1).then(|| (mean, square / (n * (n - 1.0))))
    };
    let ((forward, forward_variance), (backward, backward_variance)) = (of(true)?, of(false)?);
    let delay = (forward - backward) / (2.0 * speed);
    Some((delay, (forward_variance + backward_variance).sqrt() / (2.0 * speed)))
}

fn compare(
    input: &mut SpectrumInput<'_>,
    reference: &SpectrumReference,
    detectors: &[DetectorSignal],
    (grid, spectrum): (WavenumberGrid, &[f64]),
) -> Result<SpectrumComparison, SpectrumError> {
    let file = input.file;
    let (wavenumber_per_m, theirs, free_scale, lines) = match (&reference.trajectory, &reference.spectrum) {
        (Some(trajectory), _) => {
            let track = input.track("reference.trajectory", trajectory)?;
            let ideal = along(detectors, &track, trajectory, &file.transform, input.files.progress)?;
            (ideal.scans.grid.wavenumbers(), ideal.scans.mean(), false, measured(file, &ideal))
        }
        (None, Some(spectrum)) => {
            let [wavenumber, value] = input.spectrum(spectrum)?;
            (wavenumber, value, true, vec![None; file.lines.len()])
        }
        (None, None) => (Vec::new(), Vec::new(), false, Vec::new()),
    };
    let ours = grid.wavenumbers();
    let ends = [grid.first_per_m, grid.wavenumber(grid.points.saturating_sub(1))];
    let [from, to] = reference.band.as_ref().map_or(ends, WavenumberBand::per_m);
    let within = |nu: f64| nu >= from.max(ends[0]) && nu <= to.min(ends[1]);
    let pairs: Vec<(f64, f64, f64)> = (wavenumber_per_m.into_iter().zip(theirs))
        .filter(|(nu, value)| within(*nu) && value.is_finite())
        .map(|(nu, value)| {
            let place = ours.partition_point(|own| *own < nu).clamp(1, ours.len() - 1);
            (nu, cubic_between(&ours, |k| spectrum[k], place, nu), value)
        })
        .collect();
    if pairs.len() < 4 {
        let [from_per_cm, to_per_cm] = ends.map(|end| end / 100.0);
        return Err(SpectrumError::NoOverlap { found: pairs.len(), from_per_cm, to_per_cm });
    }
    let sum =
        |of: &dyn Fn(f64, f64) -> f64| pairs.iter().map(|(_, ours, theirs)| of(*ours, *theirs)).sum::<f64>();
    // Ours are brought to theirs, and both drawn as ours.
    let scale = if free_scale { sum(&|o, o2| o * o2) / sum(&|o, _| o * o) } else { 1.0 };
    let peak = pairs.iter().map(|(.., theirs)| theirs.abs()).fold(0.0, f64::max);
    let square = sum(&|ours, theirs| (scale * ours - theirs).powi(2));
    let off = pairs.iter().map(|(nu, ours, theirs)| (*nu, (scale * ours - theirs) / peak));
    let worst = off.max_by(|a, b| a.1.abs().total_cmp(&b.1.abs())).unwrap_or((f64::NAN, f64::NAN));
    Ok(SpectrumComparison {
        worst,
        rms_over_peak: (square / pairs.len() as f64).sqrt() / peak,
        wavenumber_per_m: pairs.iter().map(|(nu, ..)| *nu).collect(),
        ours: pairs.iter().map(|(_, ours, _)| *ours).collect(),
        theirs: pairs.iter().map(|(.., theirs)| theirs / scale).collect(),
        scale: scale.recip(),
        lines,
    })
}
