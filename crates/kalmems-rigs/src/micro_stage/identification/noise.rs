//! The noise of the channels from a recording without drive.

use super::{quantity, words};
use crate::config::{Experiment, Fault, Key, MicroStage};
use crate::estimate::Progress;
use crate::identify::{Identification, IdentifyError, Material, fit_still};
use crate::micro_stage::hardware::Hardware;
use crate::micro_stage::records::{DRIVE, place, read_file};
use crate::units::kind;

/// Finds the variance of each channel, and puts it into the device table and the hardware.
pub fn identify(
    experiment: &Experiment,
    hardware: &mut Hardware,
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
        let fault = Fault::unknown_key(other, all.iter().map(String::as_str));
        return Err(experiment.error(key().child(other), fault).into());
    }
    let columns: Vec<(usize, &str)> = (hardware.channels.iter().enumerate())
        .filter_map(|(i, channel)| {
            let [on, signal, _] = meanings(&channel.name);
            Some((i, described.channels.column(&on).or_else(|| described.channels.column(&signal))?))
        })
        .collect();
    let names: Vec<&str> = columns.iter().map(|(_, column)| *column).collect();
    let recording = read_file(experiment, described, &described.layout(&names), progress)?;
    let name = described.name.as_ref().map_or_else(|| recording.source().file.clone(), ToString::to_string);
    let [segment] = recording.segments() else {
        let why = format!("it holds {} records; expected one, without drive", recording.segments().len());
        return Err(IdentifyError::Unfit { recording: name, why });
    };
    let place = place(&name, segment);
    let unfit = |why: &str| IdentifyError::Unfit { recording: place.clone(), why: why.to_owned() };
    let interval_s =
        segment.time.interval_s().ok_or_else(|| unfit("it holds one sample; expected hundreds"))?;
    let time_s = segment.time.to_vec();
    let mut signals = Vec::new();
    for (electrode, column) in columns {
        let signal = recording.column_of(column, &kind::VOLTAGE)?.of(segment);
        let still = fit_still(&time_s, signal, interval_s).ok_or_else(|| {
            unfit("fewer than 32 samples of a channel, or none that varies; there is no noise to see")
        })?;
        let channel = &mut hardware.channels[electrode];
        channel.noise_variance = Some(still.variance);
        words::noise(found, &name, &channel.name, &still);
        if let Some(table) = device.electrodes.get_mut(&channel.name) {
            table.noise_variance = Some(quantity(experiment, still.variance, "V^2")?);
        }
        signals.push((channel.name.clone(), still.mean, signal));
    }
    words::common_noise(found, &name, &signals);
    found.materials.push(Material {
        name,
        role: described.role,
        time_s: Vec::new(),
        interval_s,
        signal: Vec::new(),
        angle: Vec::new(),
        sources: vec![recording.source().clone()],
        diagnosis: recording.diagnosis().to_vec(),
    });
    Ok(())
}
