//! Spectra from interferograms: what a piston mirror moves for.
//!
//! Positions are optical path differences x in m, wavenumbers ν in 1/m: a line at ν gives cos(2π·ν·x). A mirror that
//! moves by d changes the path by 2·d.

mod apodisation;
mod budget;
mod coadd;
mod file;
mod grid;
mod input;
mod light;
mod line;
mod measure;
mod mertz;
mod nonuniform;
mod process;
mod recalibrate;
mod register;
mod resample;
#[cfg(feature = "report")]
mod results;
mod scans;
mod track;
mod transform;
mod zero_path;

pub use apodisation::Apodisation;
pub use budget::{
    LineErrorContribution, Reason, budget, detector_limit, line_height, line_shift, systematic_error,
};
pub use coadd::{CoaddedNoise, MeasuredLine, Scans};
pub use file::{
    DetectorBursts, Directions, Interferogram, Light, LightSource, PathDifference, PathErrors,
    PathTrajectory, PhaseCorrection, ReferenceLaser, ReferenceSpectrum, Registration, SpectrumFile,
    SpectrumLine, SpectrumReference, SpectrumTransform, TransformMethod, WavenumberBand,
};
pub use grid::WavenumberGrid;
pub use light::{detect, intensity};
pub use line::{SpectralPeak, dip_between, line_near};
pub use measure::{DeviceCorrection, SpectrumComparison, SpectrumError, SpectrumOutcome, measure};
pub use mertz::{MertzError, OneSided, mertz, one_sided, without_phase};
pub use nonuniform::{path_weights, spectrum_at};
pub use process::{PathSample, ProcessedScans, SpectrumPhase};
pub use recalibrate::{KnownLine, Recalibration, recalibrate};
pub use register::{shift_to, turn};
pub use resample::{ResampleError, resample};
#[cfg(feature = "report")]
pub use results::{
    ContributionMetrics, CorrectionMetrics, JcampSpectrum, LineMetrics, SpectrumMetrics,
    SpectrumReferenceMetrics, spectrum_figures, spectrum_page, write_jcamp, write_spectrum,
};
pub use scans::{DetectorSignal, MirrorScan, PathScale, Reach, ScanCounts, path_differences, scans};
pub use track::{PositionTrack, PositionTrackError, TrackPosition};
pub use transform::{Spectrum, TransformError, transform};
pub use zero_path::zero_path;
