//! Calibration of gyroscopes and accelerometers: by a vibration that is known, by positions, and at rest.
//!
//! A stage shakes the gyroscope, a reference knows how: a vibrometer, or the stage's own estimated motion. Each has its own
//! clock, so that amplitudes and relative phases are all that can be compared: both records are fitted by sines of free
//! frequency ([`AxisSignals::tone`]), and K of Ω_I = K·Ω + b to the phasors of all records ([`CalibrationMatrix::fit`]), each with a phase
//! of its own. [`calibrate`] does all that a calibration file says.

mod calibrate;
mod centre;
#[cfg(feature = "report")]
mod certificate;
mod checks;
mod comparison;
#[cfg(feature = "report")]
mod compensation_sources;
mod cross_check;
mod earth;
mod error;
mod file;
mod files;
mod inputs;
mod linear_model;
mod matrix;
mod motion;
mod noise_fit;
mod noise_model;
mod noise_study;
#[cfg(feature = "report")]
mod noise_yaml;
mod octave_covariance;
mod off_axis;
mod one_factor;
mod outcome;
mod over_temperature;
mod parts_of_vibration;
mod passed_flicker;
mod peaks;
mod positions;
mod positions_covariance;
mod positions_record;
mod quantities;
mod rate_ramp;
mod rates_record;
mod rest;
mod rest_lines;
mod rest_record;
mod rest_samples;
mod rest_spectrum;
#[cfg(feature = "report")]
mod results;
mod simulated;
mod sine_record;
mod still;
mod stretches;
mod sweep;
mod temperature_curve;
mod temperature_record;
mod tone;
mod tumble;
mod turns_record;
mod unit_record;

pub use calibrate::{calibrate, calibrate_with_parts};
pub use centre::{Centre, ShakenRecord};
#[cfg(feature = "report")]
pub use certificate::{Certificate, certificate_page};
pub use checks::{CertificateCheck, CheckKind};
pub use comparison::ReferenceComparison;
pub use error::CalibrationError;
pub use file::{
    CertificateDetails, Condition, CurveChoice, GyroscopeCalibration, InertialUnit, MonteCarlo,
    MotionReference, Mounting, PositionsRecord, RatesRecord, RestRecord, SineRecord, StatedUncertainty,
    TableAxis, TemperatureDirection, TemperatureRecord, TurnsRecord,
};
pub use matrix::{CalibrationMatrix, LeaveOneOut, RatePair, Repeatability};
pub use noise_fit::{NoFit, NoiseFit};
pub use noise_study::{NoiseShare, NoiseStudy};
pub use off_axis::OffAxisMotion;
pub use outcome::{
    CalibratedGyroscope, Calibration, Centred, CrossCheck, InPlane, RecordFigures, ScaleFactorAtFrequency,
    ScaleFactorChange, UncertainEstimate, UncertaintyContribution,
};
pub use peaks::{HALF_WINDOW, PeakToPeak};
pub use quantities::{CalibratedQuantity, QuantityCovariance, QuantityUnit, RecordOutcome};
pub use rest::{AxisAtRest, BiasMethod, InertialSensor, NoiseTerm};
pub use rest_samples::RestSamples;
#[cfg(feature = "report")]
pub use results::{
    CalibrationSummary, RestSummary, calibration_figures, write_calibration, write_refused_calibration,
};
pub use simulated::{SimulatedInstrument, SimulatedUnit, Vibration};
pub use tone::{AXES, AxisSignals, Component, FEWEST_PERIODS, FEWEST_SAMPLES, ToneError, VibrationTone};
pub use unit_record::RecordOfUnit;
