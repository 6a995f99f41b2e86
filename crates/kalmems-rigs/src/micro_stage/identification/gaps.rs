//! Gaps and gains from records at several drive amplitudes.

use super::crests::{ByCrests, Crests, by_crests, crests};
use super::fit_error;
use super::in_situ::InSituKnowledge;
use super::unfitted::{RecordErrors, with_unfitted_errors};
use super::waveform::{
    ELECTRODES, ElectrodeUnknowns, UNKNOWNS, WaveRecord, Waveforms, indeterminate, motion_by, unknown,
};
use crate::config::{ConfigFault, Experiment, FeedthroughBy, Key, TrustedNumber};
use crate::equations::{BiasOffRecord, without_drive};
use crate::fit::{DerivedNumber, Fit, FitError};
use crate::identify::IdentifyError;
use crate::micro_stage::hardware::StageHardware;
use crate::micro_stage::records::{StageRecord, StageRecords, require_one_frequency};
use crate::signal::{Sine, fit_sine_at};
use kalmems_core::Portable;
use kalmems_models::capacitance::TiltingPlate;
use std::f64::consts::TAU;

/// What the records of several drive amplitudes say.
#[derive(Clone, Debug)]
pub struct GapFit {
    /// The records that were used.
    pub records: Vec<WaveRecord>,
    /// Their labels.
    pub labels: Vec<String>,
    /// The angular rate that the vibrometer shows in each, in rad/s; empty without one.
    pub rates: Vec<Sine>,
    /// The fit over all waveforms; `None` where each record was fitted for itself.
    pub fit: Option<Fit<UNKNOWNS>>,
    /// What was found of each electrode, by its place in the hardware.
    pub electrodes: Vec<(usize, ElectrodeFit)>,
    /// The covariance of the errors of gap and gain of each, in this order.
    pub covariance: Vec<Vec<f64>>,
    /// How late the vibrometer is in s; `None` without one.
    pub delay: Option<DerivedNumber>,
    /// Whether gap or gain was taken from the device table, and which.
    pub trusted: Option<TrustedNumber>,
    /// Whether feedthrough was told by the harmonics alone.
    pub by_harmonics: bool,
    /// The variance of the drive in V² that explains how far the motion is from what the stage's model makes of the
    /// drive, as the dissertation has it.
    pub drive_variance: Option<f64>,
    /// b_c in rad/s²/V at each record's amplitude, by the stage's model and the motion.
    pub drive_gains: Vec<[f64; 2]>,
}

impl GapFit {
    /// The signals of a record without what the drive alone makes of them, where the harmonics told it.
    pub fn signals_without_drive(&self, record: &WaveRecord, electrodes: &[usize]) -> Vec<Vec<f64>> {
        let one = |(signal, electrode): (&Vec<f64>, &usize)| {
            let known =
                self.electrodes.iter().find(|(e, _)| e == electrode).and_then(|(_, by)| by.feedthrough);
            match known.filter(|_| self.by_harmonics) {
                Some(known) => without_drive(&record.time_s, &record.drive, signal, known),
                None => signal.clone(),
            }
        };
        record.signals.iter().zip(electrodes).map(one).collect()
    }
}

/// What was found of one electrode.
#[derive(Clone, Copy, Debug)]
pub struct ElectrodeFit {
    /// D_n in m, less what a static tilt makes of it.
    pub gap: DerivedNumber,
    /// η in V·Ω.
    pub gain: DerivedNumber,
    /// The correlation of their errors; not a number where one of them was trusted.
    pub correlation: f64,
    /// The same by crest, trough and height; `None` without a vibrometer.
    pub crests: Option<ByCrests>,
    /// g in V/V and g′ in s of what the drive alone makes of the signal.
    pub feedthrough: Option<[f64; 2]>,
}

/// Drive amplitudes that differ by less than this part are one.
const SAME_AMPLITUDE: f64 = 0.01;

