//! The results of an estimate that comes in parts, written as they come.

use super::figure_files::write_figure;
use super::figures::{SegmentFigures, course};
use super::files::{columns, run_record, signal_unit, write_header, write_rows};
use super::names::of_parts;
use super::page::page_with;
use super::samples::SamplesFile;
use crate::config::Experiment;
use crate::diagnose::{FoundNoise, NumberCheck};
use crate::recording::{RecordingSource, Segment};
use crate::results::pooled::PooledMetrics;
use crate::results::tracks::{PartPlace, Tracks};
use crate::results::{Metrics, Output, ResultFile, ResultWriteError, RunInfo, SegmentMetrics, WriteOptions};
use crate::rigs::Rig;
use crate::workflow::{PartOutcome, SegmentOutcome, WholeRecording};
use std::collections::BTreeMap;
use std::fs;
use std::time::UNIX_EPOCH;

/// Segments of a long recording, and stretches of a record, of which there are pictures.
pub(super) const PICTURED: usize = 16;

/// The results of an estimate on the way.
///
/// They are those of [`write_estimate`](crate::results::write_estimate), but that the pictures show the last part of each segment, and
/// how the filters fared from part to part.
pub struct LongEstimate<'a> {
    rig: &'a dyn Rig,
    output: &'a Output,
    experiment: &'a Experiment,
    input_id: String,
    pooled: PooledMetrics,
    drawn: Vec<Vec<SegmentFigures>>,
    /// What has passed of the present segment.
    tracks: Tracks,
    /// The file of all samples of the report, once there is a part.
    samples: Option<SamplesFile<'a>>,
    /// The files of trajectories.
    files: BTreeMap<String, ResultFile>,
    /// Figures of the parts of the present segment.
    parts: Vec<PartFigures>,
    options: WriteOptions,
    stop: &'a dyn Fn() -> bool,
}

/// How the filters fared in a part.
#[derive(Clone, Debug)]
pub(super) struct PartFigures {
    /// The middle of the part in s.
    pub(super) time_s: f64,
    /// Those of each filter.
    pub(super) filters: Vec<FilterFigures>,
}

/// The name of a filter, its mean NIS, and the root mean square error of the angle in degrees.
pub(super) type FilterFigures = (String, Option<f64>, Option<f64>);

impl<'a> LongEstimate<'a> {
    /// Begins to write into a result; where `stop` says so, the work ends.
    pub fn begin(
        rig: &'a dyn Rig,
        experiment: &'a Experiment,
        output: &'a Output,
        options: WriteOptions,
        stop: &'a dyn Fn() -> bool,
    ) -> Self {
        Self {
            output,
            rig,
            experiment,
            input_id: input_id(experiment),
            pooled: PooledMetrics::default(),
            drawn: Vec::new(),
            tracks: Tracks::default(),
            samples: None,
            files: BTreeMap::new(),
            parts: Vec::new(),
            options,
            stop,
        }
    }

    /// Takes what came of the next part.
    pub fn part(&mut self, part: &PartOutcome) -> Result<(), ResultWriteError> {
        if (self.stop)() {
            return Err(ResultWriteError::Interrupted);
        }
        if self.drawn.len() <= part.index {
            self.drawn.resize_with(part.index + 1, Vec::new);
        }
        let figures = self.pooled.take(part);
        let (Some(outcome), Some(figures)) = (part.outcome.segments.first(), figures) else { return Ok(()) };
        let time = &outcome.estimate.segment.time;
        let last_s = time.at(time.len().saturating_sub(1));
        if part.begins {
            self.parts.clear();
            self.tracks = Tracks::new(&self.prefix(part, &outcome.estimate.segment));
        }
        if self.is_drawn() {
            self.tracks.take_part(&part.outcome, outcome, place_of(part));
            self.samples(part, outcome)?;
        }
        self.parts.push(PartFigures::of(&figures, time.start_s().midpoint(last_s)));
        if self.options.trajectories {
            self.trajectories(part, outcome)?;
        }
        if part.ends {
            self.draw(part, outcome)?;
            for file in std::mem::take(&mut self.files).into_values() {
                self.output.seal(file)?;
            }
        }
        Ok(())
    }

    /// The recording's name where there are several, the segment's where it has one.
    fn prefix(&self, part: &PartOutcome, segment: &Segment) -> String {
        let (several, label) = (self.experiment.recordings.len() > 1, segment.label.as_str());
        of_parts([(several, &part.outcome.name), (!label.is_empty(), label)], segment.stretch.number)
    }

