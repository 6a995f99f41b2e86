//! The shared-electrode scanner: one comb drives a resonant mirror and senses its tilt.
//!
//! Chen et al., Motion Estimation for a Compact Electrostatic Micro-scanner via Shared Driving and Sensing
//! Electrodes in Endomicroscopy, 2020. The mirror is driven parametrically; a carrier on the same electrodes,
//! demodulated, gives a voltage that is affine in the capacitance and even in the angle.

mod circuit;
pub mod device;
mod expanded;
mod filters;
pub mod identification;
mod lock_in;
mod outlook;
mod past;
mod plant;
pub mod regulation;
mod ring_down;
mod segment;
mod settings;
mod simulation;
pub mod two_axes;

use super::{Estimator, NumberForm, OmittedNumber, Rig, StateDensity, Template, TemplateChannel};
use crate::Expansion;
use crate::config::{ConfigError, DeviceKind, DeviceUses, DriveSource, Experiment, Method, RecordingRole};
use crate::equations::sign_after_restart;
use crate::estimate::driven::{BLOCK, DrivenSegment, InterpolationLag};
use crate::estimate::{
    AngleAxis, DeviceParameter, EstimateError, Past, RowsAround, SegmentEstimate, SegmentPart, SideOutputs,
    SignalSegment, rows_for_start, rows_to_start_again,
};
use crate::identify::{Identification, IdentifyError};
use crate::outlook::Outlook;
use crate::progress::{Progress, Silent};
use crate::recording::{Finding, RecordingLayout, SampledRecording};
use crate::shared_scanner::device::SharedScanner;
use crate::side_outputs::side_outputs;
use crate::simulate::{SimulateError, Simulation};
use crate::units::kind;
pub use filters::ScannerFilterSettings;
pub use outlook::CycleBound;
use ring_down::RingDownSimulation;
pub use segment::{estimate as estimate_segment, estimate_with as estimate_segment_with};
pub use settings::{ScannerHardware, ScannerSettings};

/// The rig.
pub struct SharedScannerRig;

/// The channels that an estimate needs.
const MEANINGS: [&str; 2] = ["drive", "signal"];

/// What a signal that is even in the angle does not allow.
static NO_METHODS: [(Method, &str); 1] = [(
    Method::DirectInversion,
    "its signal is even in the angle and tells no sign; use `lock_in`, or a filter such as `ekf`",
)];

/// How late the readout may be of a motion of this frequency in Hz, in steps of a two-thousandth of its cycle: as a whole, or by the
/// poles of its demodulator.
fn left_out(natural_hz: f64) -> Vec<OmittedNumber> {
    let late = |key, form, filter_switch| OmittedNumber {
        key,
        unit: "s",
        step: 5e-4 / natural_hz,
        is_never_negative: true,
        form,
        filter_switch,
    };
    vec![
        late("readout.delay", NumberForm::Number, None),
        late("readout.poles", NumberForm::TwoPoles, Some("demodulator")),
    ]
}

/// What an experiment with it begins from.
const TEMPLATE: Template = Template {
    text: include_str!("template.toml"),
    channels: &[TemplateChannel::DRIVE, TemplateChannel::SIGNAL],
    references: &[TemplateChannel::ANGLE, TemplateChannel::RATE],
};