/// Identifies gaps, gains and the vibrometer's delay.
pub fn identify(
    experiment: &Experiment,
    hardware: &StageHardware,
    on: &StageRecords,
    off: Option<&StageRecords>,
) -> Result<GapFit, IdentifyError> {
    let settings = experiment.identify.as_ref();
    let by_harmonics = settings.and_then(|s| s.feedthrough) == Some(FeedthroughBy::Harmonics);
    let trusted = settings.and_then(|s| s.trusted);
    let training = training(experiment, on)?;
    require_one_frequency(training.iter().map(|record| (record.place.as_str(), &record.drive)))?;
    require_amplitudes(on, &training)?;
    let off = match (off, by_harmonics) {
        (Some(off), false) => Some(off),
        (_, true) => None,
        (None, false) => {
            let why = "no recording has the role `bias_off`: what of the signals is the drive's and not the motion's is not \
                       known. Record the same drives with the sensing bias off and add them with that role and the same \
                       labels; or write `[identify]` with `feedthrough = \"harmonics\"`, which is less exact"
                .to_owned();
            return Err(experiment.error("recording", ConfigFault::Value { why }).into());
        }
    };
    let has_vibrometer = training.iter().all(|record| record.rate.is_some());
    let mut records = Vec::new();
    let mut offs = Vec::new();
    for record in &training {
        let mut signals = record.signals.clone();
        if let Some(off) = off {
            let (without, order) = off_of(off, &record.label, &record.place)?;
            require_one_frequency([
                (record.place.as_str(), &record.drive),
                (without.label.as_str(), &without.drive),
            ])?;
            for (signal, electrode) in signals.iter_mut().zip(&on.electrodes) {
                let at = order.iter().position(|e| e == electrode).ok_or_else(|| {
                    let meaning = hardware.channels[*electrode].meaning();
                    let why = format!("it has no channel `{meaning}`; name its column there too");
                    IdentifyError::Unfit { recording: off.name.clone(), why }
                })?;
                *signal = without.cancel(at, &record.time_s, &record.drive, signal);
            }
            offs.push((without, order));
        }
        let angle = motion(hardware, on, record, &signals)?;
        records.push(WaveRecord { time_s: record.time_s.clone(), drive: record.drive, angle, signals });
    }
    if has_vibrometer {
        require_layout(hardware, on, &training, &records)?;
    }
    let errors = training
        .iter()
        .enumerate()
        .map(|(place, record)| RecordErrors { off: offs.get(place), rate: record.rate });
    let errors: Vec<RecordErrors> = errors.collect();
    let task = GapFitTask { hardware, on, records: &records, errors: &errors, by_harmonics };
    let mut found = match (has_vibrometer, trusted) {
        (true, _) => task.with_vibrometer()?,
        (false, Some(trusted)) => task.trusting(experiment, trusted)?,
        (false, None) => return Err(task.refuse()),
    };
    for (electrode, by) in &mut found.electrodes {
        let known: Vec<[f64; 2]> = offs
            .iter()
            .filter_map(|(off, order)| off.gain_and_slope(order.iter().position(|e| e == electrode)?))
            .collect();
        if !known.is_empty() {
            let mean = |i: usize| known.iter().map(|k| k[i]).sum::<f64>() / known.len() as f64;
            by.feedthrough = Some([mean(0), mean(1)]);
        }
    }
    found.labels = training.iter().map(|record| record.label.clone()).collect();
    if has_vibrometer {
        found.rates = training.iter().filter_map(|record| record.rate).collect();
        task.judge_drive(&mut found);
    }
    found.records = records;
    Ok(found)
}

/// The records that serve the identification.
fn training<'a>(
    experiment: &Experiment,
    on: &'a StageRecords,
) -> Result<Vec<&'a StageRecord>, IdentifyError> {
    let wanted = experiment.identify.as_ref().map_or(&[][..], |identify| &identify.training);
    for (i, name) in wanted.iter().enumerate() {
        if !on.all.iter().any(|record| record.label == *name) {
            let known = on.all.iter().map(|record| record.label.as_str());
            let key = Key::from("identify").child("training").index(i);
            return Err(experiment.error(key, ConfigFault::unknown_word(name, known)).into());
        }
    }
    let is_wanted = |record: &&StageRecord| wanted.is_empty() || wanted.contains(&record.label);
    Ok(on.all.iter().filter(is_wanted).collect())
}

