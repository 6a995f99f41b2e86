//! The noise of the channels from a recording without drive.

use super::common_noise::CommonNoise;
use super::{messages, quantity};
use crate::config::{ConfigFault, Experiment, Key};
use crate::identify::{Identification, IdentifyError, Material, STRETCH, StillRecord};
use crate::micro_stage::device::MicroStage;
use crate::micro_stage::hardware::StageHardware;
use crate::micro_stage::records::{DRIVE, place};
use crate::progress::Progress;
use crate::recording::{StretchSize, Stretches};
use crate::units::kind;

/// Finds the variance of each channel, and puts it into the device table and the hardware.
pub fn identify(
    experiment: &Experiment,
    hardware: &mut StageHardware,
    device: &mut MicroStage,
    index: usize,
    found: &mut Identification,
    progress: &dyn Progress,
) -> Result<(), IdentifyError> {
    let described = experiment.recording(index)?;
    let key = || Key::from("recording").index(index).child("channels");
    let meanings =
        |name: &str| [format!("bias_on_{name}"), format!("signal_{name}"), format!("bias_off_{name}")];
    let all: Vec<String> = hardware.channels.iter().flat_map(|channel| meanings(&channel.name)).collect();
    if let Some((other, _)) =
        described.channels.iter().find(|(name, _)| *name != DRIVE && !all.iter().any(|known| known == name))
    {
        let fault = ConfigFault::unknown_key(other, all.iter().map(String::as_str));
        return Err(experiment.error(key().child(other), fault).into());
    }
    let columns: Vec<(usize, &str)> = (hardware.channels.iter().enumerate())
        .filter_map(|(i, channel)| {
            let [on, signal, _] = meanings(&channel.name);
            Some((i, described.channels.column(&on).or_else(|| described.channels.column(&signal))?))
        })
        .collect();
    let names: Vec<&str> = columns.iter().map(|(_, column)| *column).collect();
    let around = StretchSize { rows: STRETCH, first: STRETCH, before: 0, after: 0 };
    let path = experiment.resolve(&described.file);
    let mut stretches = Stretches::open(&path, &described.layout(&names), around)?;
    let (mut records, mut common) = (Vec::new(), CommonNoise::new(columns.len()));
    let (mut segments, mut started, mut label) = (0, false, String::new());
    while let Some(stretch) = stretches.next(&mut |done, total| {
        if !started {
            progress.begin("reading", total);
            started = true;
        }
        progress.reached(done)
    })? {
        for segment in stretch.recording.segments() {
            segments += usize::from(stretch.begins);
            label.clone_from(&segment.label);
            let signals = (names.iter())
                .map(|name| Ok(stretch.recording.column_of(name, &kind::VOLTAGE)?.of(segment)))
                .collect::<Result<Vec<&[f64]>, IdentifyError>>()?;
            let interval_s = segment.time.interval_s().unwrap_or(f64::NAN);
            records.resize_with(names.len(), || StillRecord::new(interval_s));
            let time_s = segment.time.to_vec();
            for (record, signal) in records.iter_mut().zip(&signals) {
                record.take(&time_s, signal);
            }
            common.take(&signals);
        }
        stretches.reuse(stretch);
    }
    let (source, diagnosis) = stretches.finish();
    let name = described.name.as_ref().map_or_else(|| source.file.clone(), ToString::to_string);
    if segments != 1 {
        let why = format!("it holds {segments} records; expected one, without drive");
        return Err(IdentifyError::Unfit { recording: name, why });
    }
    let place = place(&name, &label);
    let interval_s = records.first().map_or(f64::NAN, StillRecord::interval_s);
    let mut channels = Vec::new();
    for ((electrode, _), record) in columns.iter().zip(records) {
        let still = record.finish().ok_or_else(|| IdentifyError::Unfit {
            recording: place.clone(),
            why: "fewer than 32 samples of a channel, or none that varies; there is no noise to see"
                .to_owned(),
        })?;
        let channel = &mut hardware.channels[*electrode];
        channel.noise_variance = Some(still.variance);
        messages::noise(found, &name, &channel.name, &still);
        if let Some(table) = device.electrodes.get_mut(&channel.name) {
            table.noise_variance = Some(quantity(experiment, still.variance, "V^2")?);
        }
        channels.push(channel.name.clone());
    }
    messages::common_noise(found, &name, &common, &channels);
    found.materials.push(Material {
        name,
        role: described.role,
        time_s: Vec::new(),
        interval_s,
        signal: Vec::new(),
        angle: Vec::new(),
        sources: vec![source],
        diagnosis,
    });
    Ok(())
}