    fn trajectories(&mut self, part: &PartOutcome, outcome: &SegmentOutcome) -> Result<(), ResultWriteError> {
        let estimate = &outcome.estimate;
        let unit = signal_unit(&part.outcome, outcome);
        let prefix = self.prefix(part, &estimate.segment);
        for trajectory in &estimate.trajectories {
            let name = format!("{prefix}trajectory_{}.csv", trajectory.key);
            let columns = columns(trajectory, &unit);
            if !self.files.contains_key(&name) {
                let mut file = self.output.create(&name)?;
                write_header(&columns, &mut file).map_err(|e| self.output.error(&name, e))?;
                self.files.insert(name.clone(), file);
            }
            let Some(file) = self.files.get_mut(&name) else { continue };
            let whole = write_rows(&columns, file, self.stop);
            if !whole.map_err(|e| self.output.error(&name, e))? {
                return Err(ResultWriteError::Interrupted);
            }
        }
        Ok(())
    }

    fn samples(&mut self, part: &PartOutcome, outcome: &SegmentOutcome) -> Result<(), ResultWriteError> {
        if !self.options.trajectories {
            return Ok(());
        }
        let prefix = self.prefix(part, &outcome.estimate.segment);
        let mut file = self.samples.take().map_or_else(|| SamplesFile::begin(self.output), Ok)?;
        file.take_part(&part.outcome, outcome, (place_of(part), &prefix))?;
        self.samples = Some(file);
        Ok(())
    }

    /// Whether there are pictures of the present segment.
    fn is_drawn(&self) -> bool {
        self.drawn.iter().map(Vec::len).sum::<usize>() < PICTURED
    }

    /// The pictures of a segment that has ended.
    fn draw(&mut self, part: &PartOutcome, outcome: &SegmentOutcome) -> Result<(), ResultWriteError> {
        if !self.is_drawn() {
            return Ok(());
        }
        let prefix = self.prefix(part, &outcome.estimate.segment);
        let judged = self.pooled.segment(part.index);
        let trusted = judged.and_then(SegmentMetrics::best_key);
        let mut all = SegmentFigures::of(&part.outcome, outcome, &self.tracks, &prefix, trusted);
        if self.parts.len() > 1 {
            all.judged.insert(0, course(&self.parts, &prefix));
        }
        for figure in all.pictured() {
            write_figure(self.output, figure)?;
        }
        self.drawn[part.index].push(all);
        Ok(())
    }

    /// The names of the filters in whose innovations no test has found anything so far.
    pub fn without_findings(&self) -> Vec<String> {
        self.pooled.without_findings()
    }

    /// Writes what belongs to the whole, with what its beginning says of the numbers and what noises it told; the figures.
    pub fn finish(
        self,
        whole: &[WholeRecording],
        (numbers, noise): (NumberCheck, Vec<FoundNoise>),
        info: RunInfo,
    ) -> Result<Metrics, ResultWriteError> {
        let rig = self.rig;
        let metrics = self.pooled.finish((rig, self.experiment), whole, (numbers, noise));
        self.output.write("metrics.json", |w| {
            serde_json::to_writer_pretty(&mut *w, &metrics)?;
            writeln!(w)
        })?;
        let samples = self.samples.map(SamplesFile::finish).transpose()?;
        let html =
            page_with((self.experiment, rig.name()), &metrics, &self.drawn).beside(samples).to_html()?;
        self.output.write("report.html", |w| w.write_all(html.as_bytes()))?;
        let references = whole.iter().map(|whole| whole.reference.as_ref().map(|(source, _)| source));
        let sources = whole.iter().map(|whole| Some(&whole.source)).zip(references);
        let sources: Vec<&RecordingSource> =
            sources.flat_map(|(own, reference)| [own, reference]).flatten().collect();
        self.output.write_run(&self.input_id, || run_record(self.experiment, &metrics, sources, info))?;
        Ok(metrics)
    }
}

fn place_of(part: &PartOutcome) -> PartPlace {
    PartPlace { begins: part.begins, ends: part.ends }
}

impl PartFigures {
    fn of(segment: &SegmentMetrics, time_s: f64) -> Self {
        let filters = segment.estimators.iter().map(|e| {
            let nis = e.consistency.as_ref().map(|c| c.mean_nis);
            (e.name.clone(), nis, e.errors.as_ref().map(|e| e.angle.rmse_deg))
        });
        Self { time_s, filters: filters.collect() }
    }
}

/// What tells one input from another before it is read: the experiment's name, and length and time of its files.
fn input_id(experiment: &Experiment) -> String {
    let of = |recording: &crate::config::Recording| {
        if let Some(arrays) = experiment.arrays().get(&recording.file) {
            return format!("{} {}", recording.file.display(), arrays.digest().sha256);
        }
        let path = experiment.resolve(&recording.file);
        let known = fs::metadata(&path).ok().filter(fs::Metadata::is_file);
        let changed = known.as_ref().and_then(|known| known.modified().ok());
        let changed_s = changed.and_then(|t| t.duration_since(UNIX_EPOCH).ok()).map_or(0, |t| t.as_secs());
        let length = known.map_or(0, |known| known.len());
        format!("{} {length} {changed_s}", recording.file.display())
    };
    let files: Vec<String> = experiment.recordings.iter().map(of).collect();
    format!("{}: {}", experiment.name, files.join(", "))
}