/// Refuses records that all have one drive amplitude.
fn require_amplitudes(on: &StageRecords, training: &[&StageRecord]) -> Result<(), IdentifyError> {
    let mut amplitudes: Vec<f64> = training.iter().map(|record| record.drive.amplitude).collect();
    amplitudes.sort_by(f64::total_cmp);
    amplitudes.dedup_by(|a, b| *a < *b * (1.0 + SAME_AMPLITUDE));
    if amplitudes.len() >= 2 {
        return Ok(());
    }
    let found = amplitudes.first().copied().unwrap_or(0.0);
    let why = format!(
        "its records have one drive amplitude, {found:.3} V; gap and gain of an electrode come apart by how the waveform \
         changes with the motion, and one amplitude leaves them correlated to 0.999 and unchecked: record at least two, \
         better four, between a half and the whole of the largest that the stage allows"
    );
    Err(IdentifyError::Unfit { recording: on.name.clone(), why })
}

/// The angle of a record, as late as the vibrometer shows it less the stated delay; without one, as the first signal says
/// it with the gap and gain of the device table.
fn motion(
    hardware: &StageHardware,
    on: &StageRecords,
    record: &StageRecord,
    signals: &[Vec<f64>],
) -> Result<Sine, IdentifyError> {
    if let Some(rate) = record.rate {
        let turn = TAU * rate.frequency_hz;
        return Ok(Sine {
            offset: 0.0,
            amplitude: rate.amplitude / turn,
            phase_rad: rate.phase_rad - TAU / 4.0,
            residual_rms: rate.residual_rms / turn,
            ..rate
        });
    }
    let first =
        on.electrodes.first().and_then(|electrode| hardware.channels.get(*electrode)).zip(signals.first());
    let sine = first.and_then(|(channel, signal)| {
        let sine = fit_sine_at(&record.time_s, signal, record.drive.frequency_hz)?;
        Some(motion_by(&channel.current.plate, channel.current.gain, &sine))
    });
    sine.ok_or_else(|| IdentifyError::Unfit {
        recording: record.place.clone(),
        why: "its signals have too few samples to see a motion in; expected at least three cycles".to_owned(),
    })
}

/// Refuses signals that have the opposite sign of what the layout makes of the motion.
fn require_layout(
    hardware: &StageHardware,
    on: &StageRecords,
    training: &[&StageRecord],
    records: &[WaveRecord],
) -> Result<(), IdentifyError> {
    let mut against: Vec<(usize, f64)> = Vec::new();
    for (place, electrode) in on.electrodes.iter().enumerate() {
        let channel = &hardware.channels[*electrode];
        let per_rate = channel.current.gain * channel.current.plate.slope(0.0);
        let mut ratio = 0.0;
        for (record, described) in records.iter().zip(training) {
            let signal = fit_sine_at(&record.time_s, &record.signals[place], record.drive.frequency_hz);
            let (Some(signal), Some(rate)) = (signal, described.rate) else { continue };
            let turned = (signal.phase_rad - rate.phase_rad).portable_cos();
            ratio += signal.amplitude / rate.amplitude * turned / per_rate / records.len() as f64;
        }
        if ratio < 0.0 {
            against.push((*electrode, ratio));
        }
    }
    let Some((first, _)) = against.first() else { return Ok(()) };
    let name = |electrode: usize| hardware.channels[electrode].meaning();
    let side = |electrode: usize| hardware.channels[electrode].current.plate.slope(0.0) > 0.0;
    let partner = against.iter().map(|(electrode, _)| *electrode).find(|e| side(*e) != side(*first));
    let names: Vec<String> = against.iter().map(|(e, _)| format!("`{}`", name(*e))).collect();
    let remedy = match partner {
        Some(partner) => format!("exchange the columns of `{}` and `{}`", name(*first), name(partner)),
        None => "correct the electrode's edges, or the sign of its gain".to_owned(),
    };
    let why = format!(
        "{} move{} against the layout: with the gain's sign, dC/dθ comes out with the opposite sign of the side of the axis \
         that the electrode is on. Are channels swapped? {remedy}",
        names.join(" and "),
        if names.len() == 1 { "s" } else { "" }
    );
    Err(IdentifyError::Unfit { recording: on.name.clone(), why })
}