impl Rig for SharedScannerRig {
    fn name(&self) -> &'static str {
        "shared_scanner"
    }

    fn device(&self) -> DeviceKind {
        DeviceKind::of::<SharedScanner>()
    }

    fn template(&self) -> Option<Template> {
        Some(TEMPLATE)
    }

    fn claims(&self, experiment: &Experiment) -> Result<bool, ConfigError> {
        Ok(experiment.device::<SharedScanner>()?.second_axis.is_none())
    }

    fn uses(&self, _: &Experiment) -> DeviceUses {
        DeviceUses { angles: true, no_methods: &NO_METHODS, ..DeviceUses::default() }
    }

    fn parameters(&self, _: &Experiment) -> &'static [DeviceParameter] {
        &filters::PARAMETERS
    }

    fn densities(&self, _: &Experiment) -> Vec<StateDensity> {
        filters::NOISE.map(|entry| StateDensity::angular_acceleration(entry, "the rate")).into()
    }

    fn wanted(&self, experiment: &Experiment) -> Result<Vec<usize>, ConfigError> {
        ScannerSettings::of(experiment)?;
        wanted(experiment)
    }

    fn layout(&self, experiment: &Experiment, index: usize) -> Result<RecordingLayout, ConfigError> {
        let cycle_s = 1.0 / ScannerHardware::of(experiment)?.natural_hz();
        experiment.layout_to_estimate(index, &columns(experiment, index)?, cycle_s)
    }

    fn left_out(&self, experiment: &Experiment) -> Vec<OmittedNumber> {
        ScannerHardware::of(experiment)
            .map_or_else(|_| Vec::new(), |hardware| left_out(hardware.natural_hz()))
    }

    fn expanded(&self, experiment: &Experiment) -> Result<Expansion, ConfigError> {
        expanded::expanded(experiment)
    }

    fn estimator<'a>(
        &self,
        experiment: &'a Experiment,
        index: usize,
        progress: &'a dyn Progress,
    ) -> Result<Box<dyn Estimator + 'a>, EstimateError> {
        let settings = ScannerSettings::of(experiment)?;
        let columns = columns(experiment, index)?;
        let side_outputs = SideOutputs::default();
        Ok(Box::new(ScannerEstimator { settings, columns, side_outputs, past: Past::default(), progress }))
    }

    fn live<'a>(
        &self,
        experiment: &'a Experiment,
        index: usize,
        progress: &'a dyn Progress,
    ) -> Result<Box<dyn Estimator + 'a>, EstimateError> {
        let settings = ScannerSettings::of(experiment)?;
        let columns = columns(experiment, index)?;
        let filters: Vec<_> = settings.filters.iter().map(|filter| &filter.basics).collect();
        let hardware = &settings.hardware;
        let least = LEAST_AMPLITUDE * hardware.scanner.comb.angular_width;
        let side_outputs = side_outputs(experiment, &filters, (hardware.natural_hz(), Some(least)))?;
        Ok(Box::new(ScannerEstimator { settings, columns, side_outputs, past: Past::default(), progress }))
    }

    fn signs_from_s(
        &self,
        experiment: &Experiment,
        index: usize,
        recording: &SampledRecording,
    ) -> Result<Vec<f64>, EstimateError> {
        let skip_s = ScannerSettings::of(experiment)?.skip_s;
        let Some(first) = recording.segments().first() else { return Ok(Vec::new()) };
        let ([drive, signal], mut past) = (columns(experiment, index)?, Past::default());
        let part = SegmentPart::whole(recording, first);
        let segment = SignalSegment::of(&part, (signal, &kind::VOLTAGE), skip_s, &mut past)?;
        Ok(vec![DrivenSegment::of(&segment, drive, &mut past, &Silent)?.first_drive_peak(skip_s)])
    }

    fn outlook(&self, experiment: &Experiment) -> Result<Outlook, SimulateError> {
        outlook::outlook(experiment)
    }

    fn simulate(&self, experiment: &Experiment) -> Result<Box<dyn Simulation>, SimulateError> {
        match experiment.simulate.as_ref().map(|simulate| &simulate.drive) {
            Some(DriveSource::RingDown(drive)) => Ok(Box::new(RingDownSimulation::of(experiment, drive)?)),
            Some(DriveSource::Regulated(_)) => Ok(Box::new(regulation::RegulatedSimulation::of(experiment)?)),
            _ => simulation::simulation(experiment),
        }
    }

    fn identify(
        &self,
        experiment: &Experiment,
        progress: &dyn Progress,
    ) -> Result<Identification, IdentifyError> {
        identification::identify(experiment, progress)
    }
}

