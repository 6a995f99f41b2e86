//! The recording that an identification takes.

use super::super::data::AccelerometerSegment;
use crate::config::{ConfigFault, Experiment, Key, RecordingRole};
use crate::identify::{IdentifyError, Material, require_usable_signals};
use crate::progress::Progress;
use crate::recording::SampledRecording;
use crate::units::kind;

/// The channels that a recording may have.
const MEANINGS: [&str; 3] = ["signal", "feedback", "acceleration"];

/// Signal and feedback over one record.
#[derive(Clone, Debug)]
pub struct IdentificationRecord {
    /// The signal and where it comes from.
    pub material: Material,
    /// The feedback in V, where there is one.
    pub feedback: Option<Vec<f64>>,
    /// The column of the signal.
    pub signal_column: String,
    /// The column of the feedback.
    pub feedback_column: String,
}

impl IdentificationRecord {
    /// The recording of the role `training`, or, where there is none, the one of the role `test`.
    pub fn read(
        experiment: &Experiment,
        has_feedback: bool,
        progress: &dyn Progress,
    ) -> Result<Self, IdentifyError> {
        let index = place(experiment)?;
        let described = experiment.recording(index)?;
        let key = || Key::from("recording").index(index).child("channels");
        if let Some((name, _)) = described.channels.iter().find(|(name, _)| !MEANINGS.contains(name)) {
            return Err(experiment.error(key().child(name), ConfigFault::unknown_key(name, MEANINGS)).into());
        }
        let column = |name: &str, example: &str| {
            described.channels.column(name).ok_or_else(|| {
                let remedy = format!("name the column, such as `{name} = \"{example}\"`");
                experiment.error(key().child(name), ConfigFault::MissingKey { remedy })
            })
        };
        let signal = column("signal", "output_V")?;
        let feedback = if has_feedback { Some(column("feedback", "feedback_V")?) } else { None };
        let columns: Vec<&str> = [Some(signal), feedback].into_iter().flatten().collect();
        let mut started = false;
        let file = experiment.resolve(&described.file);
        let recording =
            SampledRecording::read_with(&file, &described.layout(&columns), &mut |done, total| {
                if !started {
                    progress.begin("reading", total);
                    started = true;
                }
                progress.reached(done)
            })?;
        let name =
            described.name.as_ref().map_or_else(|| recording.source().file.clone(), ToString::to_string);
        require_usable_signals(recording.diagnosis(), &name, &[signal])?;
        let unfit = |why: String| IdentifyError::Unfit { recording: name.clone(), why };
        let [segment] = recording.segments() else {
            let count = recording.segments().len();
            return Err(unfit(format!("it holds {count} segments; expected one record")));
        };
        let even = segment.time.interval_s().filter(|_| segment.time.is_uniform());
        let interval_s = even.ok_or_else(|| {
            unfit("its samples are not taken at equal intervals; expected a record without gaps".to_owned())
        })?;
        let of = |column| -> Result<Vec<f64>, IdentifyError> {
            Ok(recording.column_of(column, &kind::VOLTAGE)?.of(segment).to_vec())
        };
        let record = Self {
            feedback: feedback.map(of).transpose()?,
            signal_column: signal.to_owned(),
            feedback_column: feedback.unwrap_or_default().to_owned(),
            material: Material {
                role: described.role,
                time_s: segment.time.to_vec(),
                interval_s,
                signal: of(signal)?,
                angle: Vec::new(),
                sources: vec![recording.source().clone()],
                diagnosis: recording.diagnosis().to_vec(),
                name: name.clone(),
            },
        };
        let data = record.data();
        data.require_whole(&record.feedback_column, &name).map_err(|why| unfit(why.to_string()))?;
        Ok(record)
    }

    /// As the filters take it.
    pub fn data(&self) -> AccelerometerSegment<'_> {
        AccelerometerSegment {
            time_s: &self.material.time_s,
            signal: &self.material.signal,
            feedback: self.feedback.as_deref(),
            interval_s: self.material.interval_s,
        }
    }
}

fn place(experiment: &Experiment) -> Result<usize, IdentifyError> {
    for role in [RecordingRole::Training, RecordingRole::Test] {
        let mut of_role =
            experiment.recordings.iter().enumerate().filter(|(_, recording)| recording.role == role);
        let Some((index, _)) = of_role.next() else { continue };
        if let Some((second, _)) = of_role.next() {
            let why =
                "an identification takes one recording; give the role `training` to one alone".to_owned();
            let key = Key::from("recording").index(second).child("role");
            return Err(experiment.error(key, ConfigFault::Value { why }).into());
        }
        return Ok(index);
    }
    let why = "no recording has the role `training` or `test`; parameters are identified from one".to_owned();
    Err(experiment.error("recording", ConfigFault::Value { why }).into())
}