/// The record without bias that belongs to a record with bias, and the electrodes that its signals are of.
fn off_of<'a>(
    off: &'a StageRecords,
    label: &str,
    place: &str,
) -> Result<(BiasOffRecord, &'a [usize]), IdentifyError> {
    let record = off.all.iter().find(|record| record.label == label).ok_or_else(|| {
        let known: Vec<String> = off.all.iter().map(|record| format!("`{}`", record.label)).collect();
        let why = format!(
            "its counterpart with the bias off is missing: `{}` has {}; record it there under the label `{label}`",
            off.name,
            known.join(", ")
        );
        IdentifyError::Unfit { recording: place.to_owned(), why }
    })?;
    let signals: Vec<&[f64]> = record.signals.iter().map(Vec::as_slice).collect();
    let found = BiasOffRecord::of(&record.place, &record.time_s, record.drive, &signals);
    let found = found.ok_or_else(|| IdentifyError::Unfit {
        recording: record.place.clone(),
        why: "a signal has too few samples for a sine of the drive's frequency".to_owned(),
    })?;
    Ok((found, &off.electrodes))
}

/// What is fitted.
struct GapFitTask<'a> {
    hardware: &'a StageHardware,
    on: &'a StageRecords,
    records: &'a [WaveRecord],
    /// Of each record.
    errors: &'a [RecordErrors<'a>],
    by_harmonics: bool,
}

/// The standard deviation that a channel is given whose noise is not known: the fits then find a common one.
const UNKNOWN_NOISE: f64 = 1e-6;

