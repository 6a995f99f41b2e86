//! One filter and the beginning of its recordings, run again and again with changes.

use super::DiagnoseError;
use super::change::TrialChange;
use super::document::{document, text};
use super::stop::StopFlag;
use super::trial::DiagnosisTrial;
use crate::config::{ConfigFault, Experiment, FilterStart, Key, Method, RecordingRole, exactly, put};
use crate::evaluate::StepErrors;
use crate::identify::Material;
use crate::progress::{Progress, ReaderProgress};
use crate::recording::{SampledRecording, StretchSize, Stretches};
use crate::rigs::Workbench;
use crate::stated_start::{leaves_start_sd_out, write_start_sds};
use toml::{Table, Value};

/// What trials have in common.
pub(super) struct TrialBench<'a> {
    pub(super) workbench: &'a Workbench,
    /// What the filter is told.
    pub(super) experiment: Experiment,
    /// The same, to be changed.
    pub(super) document: Table,
    /// Which of the experiment's filters it is.
    pub(super) filter: usize,
    /// Its name.
    pub(super) filter_name: String,
    /// The channel that its first innovations are of, by its meaning.
    pub(super) signal: String,
    /// The same in each direction of what the experiment states as uncertain of its device.
    varied: Vec<Experiment>,
    /// Recordings with their places in the experiment.
    recordings: Vec<(usize, SampledRecording)>,
    /// Heard by each run.
    pub(super) stop: StopFlag,
}

/// By how much longer a start from the signal may take with other numbers.
const LONGER_START: f64 = 1.1;

/// Whether a run's innovations are tested.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Judged {
    Yes,
    No,
}

/// Rows after the settling time that are looked at.
#[derive(Clone, Copy, Debug)]
pub(super) struct TestedRows(pub(super) usize);

impl<'a> TrialBench<'a> {
    /// One of an experiment's filters: that with this name, or else the first whose innovations are white when it is right.
    pub(super) fn of(
        workbench: &'a Workbench,
        experiment: &Experiment,
        filter: Option<&str>,
    ) -> Result<Self, DiagnoseError> {
        let filters = experiment.estimate.as_ref().map_or(&[][..], |estimate| &estimate.filters);
        let place = match filter {
            Some(name) => filters.iter().position(|filter| filter.name.as_str() == name),
            None => filters.iter().position(|filter| is_judged(filter.method)),
        };
        let Some((place, chosen)) = place.and_then(|place| Some((place, filters.get(place)?))) else {
            let known: Vec<&str> = filters.iter().map(|filter| filter.name.as_str()).collect();
            let why = match filter {
                Some(name) => format!("there is no filter `{name}`; there are `{}`", known.join("`, `")),
                None => "no filter has innovations that are white when it is right; add one with `method = \"ekf\"`".to_owned(),
            };
            return Err(experiment.error("estimate.filter", ConfigFault::Value { why }).into());
        };
        if !is_judged(chosen.method) {
            let why = format!(
                "the innovations of the method `{}` are not white when it is right, and do not tell what is wrong; expected a \
                 filter such as `ekf`",
                chosen.method.word()
            );
            let key = Key::from("estimate").child("filter").index(place).child("method");
            return Err(experiment.error(key, ConfigFault::Value { why }).into());
        }
        let mut document = document(experiment)?;
        keep_one_filter(&mut document, place);
        let parsed = |document: &Table| -> Result<Experiment, DiagnoseError> {
            Ok(workbench.parse(&text(document, experiment)?, experiment.path())?)
        };
        let uncertain = parsed(&document)?;
        let varied = uncertain.varied()?.iter().map(|varied| varied.experiment.clone()).collect();
        if leaves_start_sd_out(&mut document) {
            let parameters = workbench.rig(&uncertain)?.parameters(&uncertain);
            write_start_sds(&mut document, &uncertain, parameters)?;
        }
        // What is asked for is what of the numbers as they stand is wrong.
        exactly(&mut document);
        let told = parsed(&document)?;
        let filter_name = chosen.name.to_string();
        let signal = workbench.rig(&told)?.channels(&told).signals.into_iter().next().unwrap_or_default();
        let (recordings, stop) = (Vec::new(), StopFlag::default());
        Ok(Self {
            workbench,
            experiment: told,
            document,
            filter: place,
            filter_name,
            signal,
            varied,
            recordings,
            stop,
        })
    }

