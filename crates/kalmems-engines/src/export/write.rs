//! From an experiment to the files of an export.

use super::samples::ExportSamples;
use super::{
    ExportError, ExportRequest, ExportTask, ExportableFilter, FilterSource, SourceCost, SourceDigits,
    SourceLanguage, SourceTrial,
};
use crate::config::{ConfigError, ConfigFault, Experiment, FilterTable, OutlierGate, Update};
use crate::recording::{ReadError, RecordingLayout, SampledRecording};
use crate::signal::quintic_middle;
use crate::units::kind;
use kalmems_store::Output;
use serde::Serialize;
use sha2::{Digest, Sha256};
use std::fmt::Write as _;
use std::path::PathBuf;

/// The files of an export, and what they say of themselves.
#[derive(Clone, Debug)]
pub struct Exported {
    /// The filter's name.
    pub filter: String,
    /// The sampling interval in s.
    pub interval_s: f64,
    /// Names and contents.
    pub files: Vec<(String, String)>,
    /// What the source is to be run over, where that was wanted.
    pub trial: Option<SourceTrial>,
    /// What a step takes, if the operations are counted.
    pub cost: Option<SourceCost>,
    /// The names of the numbers of a sample in the order of a step's arguments, if it is made from equations.
    pub columns: Vec<String>,
    /// The names of the states with their units, as the functions of the source have them.
    pub states: Vec<String>,
    /// What tells this input from another.
    pub(super) input_id: String,
}

/// The place of the filter that is asked for among those of the experiment.
pub fn place_of_filter(experiment: &Experiment, request: &ExportRequest) -> Result<usize, ExportError> {
    let filters =
        experiment.estimate.as_ref().map(|estimate| estimate.filters.as_slice()).unwrap_or_default();
    let wanted = |filter: &FilterTable| {
        filter.name.to_string() == request.filter || filter.name.key() == request.filter
    };
    let place = filters.iter().position(wanted).ok_or_else(|| {
        let known = filters.iter().map(|filter| format!("`{}`", filter.name)).collect();
        ExportError::NoFilter { found: request.filter.clone(), known }
    })?;
    match missing(&filters[place]) {
        None => Ok(place),
        Some(why) => Err(ExportError::Filter { filter: filters[place].name.to_string(), why }),
    }
}

/// Which key of a filter's table the source does not have, and what to do. Each key is named here, so that a new one is in the source or is refused.
fn missing(table: &FilterTable) -> Option<String> {
    let FilterTable {
        // What the source is made of.
        name: _,
        method: _,
        start: _,
        start_sd: _,
        start_about: _,
        process_noise: _,
        states: _,
        signal_variance: _,
        threshold: _,
        events: _,
        channels: _,
        observer_bandwidth: _,
        steps: _,
        gate: _,
        // What a device's own exporter or settings refuse.
        demodulator: _,
        variant: _,
        known_acceleration: _,
        known: _,
        // Another trajectory of the estimate, whose filter is the same.
        smooth: _,
        stays_lost: _,
        // Of methods that are refused, and of an update that is.
        alpha: _,
        beta: _,
        kappa: _,
        degrees_of_freedom: _,
        readout,
        noise_memory,
        smooth_lag,
        update,
    } = table;
    match update {
        Update::Normal if smooth_lag.is_some() => Some(
            "the source says each sample when it comes and has no smoother; leave `smooth_lag` out"
                .to_owned(),
        ),
        Update::Normal if readout.is_some() => {
            Some("the source has no states of the readout; leave `readout` out".to_owned())
        }
        Update::Normal if noise_memory.is_some() => Some(
            "the source knows the variance of a sample and does not estimate it; leave `noise_memory` out"
                .to_owned(),
        ),
        Update::Normal => None,
        update => Some(format!("the source has no update `{}`; leave `update` out", update.word())),
    }
}

/// Derives the constants of the filter called `name` and writes the source. The same experiment and recording give the same
/// bytes.
///
/// `columns` are those of drive and signal in the first recording, which `recording` names with how it is read: the
/// sampling interval and the samples come from there where the request does not say them.
pub fn export(
    (experiment, request): (&Experiment, &ExportRequest),
    (filter, name): (&dyn ExportableFilter, String),
    columns: &[String; 2],
    recording: impl FnOnce() -> Result<Option<(PathBuf, RecordingLayout)>, ConfigError>,
) -> Result<Exported, ExportError> {
    let refuse = |why: &str| Err(ExportError::Filter { filter: name.clone(), why: why.to_owned() });
    let mut filters = experiment.estimate.iter().flat_map(|estimate| &estimate.filters);
    let is_gated = |filter: &FilterTable| matches!(filter.gate, Some(OutlierGate::FalseRejections(_)));
    if filters.any(|filter| filter.name.to_string() == name && is_gated(filter)) {
        return refuse(
            "its source has no gate and takes every sample; write `gate = false`, and leave outliers out before the samples get to it",
        );
    }
    let (interval_s, samples) = sampled(experiment, request, columns, recording)?;
    if !request.adjustable.is_empty() {
        return refuse(
            "its parameters are constants of the source; leave `--adjustable` out, or expand the experiment to equations",
        );
    }
    if request.verify {
        return refuse(
            "its source is not one of equations, whose program reads samples; leave `--verify` out",
        );
    }
    if request.digits == SourceDigits::Double {
        return refuse(
            "its source has numbers of 32 bits; leave `--digits` out, or expand the experiment to equations",
        );
    }
    let heading = heading(experiment, request, &name, interval_s);
    let task = ExportTask {
        target: request.target,
        filter: &name,
        prefix: &c_name(&experiment.name.to_string()),
        heading: &heading,
        interval_s,
        update_every: request.update_every,
        samples: &samples,
    };
    let FilterSource { mut files } = filter.source(&task)?;
    if request.samples > 0 {
        let name = match request.target {
            SourceLanguage::Rust => "samples.rs",
            SourceLanguage::C => "samples.h",
        };
        files.push((name.to_owned(), samples.to_source(request.target, &heading)));
    }
    Ok(Exported::of(experiment, request, (name, interval_s), files))
}