impl GapFitTask<'_> {
    fn plates(&self) -> Vec<TiltingPlate<f64>> {
        self.on.electrodes.iter().map(|e| self.hardware.channels[*e].current.plate).collect()
    }

    fn gains(&self) -> Vec<f64> {
        self.on.electrodes.iter().map(|e| self.hardware.channels[*e].current.gain).collect()
    }

    fn noise(&self) -> Vec<f64> {
        let of = |e: &usize| self.hardware.channels[*e].noise_variance.map_or(UNKNOWN_NOISE, f64::sqrt);
        self.on.electrodes.iter().map(of).collect()
    }

    fn fit_error(&self, source: FitError) -> IdentifyError {
        fit_error(&self.on.name, source)
    }

    fn with_vibrometer(&self) -> Result<GapFit, IdentifyError> {
        let (plates, gains, noise) = (self.plates(), self.gains(), self.noise());
        let waveforms = Waveforms {
            plates: &plates,
            gains: &gains,
            noise: &noise,
            records: self.records,
            // The motions are as late as the vibrometer shows them.
            delay_s: self.on.delay_s,
            scale_known: true,
            unknowns: ElectrodeUnknowns::Both,
            feedthrough: self.by_harmonics,
        };
        let mut fit = waveforms.fit().map_err(|why| self.fit_error(why))?;
        with_unfitted_errors(&mut fit, &waveforms, &self.on.electrodes, self.errors);
        let scale = fit.residual_deviation();
        let mut electrodes = Vec::new();
        for (place, electrode) in self.on.electrodes.iter().enumerate().take(ELECTRODES) {
            let features = self.records.iter().map(|record| {
                // Feedthrough that is still in the signal would move its crests.
                let p = unknown::feedthrough(place).map(|i| fit.parameters[i]);
                let signal = without_drive(&record.time_s, &record.drive, &record.signals[place], p);
                let sd = noise[place] * scale;
                Some((record.angle, crests(&record.time_s, &signal, record.drive.frequency_hz, sd)?))
            });
            let features: Option<Vec<(Sine, Crests)>> = features.collect();
            let by = features
                .map(|features| by_crests(&plates[place], gains[place].signum(), &features))
                .transpose()
                .map_err(|why| self.fit_error(why))?;
            electrodes.push((
                *electrode,
                ElectrodeFit {
                    gap: fit.parameter(unknown::gap(place)),
                    gain: fit.parameter(unknown::gain(place)),
                    correlation: super::correlation(&fit, place),
                    crests: by,
                    feedthrough: self
                        .by_harmonics
                        .then(|| unknown::feedthrough(place).map(|i| fit.parameters[i])),
                },
            ));
        }
        let delay = Some(fit.parameter(unknown::DELAY));
        let places: Vec<usize> =
            (0..electrodes.len()).flat_map(|place| [unknown::gap(place), unknown::gain(place)]).collect();
        let row = |i: &usize| places.iter().map(|j| fit.covariance.get(*i, *j)).collect();
        let covariance = places.iter().map(row).collect();
        Ok(GapFit { fit: Some(fit), electrodes, covariance, delay, ..self.nothing() })
    }

    fn trusting(&self, experiment: &Experiment, trusted: TrustedNumber) -> Result<GapFit, IdentifyError> {
        let noise = self.noise();
        let known =
            InSituKnowledge { noise: &noise, records: self.records, trusted, feedthrough: self.by_harmonics };
        let names: Vec<&str> = self
            .on
            .electrodes
            .iter()
            .map(|electrode| self.hardware.channels[*electrode].name.as_str())
            .collect();
        let directions = experiment.directions()?;
        let (found, covariance) = known
            .with_stated_errors((&self.plates(), &self.gains()), (&names, &directions))
            .map_err(|why| self.fit_error(why))?;
        let of = |place: usize, number: DerivedNumber| DerivedNumber {
            deviation: covariance[place][place].sqrt(),
            ..number
        };
        let fitted = found.electrodes.iter().enumerate().map(|(place, [gap, gain])| ElectrodeFit {
            gap: of(2 * place, *gap),
            gain: of(2 * place + 1, *gain),
            correlation: f64::NAN,
            crests: None,
            feedthrough: None,
        });
        let electrodes = self.on.electrodes.iter().copied().zip(fitted).collect();
        Ok(GapFit { electrodes, covariance, trusted: Some(trusted), ..self.nothing() })
    }

    /// Why the signals alone do not say gap and gain.
    fn refuse(&self) -> IdentifyError {
        let (plates, gains, noise) = (self.plates(), self.gains(), self.noise());
        let largest =
            self.records.iter().max_by(|a, b| a.drive.amplitude.total_cmp(&b.drive.amplitude)).cloned();
        let records: Vec<WaveRecord> = largest.into_iter().collect();
        let waveforms = alone(&plates, &gains, &noise, &records, self.by_harmonics);
        match indeterminate(&waveforms) {
            Ok(found) => {
                let why = format!(
                    "it has no vibrometer, and the harmonics of the signals alone do not determine the absolute size of the \
                     motion: they say Θ/D_n and η/D_n. The direction in which ln Θ, ln D_n and \
                     ln η grow together has the singular value {:.1e} of the largest, which leaves a standard error of \
                     {:.0} % on all of them. Name the vibrometer's column under \
                     `[recording.reference]`; or trust one of the two numbers of each electrode and write `[identify]` with \
                     `trusted = \"gain\"` or `trusted = \"gap\"`",
                    found.singular_value,
                    100.0 * found.deviation
                );
                IdentifyError::Unfit { recording: self.on.name.clone(), why }
            }
            Err(why) => self.fit_error(why),
        }
    }

    /// How far the stage's model is from the motion that the vibrometer shows.
    fn judge_drive(&self, found: &mut GapFit) {
        let stage = &self.hardware.stage;
        let mut squares = 0.0;
        for (record, rate) in self.records.iter().zip(&found.rates) {
            let turn = TAU * rate.frequency_hz;
            let (re, im) = stage.response(turn);
            let size = turn * re.portable_hypot(im);
            let needed = rate.amplitude / size;
            let late = turn * found.delay.map_or(0.0, |delay| delay.value);
            let phase = rate.phase_rad + late - (im.portable_atan2(re) + TAU / 4.0) - record.drive.phase_rad;
            let (sine, cosine) = phase.portable_sin_cos();
            let apart = (needed * cosine - record.drive.amplitude).portable_hypot(needed * sine);
            squares += 0.5 * apart * apart / self.records.len() as f64;
            found
                .drive_gains
                .push([record.drive.amplitude, stage.drive_gain * needed / record.drive.amplitude]);
        }
        found.drive_variance = Some(squares);
    }

    fn nothing(&self) -> GapFit {
        GapFit {
            records: Vec::new(),
            labels: Vec::new(),
            rates: Vec::new(),
            fit: None,
            electrodes: Vec::new(),
            covariance: Vec::new(),
            delay: None,
            trusted: None,
            by_harmonics: self.by_harmonics,
            drive_variance: None,
            drive_gains: Vec::new(),
        }
    }
}

/// What one record without a vibrometer is fitted with.
pub(super) fn alone<'a>(
    plates: &'a [TiltingPlate<f64>],
    gains: &'a [f64],
    noise: &'a [f64],
    records: &'a [WaveRecord],
    feedthrough: bool,
) -> Waveforms<'a> {
    Waveforms {
        plates,
        gains,
        noise,
        records,
        delay_s: 0.0,
        scale_known: false,
        unknowns: ElectrodeUnknowns::Gaps,
        feedthrough,
    }
}