    /// The same with the beginning of each recording that the rig wants, as much as has so many rows after the settling time, in all.
    pub(super) fn with_files(
        mut self,
        TestedRows(rows): TestedRows,
        progress: &dyn Progress,
    ) -> Result<Self, DiagnoseError> {
        let rig = self.workbench.rig(&self.experiment)?;
        let wanted = rig.wanted(&self.experiment)?;
        let mut left = rows;
        for index in wanted {
            let described = self.experiment.recording(index)?;
            let file = self.experiment.resolve(&described.file);
            let layout = rig.layout(&self.experiment, index)?;
            let around = StretchSize { rows, first: rows, before: 0, after: 0 };
            let mut stretches = Stretches::open(&file, &layout, around)?;
            let mut reading = ReaderProgress::new(progress, "reading");
            let hear = &mut |done: u64, total: u64| reading.hear(done, total);
            while left > 0 {
                let Some(interval_s) = stretches.beginning(hear)? else {
                    // Within a segment, or after the last.
                    if stretches.next(hear)?.is_none() {
                        break;
                    }
                    continue;
                };
                let skipped = self.skipped_rows(interval_s);
                let most = skipped.saturating_add(left);
                stretches.give(StretchSize { rows: most, first: most, before: 0, after: 0 });
                let Some(stretch) = stretches.next(hear)? else { break };
                left = left.saturating_sub(stretch.recording.rows().saturating_sub(skipped));
                self.recordings.push((index, stretch.recording));
            }
        }
        Ok(self)
    }

    /// The same with the beginning of a recording that is there already, for the first that the rig wants: as much as has so many rows
    /// after the settling time of its first segment.
    pub(super) fn with_beginning(
        self,
        recording: &SampledRecording,
        TestedRows(rows): TestedRows,
    ) -> Result<Self, DiagnoseError> {
        let interval_s = recording.segments().first().and_then(|segment| segment.time.interval_s());
        let skipped = self.skipped_rows(interval_s.unwrap_or(f64::INFINITY));
        self.with_recording(recording.first_rows(skipped.saturating_add(rows)))
    }

    /// The same with a settling time that is not shorter than a start from the signal takes, also with other numbers of the device.
    ///
    /// The number of cycles from which a start is found is fixed, so that it ends at another sample with another resonance. Samples that one trial
    /// counts and another does not would make their likelihoods incomparable.
    pub(super) fn behind_the_start(mut self, base: &DiagnosisTrial) -> Self {
        let Some(estimate) = &self.experiment.estimate else { return self };
        let start = estimate.filters.get(self.filter).and_then(|filter| filter.start.as_ref());
        // With a stated start every sample counts, whatever the numbers.
        if matches!(start, Some(FilterStart::Values(_))) {
            return self;
        }
        let skip_s = estimate.skip.si();
        let longer_s = LONGER_START * base.begins_s();
        let (_, long_s) = self.extent();
        // Of a recording that is hardly longer than its start everything counts that there is.
        if base.begins_s() > skip_s && longer_s < 0.5 * long_s / self.recordings.len() as f64 {
            self.settle_in(longer_s);
        }
        self
    }

    /// Takes another settling time.
    fn settle_in(&mut self, skip_s: f64) {
        let key = Key::from("estimate").child("skip");
        let skip = Value::String(format!("{skip_s:e} s"));
        // The key is there: a filter has been run.
        if put(&mut self.document, &key, skip).is_ok()
            && let Ok(text) = toml::to_string(&self.document)
            && let Ok(experiment) = self.workbench.parse(&text, self.experiment.path())
        {
            self.experiment = experiment;
        }
    }

