//! The rig of a scanner with two axes.

use super::expanded::expanded;
use super::filters::{NOISE, STATES};
use super::outlook::outlook;
use super::segment::{WINDOW_S, estimate, first_tones, resonances_hz};
use super::settings::TwoAxisSettings;
use super::simulation::simulation;
use super::tones::DriveTones;
use crate::config::{ConfigError, DeviceKind, DeviceUses, Experiment, Key, Method, RecordingRole};
use crate::equations::sign_after_restart;
use crate::estimate::driven::{BLOCK, DrivenSegment, InterpolationLag};
use crate::estimate::{
    AngleAxis, DeviceParameter, EstimateError, Past, RowsAround, SegmentEstimate, SegmentPart, SignalSegment,
    rows_for_start, rows_to_start_again,
};
use crate::outlook::Outlook;
use crate::progress::{Progress, Silent};
use crate::recording::{Finding, RecordingLayout, SampledRecording};
use crate::shared_scanner::device::SharedScanner;
use crate::simulate::{SimulateError, Simulation};
use crate::units::kind;
use crate::{Estimator, Expansion, Rig, StateDensity, Template, TemplateChannel};

/// The rig.
pub struct TwoAxesRig;

/// The names of each axis's angle and rate.
const ANGLES: [[&str; 2]; 2] = [["angle_x", "rate_x"], ["angle_y", "rate_y"]];

/// What a signal that is even in both angles, and in which they are mixed, does not allow.
static NO_METHODS: [(Method, &str); 1] = [(
    Method::DirectInversion,
    "its one signal is the sum of two parts, each even in an angle of its own; use `lock_in` or `ekf`",
)];

/// What an experiment with it begins from.
const TEMPLATE: Template = Template {
    text: include_str!("template.toml"),
    channels: &[TemplateChannel::DRIVE, TemplateChannel::SIGNAL],
    references: &[
        TemplateChannel::optional(
            "angle_x",
            ("the angle of x, measured otherwise", "rad"),
            &["angle_x", "theta_x", "x"],
        ),
        TemplateChannel::optional(
            "angle_y",
            ("the angle of y, measured otherwise", "rad"),
            &["angle_y", "theta_y", "y"],
        ),
    ],
};

impl Rig for TwoAxesRig {
    fn name(&self) -> &'static str {
        "shared_scanner.second_axis"
    }

    fn device(&self) -> DeviceKind {
        DeviceKind::of::<SharedScanner>()
    }

    fn template(&self) -> Option<Template> {
        Some(TEMPLATE)
    }

    fn claims(&self, experiment: &Experiment) -> Result<bool, ConfigError> {
        Ok(experiment.device::<SharedScanner>()?.second_axis.is_some())
    }

    fn uses(&self, _: &Experiment) -> DeviceUses {
        DeviceUses { angles: true, no_methods: &NO_METHODS, ..DeviceUses::default() }
    }

    fn parameters(&self, _: &Experiment) -> &'static [DeviceParameter] {
        &super::filters::PARAMETERS
    }

    fn densities(&self, _: &Experiment) -> Vec<StateDensity> {
        let [x, y] = NOISE;
        let of = StateDensity::angular_acceleration;
        vec![of(x, "the rate about x"), of(y, "the rate about y")]
    }

    fn wanted(&self, experiment: &Experiment) -> Result<Vec<usize>, ConfigError> {
        TwoAxisSettings::of(experiment)?;
        wanted(experiment)
    }

    fn layout(&self, experiment: &Experiment, index: usize) -> Result<RecordingLayout, ConfigError> {
        let slowest_hz =
            resonances_hz(&TwoAxisSettings::of(experiment)?).into_iter().fold(f64::INFINITY, f64::min);
        experiment.layout_to_estimate(index, &columns(experiment, index)?, 1.0 / slowest_hz)
    }

    fn angles(&self, _: &Experiment) -> &'static [[&'static str; 2]] {
        &ANGLES
    }

    fn expanded(&self, experiment: &Experiment) -> Result<Expansion, ConfigError> {
        expanded(experiment)
    }

    fn estimator<'a>(
        &self,
        experiment: &'a Experiment,
        index: usize,
        progress: &'a dyn Progress,
    ) -> Result<Box<dyn Estimator + 'a>, EstimateError> {
        let settings = TwoAxisSettings::of(experiment)?;
        let columns = columns(experiment, index)?;
        Ok(Box::new(TwoAxesEstimator { settings, columns, past: Past::default(), drive: None, progress }))
    }

    fn signs_from_s(
        &self,
        experiment: &Experiment,
        index: usize,
        recording: &SampledRecording,
    ) -> Result<Vec<f64>, EstimateError> {
        let settings = TwoAxisSettings::of(experiment)?;
        let Some(first) = recording.segments().first() else { return Ok(Vec::new()) };
        let ([drive, signal], mut past) = (columns(experiment, index)?, Past::default());
        let part = SegmentPart::whole(recording, first);
        let segment = SignalSegment::of(&part, (signal, &kind::VOLTAGE), settings.skip_s, &mut past)?;
        let data = DrivenSegment::of(&segment, drive, &mut past, &Silent)?;
        let tones = first_tones(&settings, &data, &segment.place)?.tones;
        Ok(tones.map(|tone| tone.peak_after(data.scored_from(settings.skip_s))).to_vec())
    }

    fn outlook(&self, experiment: &Experiment) -> Result<Outlook, SimulateError> {
        outlook(experiment)
    }

    fn simulate(&self, experiment: &Experiment) -> Result<Box<dyn Simulation>, SimulateError> {
        simulation(experiment)
    }
}

