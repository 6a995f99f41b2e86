//! Estimates what is not estimated yet, on several threads, and puts all of it together.

use super::journal::{BatchHeader, BatchPiece, BatchPieces};
use super::results::{BatchRow, BatchSummary, RecordingEstimate, write_results};
use super::work::{
    Broken, clear, digest_of_content, finish, is_there, on_one_line, unfinished_file, with_recording,
};
use super::{BatchContent, BatchError, BatchRecording};
use crate::array_experiment::ArrayExperiment;
use crate::config::{ConfigError, Experiment, Source};
use crate::diagnose::leaves_noise_open;
use crate::journal::{Journal, digest_of};
use crate::progress::{Progress, each_on_threads, map_on_threads, processors};
use crate::results::{EarlierResult, Output, Work};
use crate::rigs::Workbench;
use crate::sealed_line::hex;
use sha2::{Digest, Sha256};
use std::collections::{BTreeMap, BTreeSet};
use std::num::NonZero;
use std::path::{Path, PathBuf};

/// Counts up where the same input gives other results, so that no journal is continued across it.
const FORMAT: u32 = 2;

/// What stands for a recording's name in the path of its reference.
const NAME: &str = "{name}";

/// An experiment for many recordings.
#[derive(Clone, Debug)]
pub struct Batch {
    workbench: Workbench,
    source: Source,
    /// The name of the experiment.
    name: String,
    of: Option<String>,
    references: Option<String>,
    /// What the experiment names beside the recording that is replaced.
    inputs: Vec<PathBuf>,
}

/// How to run a batch.
#[derive(Clone, Copy, Debug, Default)]
pub struct BatchOptions {
    /// How many recordings at once; as many as the machine can, if `None`. Each takes the memory of its samples and trajectories.
    pub threads: Option<NonZero<usize>>,
    /// Begin anew where the journal, or the results, are those of another batch.
    pub force: bool,
}

/// What was there, and what was done.
#[derive(Clone, Debug)]
pub struct BatchOutcome {
    /// What all came to.
    pub summary: BatchSummary,
    /// The folder of the results.
    pub folder: PathBuf,
    /// The journal beside it.
    pub journal: PathBuf,
    /// Recordings that were estimated now.
    pub estimated: usize,
    /// Recordings that were estimated by an earlier call.
    pub before: usize,
    /// Whether a line that was being written when the program was stopped was dropped from the journal.
    pub torn: bool,
    /// What became of the earlier results.
    pub committed: EarlierResult,
}

/// What is known of a recording before it is read as one: its SHA-256 and its key, or why it has none.
type Looked = Result<(String, String), String>;

impl Batch {
    /// Reads an experiment file. The recordings of a batch stand instead of its recording `of`, given by name or role, or, where
    /// nothing is said, of its only one, else of the only one with the role `test`.
    pub fn load(workbench: &Workbench, path: &Path, of: Option<&str>) -> Result<Self, BatchError> {
        Self::of_source(workbench, Source::load(path)?, of)
    }

    /// The same of an experiment file's text; `path` is where it stands, or would stand.
    pub fn parse(
        workbench: &Workbench,
        text: &str,
        path: &Path,
        of: Option<&str>,
    ) -> Result<Self, BatchError> {
        Self::of_source(workbench, Source::of(text, path)?, of)
    }

    fn of_source(workbench: &Workbench, source: Source, of: Option<&str>) -> Result<Self, BatchError> {
        // What is wrong with the experiment is wrong for all recordings.
        let raw = Experiment::parse(&source.text, &source.path)?;
        if !leaves_noise_open(workbench, &raw)? {
            workbench.parse(&source.text, &source.path)?;
        }
        ArrayExperiment::new(&source.text, &source.path)?.alone(of)?;
        Ok(Self {
            workbench: workbench.clone(),
            name: raw.name.to_string(),
            inputs: raw.files(),
            source,
            of: of.map(str::to_owned),
            references: None,
        })
    }

    /// Compares each recording with a reference of its own: `files` is the path of one, with `{name}` instead of the recording's name. Without
    /// this, the reference is in the file of the recording, or there is none.
    #[must_use]
    pub fn with_references(self, files: &str) -> Self {
        Self { references: Some(files.to_owned()), ..self }
    }

    /// Whether the experiment compares its recording with a reference in a file of its own, of which a batch knows none.
    pub fn leaves_reference_out(&self) -> bool {
        let Ok(mut given) = ArrayExperiment::new(&self.source.text, &self.source.path) else { return false };
        self.references.is_none() && given.has_reference_file(self.of.as_deref())
    }

