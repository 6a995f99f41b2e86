//! What a rig is: a device with its drive, its recordings and its way of being estimated.
//!
//! A rig knows what a device's channels mean, which filters make sense for it and how its motion is compared
//! with a reference. The program meets it at [`Rig`], once per recording; the loops inside know their types.

mod considering;
mod density;
mod expansion;
mod omitted_number;
mod sampling;
mod template;
mod workbench;

pub use density::StateDensity;
pub use expansion::Expansion;
pub use omitted_number::{NumberForm, OmittedNumber};
pub use sampling::sampling;
pub use template::{Template, TemplateChannel};
pub use workbench::Workbench;

use crate::config::kinds::Length;
use crate::config::{ConfigError, ConfigFault, DeviceKind, DeviceUses, Experiment, Key, Positive, Quantity};
use crate::estimate::{
    DeviceParameter, EstimateError, Past, PastState, RowsAround, SegmentEstimate, SegmentPart, StretchJudge,
    StretchSummary, of_whole_segment,
};
use crate::evaluate::{Instruments, ONE_ANGLE, ReferenceChannels, ValueState};
use crate::export::{self, ExportError, ExportableFilter, Exported};
use crate::identify::{Identification, IdentifyError};
use crate::outlook::Outlook;
use crate::progress::Progress;
use crate::recording::{Finding, RecordingLayout, SampledRecording, Segment};
use crate::simulate::{SimulateError, Simulation};

/// A device with its drive, its recordings and its way of being estimated.
pub trait Rig: Send + Sync {
    /// Its name in results, such as `shared_scanner`.
    fn name(&self) -> &'static str;

    /// The device table that it reads.
    fn device(&self) -> DeviceKind;

    /// Reads the device table of an experiment that has one of this name, and says whether it is for this device; where
    /// several rigs read the same table, one of them is.
    fn claims(&self, experiment: &Experiment) -> Result<bool, ConfigError>;

    /// What an experiment with its device begins from, where there is one to give.
    fn template(&self) -> Option<Template> {
        None
    }

    /// What of an experiment file its device has a use for.
    fn uses(&self, experiment: &Experiment) -> DeviceUses {
        let _ = experiment;
        DeviceUses::default()
    }

