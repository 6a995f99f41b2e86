//! The figures of recordings whose estimates come in parts.

use super::metrics::{segment, texts, without_findings};
use super::{Metrics, RecordingMetrics, SegmentMetrics};
use crate::config::Experiment;
use crate::diagnose::{FoundNoise, NumberCheck};
use crate::estimate::StretchSummary;
use crate::rigs::Rig;
use crate::workflow::{PartOutcome, WholeRecording};

/// Figures on the way, part by part.
#[derive(Clone, Debug, Default)]
pub(crate) struct PooledMetrics {
    recordings: Vec<RecordingMetrics>,
    /// When the present segment began, in s.
    began_s: f64,
}

impl PooledMetrics {
    /// Takes what came of the next part in; the figures of that part alone, where it has any.
    pub(crate) fn take(&mut self, part: &PartOutcome) -> Option<SegmentMetrics> {
        while self.recordings.len() <= part.index {
            let (name, file) = (part.outcome.name.clone(), part.outcome.recording.source().file.clone());
            let reference = part.outcome.reference.as_ref().map(|r| r.recording().source().file.clone());
            self.recordings.push(RecordingMetrics {
                name,
                file,
                origin: part.outcome.recording.source().origin.clone(),
                diagnosis: Vec::new(),
                reference,
                reference_diagnosis: Vec::new(),
                stretches: StretchSummary::default(),
                segments: Vec::new(),
            });
        }
        let outcome = part.outcome.segments.first()?;
        let figures = segment(outcome, part.outcome.values);
        let time = &outcome.estimate.segment.time;
        if part.begins {
            self.began_s = time.start_s();
        }
        let segments = &mut self.recordings.get_mut(part.index)?.segments;
        match segments.last_mut() {
            Some(own) if !part.begins => {
                own.pool(figures.clone());
                own.duration_s = time.at(time.len().saturating_sub(1)) - self.began_s;
            }
            _ => segments.push(figures.clone()),
        }
        Some(figures)
    }

    /// The present segment of a recording.
    pub(crate) fn segment(&self, recording: usize) -> Option<&SegmentMetrics> {
        self.recordings.get(recording)?.segments.last()
    }

    /// The names of the filters in whose innovations no test has found anything so far.
    pub(crate) fn without_findings(&self) -> Vec<String> {
        without_findings(&self.recordings)
    }

    /// The figures of the whole, with what its beginning says of the numbers and what noises it told.
    pub(crate) fn finish(
        mut self,
        (rig, experiment): (&dyn Rig, &Experiment),
        whole: &[WholeRecording],
        (numbers, noise): (NumberCheck, Vec<FoundNoise>),
    ) -> Metrics {
        for (own, whole) in self.recordings.iter_mut().zip(whole) {
            own.diagnosis = texts(&whole.diagnosis);
            own.stretches = whole.stretches.clone();
            own.reference_diagnosis =
                whole.reference.as_ref().map_or_else(Vec::new, |(_, found)| texts(found));
        }
        let metrics = Metrics {
            schema_version: Metrics::SCHEMA_VERSION,
            experiment: experiment.name.to_string(),
            rig: rig.name(),
            answer: Vec::new(),
            values: rig.values(experiment),
            held_as_exact: experiment.held_as_exact(),
            scale_notes: Vec::new(),
            unseen: Vec::new(),
            input_fault: None,
            noise_from_recording: noise,
            recordings: self.recordings,
        };
        metrics.with_numbers(numbers)
    }
}