/// The first four bytes of the digest of an experiment, by which parameters know theirs.
pub fn checksum(experiment: &Experiment) -> u32 {
    digest(experiment).get(..8).and_then(|text| u32::from_str_radix(text, 16).ok()).unwrap_or_default()
}

/// Lines for the head of each file: the experiment with its digest, the filter, and its interval in s.
pub fn heading(
    experiment: &Experiment,
    request: &ExportRequest,
    filter: &str,
    interval_s: f64,
) -> Vec<String> {
    let corrected = match request.update_every.get() {
        1 => "every sample".to_owned(),
        every => format!("one sample in {every}"),
    };
    let mut lines = vec![
        format!("Made by kalmems {} with `kalmems export`; not to be edited.", env!("CARGO_PKG_VERSION")),
        format!("Experiment `{}`, sha256 {}, filter `{filter}`.", experiment.name, digest(experiment)),
        format!("Sampling interval {interval_s:e} s, corrected by {corrected}."),
    ];
    lines.extend(request.notes.iter().cloned());
    lines
}

impl Exported {
    /// The files of a filter at its interval in s.
    pub fn of(
        experiment: &Experiment,
        request: &ExportRequest,
        (filter, interval_s): (String, f64),
        files: Vec<(String, String)>,
    ) -> Self {
        let ExportRequest { target, samples, update_every, adjustable, digits, .. } = request;
        let digest = digest(experiment);
        let adjustable = if adjustable.is_empty() {
            String::new()
        } else {
            format!(", {} adjustable", adjustable.join(" "))
        };
        let digits = match digits {
            SourceDigits::AsNeeded => "",
            SourceDigits::Single => ", in 32 bits",
            SourceDigits::Double => ", in 64 bits",
        };
        let input_id = format!(
            "{}: export {} to {target:?}, {filter}, {interval_s:e} s, one in {update_every}, {samples} samples{adjustable}{digits}",
            experiment.name,
            digest.get(..12).unwrap_or(&digest)
        );
        Self {
            filter,
            interval_s,
            files,
            trial: None,
            cost: None,
            columns: Vec::new(),
            states: Vec::new(),
            input_id,
        }
    }
}

/// Writes the files of an export into a result.
pub fn write_export(exported: &Exported, output: &Output) -> Result<(), ExportError> {
    for (name, content) in &exported.files {
        output.write(name, |w| w.write_all(content.as_bytes()))?;
    }
    let manifest = ExportManifest { filter: &exported.filter, interval_s: exported.interval_s };
    Ok(output.write_run(&exported.input_id, || Ok(manifest))?)
}

/// What the folder says of itself: nothing that changes from run to run.
#[derive(Serialize)]
struct ExportManifest<'a> {
    filter: &'a str,
    interval_s: f64,
}

/// The sampling interval, and the samples that are asked for.
fn sampled(
    experiment: &Experiment,
    request: &ExportRequest,
    [drive, signal]: &[String; 2],
    recording: impl FnOnce() -> Result<Option<(PathBuf, RecordingLayout)>, ConfigError>,
) -> Result<(f64, ExportSamples), ExportError> {
    if let Some(interval_s) = request.interval_s {
        if request.samples > 0 {
            return Err(ExportError::SamplesOfAnotherRate);
        }
        return Ok((interval_s, ExportSamples::default()));
    }
    let Some((file, layout)) = recording()? else {
        let why = "there is no recording to take the sampling interval from; give `--rate`".to_owned();
        return Err(experiment.error("recording", ConfigFault::Value { why }).into());
    };
    let recording = SampledRecording::read(&file, &layout)?;
    let shown = || recording.source().file.clone();
    let segment = recording.segments().first();
    let Some((segment, interval_s)) = segment.and_then(|s| Some((s, s.time.interval_s()?))) else {
        return Err(ExportError::NoInterval { file: shown() });
    };
    let column = |name: &str| -> Result<&[f64], ReadError> {
        Ok(recording.column_of(name, &kind::VOLTAGE)?.of(segment))
    };
    let (drive, signal, time_s) = (column(drive)?, column(signal)?, segment.time.to_vec());
    let known = drive.iter().zip(signal).take_while(|(v, y)| v.is_finite() && y.is_finite()).count();
    let asked = request.samples;
    if known < asked {
        return Err(ExportError::Samples { file: shown(), asked, found: known });
    }
    let middle = |to: usize| match to {
        0 => drive[0],
        _ => quintic_middle(&time_s, |i| drive[i], to, 2),
    };
    let samples = ExportSamples {
        drive: drive[..asked].to_vec(),
        middle: (0..asked).map(middle).collect(),
        signal: signal[..asked].to_vec(),
    };
    Ok((interval_s, samples))
}

/// The digest of all that an experiment says.
fn digest(experiment: &Experiment) -> String {
    let mut text = String::new();
    for byte in Sha256::digest(experiment.to_toml().unwrap_or_default()) {
        let _ = write!(text, "{byte:02x}");
    }
    text
}

/// A name that C takes.
pub fn c_name(name: &str) -> String {
    let mut found: String =
        name.chars().map(|c| if c.is_ascii_alphanumeric() { c.to_ascii_lowercase() } else { '_' }).collect();
    if found.starts_with(|c: char| c.is_ascii_digit()) {
        found.insert(0, '_');
    }
    found
}