    /// The same with no more than this part of each recording, or so many rows of it at least, and with what its document says by now. The
    /// settling time of a stated start is half of it at most; a start from the signal has its own before that.
    pub(super) fn beginning(&self, part: usize, least: usize) -> Self {
        let estimate = self.experiment.estimate.as_ref();
        let start = estimate.and_then(|estimate| estimate.filters.get(self.filter)?.start.as_ref());
        let is_stated = matches!(start, Some(FilterStart::Values(_)));
        let rows = |recording: &SampledRecording| {
            let skipped = if is_stated { 0 } else { self.skipped_rows(interval_s(recording)) };
            skipped + (recording.rows().saturating_sub(skipped) / part).max(least)
        };
        let mut short = self.cut(rows);
        if let (true, Some((_, first))) = (is_stated, self.recordings.first()) {
            let half_s = 0.5 * rows(first) as f64 * interval_s(first);
            short.settle_in(estimate.map_or(0.0, |estimate| estimate.skip.si()).min(half_s));
        }
        short
    }

    /// The same with no more than the beginning of each recording, and with what its document says by now.
    pub(super) fn shortened(&self, TestedRows(rows): TestedRows) -> Self {
        self.cut(|recording| self.skipped_rows(interval_s(recording)).saturating_add(rows))
    }

    /// The same with no more than so many rows of each recording.
    fn cut(&self, rows: impl Fn(&SampledRecording) -> usize) -> Self {
        let short =
            |(index, recording): &(usize, SampledRecording)| (*index, recording.first_rows(rows(recording)));
        Self {
            workbench: self.workbench,
            experiment: self.experiment.clone(),
            document: self.document.clone(),
            filter: self.filter,
            filter_name: self.filter_name.clone(),
            signal: self.signal.clone(),
            varied: Vec::new(),
            recordings: self.recordings.iter().map(short).collect(),
            stop: self.stop.clone(),
        }
    }

    /// The rows behind the settling time of the recording that has most of them.
    pub(super) fn longest(&self) -> usize {
        let behind = |(_, recording): &(usize, SampledRecording)| {
            recording.rows().saturating_sub(self.skipped_rows(interval_s(recording)))
        };
        self.recordings.iter().map(behind).max().unwrap_or(0)
    }

    /// The rows of the settling time.
    fn skipped_rows(&self, interval_s: f64) -> usize {
        let skip_s = self.experiment.estimate.as_ref().map_or(0.0, |estimate| estimate.skip.si());
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // saturating; a number of rows
        {
            (skip_s / interval_s).ceil() as usize
        }
    }

    /// The same with a recording that is there already, for the first that the rig wants.
    pub(super) fn with_recording(mut self, recording: SampledRecording) -> Result<Self, DiagnoseError> {
        let wanted = self.workbench.rig(&self.experiment)?.wanted(&self.experiment)?;
        self.recordings.extend(wanted.first().map(|index| (*index, recording)));
        Ok(self)
    }

    /// The first recording's samples of a channel, by its meaning, in SI, and the interval between them in s.
    pub(super) fn samples(&self, meaning: &str) -> Option<(&[f64], f64)> {
        let (index, recording) = self.recordings.first()?;
        let described = self.experiment.recordings.get(*index)?;
        let (_, column) = described.channels.iter().find(|(own, _)| *own == meaning)?;
        let values = recording.columns().iter().find(|own| own.header.column == *column)?;
        let interval_s = recording.segments().first().and_then(|segment| segment.time.interval_s());
        Some((&values.values, interval_s.unwrap_or(f64::NAN)))
    }

    /// The column of a channel in the first recording, by its meaning.
    pub(super) fn column(&self, meaning: &str) -> String {
        let described = self.recordings.first().and_then(|(index, _)| self.experiment.recordings.get(*index));
        let column = described.and_then(|described| described.channels.column(meaning));
        column.unwrap_or(meaning).to_owned()
    }