/// Estimates recordings of a scanner with two axes.
struct TwoAxesEstimator<'a> {
    settings: TwoAxisSettings,
    /// Those of drive and signal.
    columns: [&'a str; 2],
    past: Past,
    /// The drives of the segment that is being estimated.
    drive: Option<DriveTones>,
    progress: &'a dyn Progress,
}

impl Estimator for TwoAxesEstimator<'_> {
    fn around(&self, interval_s: f64) -> RowsAround {
        let slowest_hz = resonances_hz(&self.settings).into_iter().fold(f64::INFINITY, f64::min);
        let smooths = self.settings.filters.iter().any(|filter| filter.basics.smooth);
        // Of the last window, a lock-in says nothing before it has ended.
        let open = self.settings.filters.iter().any(|filter| filter.basics.method == Method::LockIn);
        let open_s = if open { WINDOW_S } else { 0.0 };
        let started_s = (self.settings.skip_s + STARTING_CYCLES / slowest_hz + open_s).max(WINDOW_S);
        let around = around_driven(interval_s, started_s, smooths, self.past.lag());
        let motion = (slowest_hz.recip(), interval_s);
        let states = self.settings.filters.iter().map(|filter| filter.basics.states(&STATES).len());
        let states = states.fold(0, usize::max);
        let head = around.head.max(rows_for_start(motion, states));
        RowsAround { head, before: around.before + rows_to_start_again(motion, states), ..around }
    }

    fn past(&mut self) -> &mut Past {
        &mut self.past
    }

    fn take(&mut self, part: &SegmentPart) -> Result<SegmentEstimate, EstimateError> {
        let (settings, [drive_column, signal_column]) = (&self.settings, self.columns);
        let past = &mut self.past;
        let segment = SignalSegment::of(part, (signal_column, &kind::VOLTAGE), settings.skip_s, past)?;
        if segment.begins {
            self.drive = None;
        }
        segment.require_usable_signals(&[signal_column])?;
        let data = &DrivenSegment::of(&segment, drive_column, past, self.progress)?;
        let drive = match self.drive {
            Some(drive) => drive,
            None => *self.drive.insert(first_tones(settings, data, &segment.place)?),
        };
        let [x, y] = drive.motions();
        segment.require_cycles(x.1.frequency_hz.min(y.1.frequency_hz))?;
        let trajectories = estimate(settings, (&segment.place, &drive), data, past, self.progress)?;
        let axis = |axis: usize, (angle, motion)| AngleAxis { angle, motion, drive: Some(drive.tones[axis]) };
        let calibrated = settings.first_peak_positive.iter().any(Option::is_some);
        let remarks = sign_after_restart(part, calibrated);
        let axes = (axis(0, x), vec![axis(1, y)]);
        Ok(SegmentEstimate {
            sign_is_hidden: true,
            remarks,
            ..segment.estimated_under(drive_column, axes, trajectories)
        })
    }

    fn conclude(&mut self, place: &str, diagnosis: &[Finding]) -> Result<(), EstimateError> {
        EstimateError::of_unusable_signal(diagnosis, (place, &[self.columns[1]]), |_| true)
    }
}

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

/// Those of drive and signal.
fn columns(experiment: &Experiment, index: usize) -> Result<[&str; 2], ConfigError> {
    let key = Key::from("recording").index(index).child("channels");
    experiment.columns(key, &experiment.recording(index)?.channels, ["drive", "signal"])
}
