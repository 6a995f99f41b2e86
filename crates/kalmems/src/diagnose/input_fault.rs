//! A fault of the channels by which a filter loses the signal: channels that are exchanged or inverted, and a drive that is not that of the signal.
//!
//! No single sample shows such a fault, and no single channel; it is known by the model. Where a filter's innovations are far larger than it claims, the
//! beginning of the recording is filtered again with one channel inverted, with each pair of signals exchanged, and with a drive of the frequency that
//! the signal has. What makes the innovations likelier by far, and as large as
//! claimed, is named.

use super::bench::{TestedRows, TrialBench};
use super::change::{ChannelAlteration, TrialChange};
use super::trial::{DiagnosisTrial, TrialBlocks};
use crate::rigs::RecordingChannels;
use crate::signal::{Sine, fit_sine};
use kalmems_figures::significant;
use serde::Serialize;
use std::f64::consts::TAU;
use std::fmt;

/// Rows after the settling time that are filtered.
const ROWS: TestedRows = TestedRows(8000);
/// The mean NIS from which on a fault is looked for.
const SUSPICIOUS_NIS: f64 = 1.02;
/// The mean NIS up to which innovations are as large as claimed but for what a small fault of the device's numbers leaves.
const EXPLAINED_NIS: f64 = 2.0;
/// The part of what the mean NIS is above 1 that a fault may leave.
const LEFT: f64 = 0.25;
/// By how much innovations have to be likelier, in ln p.
const CERTAIN: f64 = 50.0;
/// By how much less likely than the best another fault may be, and explain the recording as well.
const AS_LIKELY: f64 = 3.0;
/// Phases of the drive that are tried first, and how often the interval between them is halved.
const PHASES: u32 = 8;
const HALVINGS: u32 = 4;
/// The relative difference between the frequencies of drive and motion from which on they are two.
const OTHER_FREQUENCY: f64 = 2e-5;
/// Standard deviations of the frequency of the signal's sine, as far as its residual is white noise, that it must differ by.
const FREQUENCY_SDS: f64 = 20.0;

/// A fault of the channels that explains the recording.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct InputFault {
    /// The filter by whose innovations it is known.
    pub filter: String,
    /// What is wrong, in words; faults that the recording cannot tell apart are joined.
    pub found: String,
    /// By how much its innovations are likelier without the fault, in ln p; nothing where the filter cannot be run with it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gain: Option<f64>,
    /// Their mean square over what is claimed, with the fault and without; infinite where the filter cannot be run.
    pub mean_nis: [f64; 2],
}

impl fmt::Display for InputFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (filter, [with, without]) = (&self.filter, self.mean_nis.map(significant));
        write!(f, "the channels are probably wrong: {}; with this corrected ", self.found)?;
        match self.gain {
            Some(_) => write!(f, "the mean NIS of `{filter}` is {without} in place of {with}")?,
            None => write!(f, "`{filter}` follows the signal with a mean NIS of {without}")?,
        }
        f.write_str(": check the wiring, and the columns in `[recording.channels]`")
    }
}

/// A fault that is tried.
pub(super) struct TriedFault {
    pub(super) words: String,
    pub(super) changes: Vec<TrialChange>,
}

/// The fault of the channels that explains why a filter's innovations are larger than claimed; nothing where they are not, and where none does.
pub(super) fn input_fault(bench: &TrialBench) -> Option<InputFault> {
    let bench = &bench.shortened(ROWS);
    let base = bench.run_unjudged(&[]);
    if base.as_ref().is_some_and(|base| base.follows() && base.mean_nis() < SUSPICIOUS_NIS) {
        return None;
    }
    let rig = bench.workbench.rig(&bench.experiment).ok()?;
    let channels = rig.channels(&bench.experiment);
    // With a sum that is larger than all innovations together may have, or once the signal is lost, nothing is explained.
    let largest_nis =
        base.as_ref().map_or(EXPLAINED_NIS, |base| EXPLAINED_NIS.min(1.0 + LEFT * above_1(base)));
    let most = largest_nis * (bench.extent().0 * channels.signals.len()) as f64;
    let may_explain = |trial: &DiagnosisTrial| trial.follows() && trial.squares().1 < most;
    let ran = |fault: TriedFault| Some((bench.run_while(&fault.changes, &may_explain)?, fault.words));
    let mut trials: Vec<(DiagnosisTrial, String)> =
        of_wiring(bench, &channels).into_iter().filter_map(ran).collect();
    let is_explained = |trial: &DiagnosisTrial| explains(trial, base.as_ref());
    if !trials.iter().any(|(trial, _)| is_explained(trial)) {
        trials.extend(channels.inputs.iter().filter_map(|input| of_drive(bench, input, &channels)));
    }
    trials.retain(|(trial, _)| is_explained(trial));
    let likelihood = |trial: &DiagnosisTrial| trial.log_likelihood(TrialBlocks::All);
    let best = trials.iter().map(|(trial, _)| likelihood(trial)).fold(f64::NEG_INFINITY, f64::max);
    trials.retain(|(trial, _)| likelihood(trial) > best - AS_LIKELY);
    let (trial, _) = trials.first()?;
    let found: Vec<&str> = trials.iter().map(|(_, words)| words.as_str()).collect();
    Some(InputFault {
        filter: bench.filter_name.clone(),
        found: found.join(", or "),
        gain: base.as_ref().map(|base| best - likelihood(base)),
        mean_nis: [base.as_ref().map_or(f64::INFINITY, DiagnosisTrial::mean_nis), trial.mean_nis()],
    })
}