    /// The times of the first segment of the first recording in s, with the samples of a channel in SI and the interval between them in s.
    pub(super) fn first_segment(&self, meaning: &str) -> Option<(Vec<f64>, &[f64], f64)> {
        let (values, interval_s) = self.samples(meaning)?;
        let segment = self.recordings.first()?.1.segments().first()?;
        Some((segment.time.to_vec(), values.get(segment.rows.clone())?, interval_s))
    }

    /// What the filter says with these changes; `None` where it cannot be run.
    pub(super) fn run(&self, changes: &[TrialChange]) -> Option<DiagnosisTrial> {
        self.run_with(changes, Judged::Yes, &|_| true)
    }

    /// The same without the tests of its innovations, for what asks for differences alone.
    pub(super) fn run_unjudged(&self, changes: &[TrialChange]) -> Option<DiagnosisTrial> {
        self.run_with(changes, Judged::No, &|_| true)
    }

    /// The same as long as a condition holds of what it has said so far; `None` as soon as it does not.
    pub(super) fn run_while(
        &self,
        changes: &[TrialChange],
        holds: &dyn Fn(&DiagnosisTrial) -> bool,
    ) -> Option<DiagnosisTrial> {
        self.run_with(changes, Judged::No, holds)
    }

    fn run_with(
        &self,
        changes: &[TrialChange],
        judged: Judged,
        holds: &dyn Fn(&DiagnosisTrial) -> bool,
    ) -> Option<DiagnosisTrial> {
        if self.stop.is_stopped() {
            return None;
        }
        let mut document = self.document.clone();
        for change in changes {
            change.write(&mut document).ok()?;
        }
        let text = toml::to_string(&document).ok()?;
        let changed = self.workbench.parse(&text, self.experiment.path()).ok()?;
        self.run_experiment(&changed, changes, (judged, holds))
    }

    /// What the filter says in each direction of what the experiment states as uncertain, with one standard deviation more there.
    pub(super) fn in_uncertain_directions(&self) -> impl Iterator<Item = DiagnosisTrial> {
        self.varied.iter().filter_map(|told| self.run_experiment(told, &[], (Judged::No, &|_| true)))
    }

    /// How far its steps lead it astray in the first recording, with this number of them from each sample to the next or as many as it plans, and how fast
    /// the device moves there in Hz; `None` where that is not followed.
    pub(super) fn step_errors(&self, steps: Option<u32>) -> Option<(StepErrors, f64)> {
        let mut document = self.document.clone();
        if let Some(steps) = steps {
            let key = Key::from("estimate").child("filter").index(0).child("steps");
            put(&mut document, &key, Value::Integer(steps.into())).ok()?;
        }
        let told = self.workbench.parse(&toml::to_string(&document).ok()?, self.experiment.path()).ok()?;
        let (index, recording) = self.recordings.first()?;
        let estimates =
            self.workbench.rig(&told).ok()?.estimate(&told, *index, recording, &self.stop).ok()?;
        let estimate = estimates.first()?;
        let errors = StepErrors::of(estimate.trajectories.first()?, estimate.start_s + estimate.skip_s)?;
        Some((errors, estimate.motion.frequency_hz))
    }