    /// The name of the experiment.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The journal for results in a folder: beside it, with its name.
    pub fn journal(&self, out: &Path) -> PathBuf {
        self.beside(out, "journal")
    }

    fn beside(&self, out: &Path, ending: &str) -> PathBuf {
        let name =
            out.file_name().map_or_else(|| self.name.clone(), |name| name.to_string_lossy().into_owned());
        out.with_file_name(format!("{name}.{ending}"))
    }

    /// Estimates the recordings that the journal beside `out` does not have yet, and writes the results of all into the folder `out`:
    /// `trajectories/NAME.parquet`, `summary.csv` with a row for each recording, `results.csv` with all figures of all filters, both as Parquet as well,
    /// `report.html`, the experiment, and `run.toml`.
    ///
    /// The same recordings give the same bytes, in whatever order and by however many calls they were estimated.
    ///
    /// # Errors
    /// Those of the experiment and of what is written. A recording that cannot be estimated is none, and is tried again by the next call.
    pub fn run(
        &self,
        recordings: &[BatchRecording],
        out: &Path,
        options: BatchOptions,
        progress: &dyn Progress,
    ) -> Result<BatchOutcome, BatchError> {
        require_names(recordings)?;
        let threads = options.threads.map_or_else(processors, NonZero::get);
        let output = Output::begin(out, &self.work(recordings).forced(options.force))?;
        let journal = self.journal(out);
        let (mut writer, mut pieces, torn) = Journal::open(&journal, &self.header()?, options.force)?;
        let interrupted = |done, total| BatchError::Interrupted { done, total, journal: journal.clone() };
        let look = |place: usize, heard: &dyn Progress| self.look(recordings.get(place)?, heard);
        let looked =
            map_on_threads((progress, "looking at recordings"), threads, (recordings.len(), 1), look);
        let Some(looked) = looked else { return Err(interrupted(0, recordings.len())) };
        let same_as = same_as(&looked);

        let folder = self.beside(out, "unfinished");
        std::fs::create_dir_all(&folder).map_err(|source| BatchError::Io { path: folder.clone(), source })?;
        let place_of = |piece: &BatchPiece| {
            let file = unfinished_file(&folder, &piece.key);
            let is_unfinished = is_there(&file, &piece.trajectories);
            if is_unfinished { Some(file) } else { output.standing_file(&piece.trajectories) }
        };
        let alone: Vec<(usize, &String)> = looked
            .iter()
            .enumerate()
            .filter(|(place, _)| !same_as.contains_key(place))
            .filter_map(|(place, looked)| Some((place, &looked.as_ref().ok()?.1)))
            .collect();
        let is_missing = |key: &String| pieces.get(key).is_none_or(|piece| place_of(piece).is_none());
        let missing: Vec<(usize, &String)> =
            alone.iter().copied().filter(|(_, key)| is_missing(key)).collect();
        let before = alone.len() - missing.len();

        progress.begin("estimating", missing.len() as u64);
        let (mut failures, mut estimated) = (BTreeMap::new(), 0);
        each_on_threads(
            progress,
            threads,
            (missing.len(), 1),
            |place, heard| {
                let (recording, key) = missing.get(place)?;
                match self.finish(recordings.get(*recording)?, key, &folder, heard) {
                    Err(Broken::Stopped) => None,
                    finished => Some(finished),
                }
            },
            |place, finished| {
                match finished {
                    Ok(piece) => {
                        estimated += 1;
                        if !pieces.contains_key(&piece.key) {
                            writer.add(&piece)?;
                        }
                        pieces.insert(piece.key.clone(), piece);
                    }
                    Err(Broken::Recording(why)) => drop(failures.insert(missing[place].0, why)),
                    Err(Broken::Results(error)) => return Err(error),
                    Err(Broken::Stopped) => {}
                }
                Ok(())
            },
        )?;
        if estimated + failures.len() < missing.len() {
            return Err(interrupted(before + estimated, alone.len()));
        }
        let rows = rows(recordings, (&looked, &same_as), (&pieces, &failures));
        let summary = write_results((&self.name, &self.source.text), &rows, &output, &place_of)?;
        let committed = output.commit()?;
        clear(&folder, alone.iter().map(|(_, key)| *key))
            .map_err(|source| BatchError::Io { path: folder.clone(), source })?;
        Ok(BatchOutcome { summary, folder: out.to_owned(), journal, estimated, before, torn, committed })
    }