/// Estimates recordings of a scanner with one axis.
struct ScannerEstimator<'a> {
    settings: ScannerSettings,
    /// Those of drive and signal.
    columns: [&'a str; 2],
    /// What it gives besides the estimates.
    side_outputs: SideOutputs,
    past: Past,
    progress: &'a dyn Progress,
}

impl Estimator for ScannerEstimator<'_> {
    fn around(&self, interval_s: f64) -> RowsAround {
        let cycle_s = 1.0 / self.settings.hardware.natural_hz();
        let smooths = self.settings.filters.iter().any(|filter| filter.basics.smooth);
        let start_s = self.settings.skip_s + STARTING_CYCLES * cycle_s;
        let around = around_driven(interval_s, start_s, smooths, self.past.lag());
        let by_batch = self.settings.filters.iter().filter(|filter| filter.by_batch);
        let rows = by_batch.map(|filter| rows_for_start((cycle_s, interval_s), filter.states().len()));
        let again = self.settings.filters.iter().map(|filter| filter.states().len());
        let again =
            again.map(|states| rows_to_start_again((cycle_s, interval_s), states)).fold(0, usize::max);
        RowsAround { head: rows.fold(around.head, usize::max), before: around.before + again, ..around }
    }

    fn past(&mut self) -> &mut Past {
        &mut self.past
    }

    fn take(&mut self, part: &SegmentPart) -> Result<SegmentEstimate, EstimateError> {
        let (settings, [drive_column, signal_column]) = (&self.settings, self.columns);
        let past = &mut self.past;
        let segment = SignalSegment::of(part, (signal_column, &kind::VOLTAGE), settings.skip_s, past)?;
        segment.require_usable_signals(&[signal_column])?;
        past.drive.foresees = self.side_outputs.prediction.is_some();
        let data = &DrivenSegment::of(&segment, drive_column, past, self.progress)?;
        let motion = data.motion(settings.hardware.natural_hz());
        segment.require_cycles(motion.frequency_hz)?;
        let (side_outputs, place) = (&self.side_outputs, &segment.place);
        let trajectories = segment::estimate(settings, side_outputs, data, past, place, self.progress)?;
        let axis = AngleAxis { angle: "angle", motion, drive: data.drive.sine().copied() };
        let mut remarks = sign_after_restart(part, settings.first_peak_positive.is_some());
        remarks.extend(settings.poles_left_out().filter(|_| part.begins));
        Ok(SegmentEstimate {
            sign_is_hidden: true,
            remarks,
            ..segment.estimated_under(drive_column, (axis, Vec::new()), trajectories)
        })
    }

    fn conclude(&mut self, place: &str, diagnosis: &[Finding]) -> Result<(), EstimateError> {
        EstimateError::of_unusable_signal(diagnosis, (place, &[self.columns[1]]), |_| true)
    }
}

/// The amplitude from which there are zero phases, in widths of the comb: far below any motion that is used, far above what
/// a filter makes of noise.
const LEAST_AMPLITUDE: f64 = 0.01;
/// Cycles of the motion after the settling time in which a turning point tells its sign.
const STARTING_CYCLES: f64 = 4.0;

/// What the estimators of driven scanners need around the new rows: at first what shows the sine of the drive and the motion
/// for this long in s.
fn around_driven(interval_s: f64, start_s: f64, smooths: bool, lag: InterpolationLag) -> RowsAround {
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a positive count, saturating
    let rows = (start_s / interval_s).ceil() as usize;
    let (before, after) = lag.rows_around();
    RowsAround { head: rows.max(BLOCK), before, after, smooths }
}

/// The recordings that are estimated, their channels checked.
fn wanted(experiment: &Experiment) -> Result<Vec<usize>, ConfigError> {
    experiment
        .to_estimate(&[RecordingRole::Test, RecordingRole::SteadyState], |index| columns(experiment, index))
}

fn columns(experiment: &Experiment, index: usize) -> Result<[&str; 2], ConfigError> {
    let key = crate::config::Key::from("recording").index(index).child("channels");
    experiment.columns(key, &experiment.recording(index)?.channels, MEANINGS)
}