    /// What it says where it is told this, of recordings with these changes.
    fn run_experiment(
        &self,
        told: &Experiment,
        changes: &[TrialChange],
        (judged, holds): (Judged, &dyn Fn(&DiagnosisTrial) -> bool),
    ) -> Option<DiagnosisTrial> {
        // Trials are compared by their innovations, and most of what is tried loses the signal.
        let mut told = told.clone();
        let filters = told.estimate.iter_mut().flat_map(|estimate| &mut estimate.filters);
        filters.for_each(|filter| filter.stays_lost = true);
        let told = &told;
        let rig = self.workbench.rig(told).ok()?;
        let mut trial = DiagnosisTrial::default();
        for (index, recording) in &self.recordings {
            self.stop.count(recording.rows());
            let described = told.recording(*index).ok()?;
            let columns: Vec<(String, String)> = described
                .channels
                .iter()
                .map(|(meaning, column)| (meaning.to_owned(), column.to_owned()))
                .collect();
            let mut altered: Option<SampledRecording> = None;
            for change in changes {
                altered = change.alter(altered.as_ref().unwrap_or(recording), &columns).or(altered);
            }
            let recording = altered.as_ref().unwrap_or(recording);
            for estimate in rig.estimate(told, *index, recording, &self.stop).ok()? {
                trial.take((rig, told), &estimate, judged)?;
                if !holds(&trial) {
                    return None;
                }
            }
        }
        trial.ended()
    }

    /// The recordings, as an identification names them.
    pub(super) fn materials(&self) -> Vec<Material> {
        let one = |(index, recording): &(usize, SampledRecording)| {
            let described = self.experiment.recordings.get(*index);
            let name = described.and_then(|described| described.name.as_ref());
            let segment = recording.segments().first();
            Material {
                name: name.map_or_else(|| recording.source().file.clone(), ToString::to_string),
                role: described.map_or(RecordingRole::Test, |described| described.role),
                time_s: segment.map(|segment| segment.time.to_vec()).unwrap_or_default(),
                interval_s: segment.and_then(|segment| segment.time.interval_s()).unwrap_or(f64::NAN),
                signal: Vec::new(),
                angle: Vec::new(),
                sources: vec![recording.source().clone()],
                diagnosis: recording.diagnosis().to_vec(),
            }
        };
        let mut materials: Vec<Material> = self.recordings.iter().map(one).collect();
        materials.dedup_by(|a, b| a.name == b.name);
        materials
    }

    /// How many rows there are in a second, within their segments.
    pub(super) fn rate_hz(&self) -> f64 {
        let segments: usize = self.recordings.iter().map(|(_, recording)| recording.segments().len()).sum();
        let (rows, long_s) = self.extent();
        rows.saturating_sub(segments) as f64 / long_s
    }

    /// The rows that are looked at, and how long they take, in s.
    pub(super) fn extent(&self) -> (usize, f64) {
        let segments = self.recordings.iter().flat_map(|(_, recording)| recording.segments());
        segments.fold((0, 0.0), |(rows, long_s), segment| {
            let last = segment.time.at(segment.time.len().saturating_sub(1));
            (rows + segment.time.len(), long_s + last - segment.time.start_s())
        })
    }
}

/// The interval between samples in s; infinite of a single one.
fn interval_s(recording: &SampledRecording) -> f64 {
    let interval_s = recording.segments().first().and_then(|segment| segment.time.interval_s());
    interval_s.unwrap_or(f64::INFINITY)
}

/// Whether the innovations of a method are white when it is right, and depend on what it is told.
pub(super) fn is_judged(method: Method) -> bool {
    method.claims()
        && !matches!(
            method,
            Method::Luenberger
                | Method::KalmanBucy
                | Method::SteadyState
                | Method::ConsiderEkf
                | Method::Bank
        )
}

/// Leaves one filter, without its smoothers, and drops what an estimate does not read.
fn keep_one_filter(document: &mut Table, place: usize) {
    if !document.contains_key("recording") {
        return;
    }
    for unread in ["simulate", "stream"] {
        document.remove(unread);
    }
    let Some(Value::Table(estimate)) = document.get_mut("estimate") else { return };
    estimate.remove("parts");
    if let Some(Value::Array(filters)) = estimate.get_mut("filter")
        && place < filters.len()
    {
        let mut filter = filters.swap_remove(place);
        if let Value::Table(filter) = &mut filter {
            filter.remove("smooth");
            filter.remove("smooth_lag");
        }
        *filters = vec![filter];
    }
}