    /// What the results are of, and the files that are read for them.
    fn work(&self, recordings: &[BatchRecording]) -> Work {
        let mut inputs = self.inputs.clone();
        for recording in recordings {
            if let BatchContent::File(file) = &recording.content {
                inputs.push(file.clone());
            }
            inputs.extend(self.reference(recording));
        }
        Work::of_file("batch", &self.source.path, inputs)
    }

    /// The file of a recording's reference.
    fn reference(&self, recording: &BatchRecording) -> Option<PathBuf> {
        Some(PathBuf::from(self.references.as_ref()?.replace(NAME, &recording.name)))
    }

    /// What tells the work on each recording from other work: the experiment without the recording, and the files that it reads beside it.
    fn header(&self) -> Result<BatchHeader, ConfigError> {
        let mut given = ArrayExperiment::new(&self.source.text, &self.source.path)?;
        let raw = Experiment::parse(&self.source.text, &self.source.path)?;
        let (rest, further) = given.without_recording(self.of.as_deref())?;
        let mut hash = Sha256::new();
        hash.update(FORMAT.to_le_bytes());
        let references = self.references.as_deref().map_or("", |_| NAME);
        for text in [env!("CARGO_PKG_VERSION"), rest.as_str(), references] {
            hash.update((text.len() as u64).to_le_bytes());
            hash.update(text);
        }
        for file in further {
            // Who reads it says that it is not there.
            if let Ok(Some(digest)) = digest_of(&raw.resolve(&file), &|| false) {
                hash.update(digest);
            }
        }
        Ok(BatchHeader::new(hex(&hash.finalize())))
    }

    fn look(&self, recording: &BatchRecording, progress: &dyn Progress) -> Option<Looked> {
        let reference = self.reference(recording);
        let stop = || progress.reached(0).is_break();
        let found = digest_of_content(&recording.content, reference.as_deref(), &stop)?;
        Some(found.map(|(sha256, all)| (sha256, hex(&Sha256::digest(all)))))
    }

    fn finish(
        &self,
        recording: &BatchRecording,
        key: &str,
        folder: &Path,
        progress: &dyn Progress,
    ) -> Result<BatchPiece, Broken> {
        if progress.reached(0).is_break() {
            return Err(Broken::Stopped);
        }
        let wrong = |error: ConfigError| Broken::Recording(on_one_line(&error));
        let given = ArrayExperiment::new(&self.source.text, &self.source.path).map_err(wrong)?;
        let reference = self.reference(recording);
        let given = with_recording(given, self.of.as_deref(), recording, reference.as_deref())?;
        finish((&self.workbench, given), key, folder, progress)
    }
}

/// What is known of each recording, in their order.
fn rows<'a>(
    recordings: &'a [BatchRecording],
    (looked, same_as): (&'a [Looked], &BTreeMap<usize, usize>),
    (pieces, failures): (&'a BatchPieces, &'a BTreeMap<usize, String>),
) -> Vec<BatchRow<'a>> {
    let row = |(place, (recording, looked)): (usize, (&'a BatchRecording, &'a Looked))| {
        let first = same_as.get(&place).copied();
        let (sha256, came) = match looked {
            Err(why) => ("", RecordingEstimate::Failed(why)),
            Ok((sha256, key)) => {
                let came = match (failures.get(&first.unwrap_or(place)), pieces.get(key)) {
                    (None, Some(piece)) => RecordingEstimate::Made(piece),
                    (why, _) => RecordingEstimate::Failed(why.map_or("it was not estimated", String::as_str)),
                };
                (sha256.as_str(), came)
            }
        };
        BatchRow { recording, sha256, same_as: first.and_then(|first| recordings.get(first)), came }
    };
    recordings.iter().zip(looked).enumerate().map(row).collect()
}

/// Which recordings have the content of an earlier one, and of which.
fn same_as(looked: &[Looked]) -> BTreeMap<usize, usize> {
    let mut first: BTreeMap<&str, usize> = BTreeMap::new();
    let mut same = BTreeMap::new();
    for (place, looked) in looked.iter().enumerate() {
        if let Ok((_, key)) = looked {
            match first.get(key.as_str()) {
                Some(earlier) => drop(same.insert(place, *earlier)),
                None => drop(first.insert(key, place)),
            }
        }
    }
    same
}

/// Refuses names that do not tell the recordings apart.
fn require_names(recordings: &[BatchRecording]) -> Result<(), BatchError> {
    let mut known = BTreeSet::new();
    match recordings.iter().find(|recording| !known.insert(recording.name.as_str())) {
        Some(twice) => Err(BatchError::Name { name: twice.name.clone() }),
        None => Ok(()),
    }
}