    /// What its recorded input is called in figures.
    fn input(&self) -> &'static str {
        "drive"
    }

    /// The recordings of an experiment that an estimate is wanted for, as indices, and all that can be checked
    /// of the experiment before they are read.
    fn wanted(&self, experiment: &Experiment) -> Result<Vec<usize>, ConfigError>;

    /// How to read one of them. The reference's columns are not among those asked for.
    fn layout(&self, experiment: &Experiment, index: usize) -> Result<RecordingLayout, ConfigError>;

    /// The states that a reference may know, the name of an angle and that of its rate for each axis.
    fn angles(&self, experiment: &Experiment) -> &'static [[&'static str; 2]] {
        let _ = experiment;
        &ONE_ANGLE
    }

    /// The states that a reference may know and that are no angles; the first is what the device is for.
    fn values(&self, experiment: &Experiment) -> &'static [ValueState] {
        let _ = experiment;
        &[]
    }

    /// The parameters of the device that a filter may hold as uncertain, with the keys that stand for them.
    fn parameters(&self, experiment: &Experiment) -> &'static [DeviceParameter] {
        let _ = experiment;
        &[]
    }

    /// The densities of process noise that the filters of an experiment know.
    fn densities(&self, experiment: &Experiment) -> Vec<StateDensity> {
        let _ = experiment;
        Vec::new()
    }

    /// The instruments whose voltage a reference may hold instead of an angle or a rate.
    fn instruments(&self, experiment: &Experiment) -> Result<Instruments, ConfigError> {
        let _ = experiment;
        Ok(Instruments::default())
    }

    /// What a reference of this device may know.
    fn reference(&self, experiment: &Experiment) -> Result<ReferenceChannels, ConfigError> {
        let (angles, values) = (self.angles(experiment), self.values(experiment));
        Ok(ReferenceChannels { angles, values, instruments: self.instruments(experiment)? })
    }

    /// The length in the device table by which all lengths of its signal scale, and its key: what a spectrum's known line can
    /// correct.
    fn length_scale(&self, experiment: &Experiment) -> Result<Option<LengthScale>, ConfigError> {
        let _ = experiment;
        Ok(None)
    }

    /// Which channels of its recordings are inputs and which are signals, by their meanings: what may be wrong of each.
    fn channels(&self, experiment: &Experiment) -> RecordingChannels {
        let named = experiment.recordings.first().into_iter().flat_map(|recording| recording.channels.iter());
        let (mut inputs, mut signals) = (Vec::new(), Vec::new());
        for (meaning, _) in named {
            if meaning == "drive" {
                inputs.push(meaning.to_owned());
            } else if meaning.starts_with("signal") {
                signals.push(meaning.to_owned());
            }
        }
        RecordingChannels { inputs, signals }
    }

    /// Numbers that the device table may leave out, or have as zero, and that may be what is wrong.
    fn left_out(&self, experiment: &Experiment) -> Vec<OmittedNumber> {
        let _ = experiment;
        Vec::new()
    }

    /// Its device as differential equations, for a reader to change.
    fn expanded(&self, experiment: &Experiment) -> Result<Expansion, ConfigError> {
        let why = format!("differential equations of the device `{}` are not available", self.name());
        Err(experiment.error(Key::from("device").child(self.device().name), ConfigFault::Value { why }))
    }

    /// What estimates one of them, part by part, with the device exactly as its table has it.
    fn estimator<'a>(
        &self,
        experiment: &'a Experiment,
        index: usize,
        progress: &'a dyn Progress,
    ) -> Result<Box<dyn Estimator + 'a>, EstimateError>;

    /// The same with what the table says is uncertain of the device.
    fn considering<'a>(
        &self,
        experiment: &'a Experiment,
        index: usize,
        progress: &'a dyn Progress,
    ) -> Result<Box<dyn Estimator + 'a>, EstimateError> {
        considering::considering(self, experiment, &|told| self.estimator(told, index, progress))
    }

    /// What estimates samples that arrive, with what the experiment's table `stream` wants beside the estimates: phases, and
    /// zero phases before they happen; with the device exactly as its table has it.
    fn live<'a>(
        &self,
        experiment: &'a Experiment,
        index: usize,
        progress: &'a dyn Progress,
    ) -> Result<Box<dyn Estimator + 'a>, EstimateError> {
        let wanted = experiment.stream.as_ref().and_then(|stream| {
            let phase = stream.phase.then_some("phase");
            stream.trigger.as_ref().map(|_| "trigger").or(phase)
        });
        if let Some(key) = wanted {
            let why = format!("nothing is built that would say this of `{}`; leave it out", self.name());
            return Err(experiment.error(Key::from("stream").child(key), ConfigFault::Value { why }).into());
        }
        self.estimator(experiment, index, progress)
    }

    /// The same with what the table says is uncertain of the device.
    fn considering_live<'a>(
        &self,
        experiment: &'a Experiment,
        index: usize,
        progress: &'a dyn Progress,
    ) -> Result<Box<dyn Estimator + 'a>, EstimateError> {
        considering::considering(self, experiment, &|told| self.live(told, index, progress))
    }

    /// Estimates the motion in each segment of a recording that is held in memory.
    fn estimate(
        &self,
        experiment: &Experiment,
        index: usize,
        recording: &SampledRecording,
        progress: &dyn Progress,
    ) -> Result<Vec<SegmentEstimate>, EstimateError> {
        Ok(self.estimate_stretches(experiment, index, recording, progress)?.0)
    }

    /// The same, and what became of the stretches of records that were cut.
    fn estimate_stretches(
        &self,
        experiment: &Experiment,
        index: usize,
        recording: &SampledRecording,
        progress: &dyn Progress,
    ) -> Result<(Vec<SegmentEstimate>, StretchSummary), EstimateError> {
        estimate_by(&mut *self.considering(experiment, index, progress)?, recording)
    }

    /// For each angle of [`angles`](Self::angles), the time in s, on the recording's clock, from which on the first turning point in
    /// the first segment has the sign that the experiment states (`estimate.first_peak`, `estimate.first_peak_y`).
    ///
    /// Empty for a device whose signal tells the sign of its motion.
    ///
    /// # Errors
    /// Those of an estimate of the recording.
    fn signs_from_s(
        &self,
        experiment: &Experiment,
        index: usize,
        recording: &SampledRecording,
    ) -> Result<Vec<f64>, EstimateError> {
        let _ = (experiment, index, recording);
        Ok(Vec::new())
    }

    /// What can be said of the device and its drive before anything is recorded.
    fn outlook(&self, experiment: &Experiment) -> Result<Outlook, SimulateError>;

    /// The simulation that the experiment's `[simulate]` describes, checked and ready to run.
    fn simulate(&self, experiment: &Experiment) -> Result<Box<dyn Simulation>, SimulateError>;

    /// Identifies parameters of the device from the recordings that their roles say are for that.
    fn identify(
        &self,
        experiment: &Experiment,
        progress: &dyn Progress,
    ) -> Result<Identification, IdentifyError> {
        let _ = progress;
        let why = format!("no identification is built for `{}` yet", self.name());
        Err(experiment.error("device", ConfigFault::Value { why }).into())
    }

    /// The filter at this place of the file as it can be exported, and the columns of drive and signal.
    fn exported(
        &self,
        experiment: &Experiment,
        place: usize,
    ) -> Result<(Box<dyn ExportableFilter>, [String; 2]), ExportError> {
        let _ = (experiment, place);
        Err(ExportError::Device { device: self.name() })
    }

    /// The source code of a filter of the experiment for a microcontroller.
    fn export(
        &self,
        experiment: &Experiment,
        request: &export::ExportRequest,
    ) -> Result<Exported, ExportError> {
        export_of_rig(self, experiment, request)
    }
}