/// By how much the mean NIS is above 1: innovations that are smaller than claimed, as under much process noise, are no sign of a fault.
fn above_1(trial: &DiagnosisTrial) -> f64 {
    (trial.mean_nis() - 1.0).max(0.0)
}

/// Whether a run without a fault explains the recording, beside that with it.
fn explains(trial: &DiagnosisTrial, base: Option<&DiagnosisTrial>) -> bool {
    let likelihood = |trial: &DiagnosisTrial| trial.log_likelihood(TrialBlocks::All);
    let is_likelier = base.is_none_or(|base| {
        likelihood(trial) - likelihood(base) > CERTAIN && above_1(trial) < LEFT * above_1(base)
    });
    trial.follows() && trial.mean_nis() < EXPLAINED_NIS && is_likelier
}

/// One channel inverted, and two signals exchanged.
pub(super) fn of_wiring(bench: &TrialBench, channels: &RecordingChannels) -> Vec<TriedFault> {
    let signals = &channels.signals;
    let inverted = |meaning: &String| inverted(bench, meaning);
    let mut tried: Vec<TriedFault> = signals.iter().chain(&channels.inputs).map(inverted).collect();
    for (place, one) in signals.iter().enumerate() {
        for other in signals.iter().take(place) {
            let words = format!("`{}` and `{}` are exchanged", bench.column(other), bench.column(one));
            let changes = vec![TrialChange::Exchanged([one.clone(), other.clone()])];
            tried.push(TriedFault { words, changes });
        }
    }
    tried
}

/// A channel with the other sign.
fn inverted(bench: &TrialBench, meaning: &str) -> TriedFault {
    let how = ChannelAlteration::Scaled(-1.0);
    TriedFault {
        words: format!("`{}` is inverted", bench.column(meaning)),
        changes: vec![TrialChange::Channel { meaning: meaning.to_owned(), how }],
    }
}

/// A steady drive with the frequency that the signal has, where that is another.
///
/// One of the same frequency and another phase is not tried: a natural frequency or a damping that is wrong looks the same.
fn of_drive(
    bench: &TrialBench,
    input: &str,
    channels: &RecordingChannels,
) -> Option<(DiagnosisTrial, String)> {
    let drive = sine_of(bench, input)?;
    let signal = sine_of(bench, channels.signals.first()?)?;
    let frequency_hz = other_frequency(bench, &drive, &signal)?;
    let trial = likeliest_phase(bench, input, &Sine { frequency_hz, ..drive })?;
    let words = format!(
        "the drive `{}` does not belong to the signal: it has {:.2} Hz, and the signal follows from one of {frequency_hz:.2} Hz",
        bench.column(input),
        drive.frequency_hz
    );
    Some((trial, words))
}

/// The steady sine of a channel.
fn sine_of(bench: &TrialBench, meaning: &str) -> Option<Sine> {
    let (times, values, interval_s) = bench.first_segment(meaning)?;
    fit_sine(&times, values, interval_s).filter(|sine| sine.amplitude > 0.0)
}

/// The frequency of a drive by which the signal's largest line would be one of its multiples, or half of it, where that of the drive is another.
fn other_frequency(bench: &TrialBench, drive: &Sine, signal: &Sine) -> Option<f64> {
    let (times, ..) = bench.first_segment(&bench.signal)?;
    let lasts_s = times.last()? - times.first()?;
    let halves = (2.0 * signal.frequency_hz / drive.frequency_hz).round().max(1.0);
    let hz = 2.0 * signal.frequency_hz / halves;
    let ratio = signal.residual_rms / signal.amplitude / (times.len() as f64).sqrt();
    let sd_hz = 6_f64.sqrt() / std::f64::consts::PI / lasts_s * ratio * 2.0 / halves;
    let apart = (hz - drive.frequency_hz).abs();
    (apart > FREQUENCY_SDS * sd_hz && apart > OTHER_FREQUENCY * hz).then_some(hz)
}

/// The run with a steady drive whose phase makes the innovations the likeliest.
fn likeliest_phase(bench: &TrialBench, input: &str, drive: &Sine) -> Option<DiagnosisTrial> {
    let run = |ahead: f64| {
        let sine = Sine { phase_rad: drive.phase_rad + ahead, ..*drive };
        let how = ChannelAlteration::Sine(sine);
        let trial = bench.run_unjudged(&[TrialChange::Channel { meaning: input.to_owned(), how }])?;
        Some((trial.log_likelihood(TrialBlocks::All), ahead, trial))
    };
    let mut interval = TAU / f64::from(PHASES);
    let all = (0..PHASES).filter_map(|k| run(f64::from(k) * interval));
    let mut best = all.max_by(|a, b| a.0.total_cmp(&b.0))?;
    for _ in 0..HALVINGS {
        interval *= 0.5;
        let beside = [best.1 - interval, best.1 + interval].into_iter().filter_map(run);
        if let Some(better) = beside.filter(|other| other.0 > best.0).max_by(|a, b| a.0.total_cmp(&b.0)) {
            best = better;
        }
    }
    Some(best.2)
}
