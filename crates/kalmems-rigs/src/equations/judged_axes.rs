//! How fast a device moves, and what its motion is judged by.

use super::EquationColumns;
use super::axes::{AxisSines, DrivenAxis, InputRows};
use super::course::{EquationSegment, SegmentChannel, peak_after};
use super::own_device::OwnDevice;
use super::settings::EquationSettings;
use super::sine::SCORED_CYCLES;
use crate::estimate::driven::SegmentDrive;
use crate::estimate::{AngleAxis, EstimateError, MotionRate, Past, SignalSegment};
use crate::signal::Sine;

/// How fast the device moves that a steady drive moves, or none; as fast as a hundred samples where it does not oscillate. Under a drive the table
/// may say that a cycle of it takes several of the drive.
pub fn motion(own: &OwnDevice, drive: Option<&Sine>, interval_s: f64) -> MotionRate {
    let free_hz = || own.natural_hz().unwrap_or_else(|| interval_s.recip() / 100.0);
    MotionRate {
        frequency_hz: drive.map_or_else(free_hz, |sine| sine.frequency_hz / own.drive_cycles),
        is_driven: drive.is_some(),
    }
}

/// How fast it moves as the first rows of its inputs show it, and the name of what its motion is judged by.
pub(super) fn judged_motion(
    (settings, columns, sines): (&EquationSettings, &EquationColumns, Option<&AxisSines>),
    (segment, channels, inputs): (&SignalSegment, &[SegmentChannel], &[SegmentDrive<'_>]),
    past: &mut Past,
) -> Result<(MotionRate, &'static str), EstimateError> {
    let own = &settings.own;
    if let Some(sine) = &settings.sine {
        return Ok((sine.motion(settings, columns, (segment, channels), past)?, sine.name(own)));
    }
    if let Some(natural_hz) = own.natural_hz().filter(|_| own.has_angle()) {
        segment.require_after_settling(SCORED_CYCLES / natural_hz)?;
    }
    let drive = inputs.iter().find_map(|input| input.first_sine().copied()).filter(|_| own.axes.is_empty());
    let driven = sines.map(|sines| sines.slowest(own));
    let motion = driven.unwrap_or_else(|| motion(own, drive.as_ref(), segment.interval_s));
    Ok((motion, own.states()[own.judged()].0))
}

/// What a motion is judged by, and the time in s behind which a turning point tells its sign.
pub(super) struct JudgedAxis {
    pub(super) of: AngleAxis,
    pub(super) peak_s: f64,
}

/// The axes of the motion. A filter knows the first rows of a drive; its motion is judged by what the drive is throughout.
pub(super) fn judged_axes(
    settings: &EquationSettings,
    (judged, first): (&'static str, MotionRate),
    (data, start_s): (&EquationSegment<'_>, f64),
) -> Vec<JudgedAxis> {
    let own = &settings.own;
    if own.axes.is_empty() {
        let drive = data.inputs.iter().find_map(|input| input.sine().copied());
        let motion = match &settings.sine {
            None => motion(own, drive.as_ref(), data.samples.interval_s),
            Some(_) => first,
        };
        let of = AngleAxis { angle: judged, motion, drive };
        return vec![JudgedAxis { of, peak_s: peak_after(&data.inputs, start_s) }];
    }
    let names = own.states();
    let rows = InputRows { inputs: &data.inputs, interval_s: data.samples.interval_s };
    let sines = data.sines.map(|first| (first, first.throughout(own, rows)));
    let axis = |(place, axis): (usize, &DrivenAxis)| {
        let of = sines.as_ref().and_then(|(first, all)| {
            Some((first.sines.get(place)?, all.sines.get(place)?, all.motions(own).get(place).copied()?))
        });
        let free = MotionRate { frequency_hz: axis.natural_hz, is_driven: false };
        JudgedAxis {
            of: AngleAxis {
                angle: names.get(axis.states[0]).map_or("", |(name, ..)| name),
                motion: of.map_or(free, |(.., motion)| motion),
                drive: of.map(|(_, all, _)| *all),
            },
            peak_s: of.map_or(start_s, |(first, ..)| first.peak_after(start_s)),
        }
    };
    own.axes.iter().enumerate().map(axis).collect()
}