/// The source code of a filter that a rig exports by itself.
pub fn export_of_rig(
    rig: &(impl Rig + ?Sized),
    experiment: &Experiment,
    request: &export::ExportRequest,
) -> Result<Exported, ExportError> {
    let place = export::place_of_filter(experiment, request)?;
    let name = experiment.estimate.iter().flat_map(|estimate| &estimate.filters).nth(place);
    let name = name.map(|filter| filter.name.to_string()).unwrap_or_default();
    let (filter, columns) = rig.exported(experiment, place)?;
    let first_recording = || {
        let Some(index) = rig.wanted(experiment)?.first().copied() else { return Ok(None) };
        let file = experiment.resolve(&experiment.recording(index)?.file);
        Ok(Some((file, rig.layout(experiment, index)?)))
    };
    export::export((experiment, request), (&*filter, name), &columns, first_recording)
}

/// Channels of a recording by their meanings.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct RecordingChannels {
    /// What drives the device.
    pub inputs: Vec<String>,
    /// What is measured of it; the first is that of a filter's first innovations.
    pub signals: Vec<String>,
}

/// A length of the device table by which all lengths that its signal tells scale.
#[derive(Clone, Debug)]
pub struct LengthScale {
    /// The key in the experiment file.
    pub key: &'static str,
    /// Its value.
    pub length: Quantity<Length, Positive>,
}

/// Estimates a recording, segment by segment, and each segment part by part.
pub trait Estimator {
    /// Whether the segment with this label is to be estimated.
    fn wants(&self, label: &str) -> bool {
        let _ = label;
        true
    }

    /// What it needs of the rows around those that are new, in a recording of this interval in s between samples.
    fn around(&self, interval_s: f64) -> RowsAround;

    /// What is kept of the segment that is being estimated.
    fn past(&mut self) -> &mut Past;

    /// What another run needs to go on from here.
    fn state(&mut self) -> PastState {
        self.past().state()
    }

    /// Goes on from where another run was, before any part has been taken.
    fn resume(&mut self, state: &PastState) {
        self.past().resume(state);
    }

    /// What the filters say of the new rows of a part: the first of a segment, or that which follows the last one.
    fn take(&mut self, part: &SegmentPart) -> Result<SegmentEstimate, EstimateError>;

    /// Refuses a recording that was taken in parts, with what was found in it, where only all of it shows that its estimate is
    /// no good; `place` is what messages call it.
    fn conclude(&mut self, place: &str, diagnosis: &[Finding]) -> Result<(), EstimateError> {
        let _ = (place, diagnosis);
        Ok(())
    }
}

/// What an estimator says of each segment of a recording that is held in memory, and what became of the stretches of records that were cut.
///
/// # Errors
/// Those of an estimate.
pub fn estimate_by(
    estimator: &mut (dyn Estimator + '_),
    recording: &SampledRecording,
) -> Result<(Vec<SegmentEstimate>, StretchSummary), EstimateError> {
    let wanted = recording.segments().iter().filter(|segment| estimator.wants(&segment.label));
    let wanted: Vec<&Segment> = wanted.collect();
    let (mut judge, mut estimates) = (StretchJudge::default(), Vec::new());
    for segment in wanted {
        let head = segment.time.interval_s().map_or(0, |interval_s| estimator.around(interval_s).head);
        let take = &mut |part: &SegmentPart| estimator.take(part);
        estimates.extend(of_whole_segment(&mut judge, (recording, segment), head, take)?);
    }
    Ok((estimates, judge.finish()?))
}
