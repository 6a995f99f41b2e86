//! Messages about the fits: values, what is not determined and why.

use super::common_noise::CommonNoise;
use super::gaps::GapFit;
use super::rate_line::RateLine;
use super::sweep::SweepFit;
use super::waveform::unknown;
use crate::config::TrustedNumber;
use crate::fit::DerivedNumber;
use crate::identify::{Correlated, Identification, Identified, StillNoise, Undetermined};
use crate::micro_stage::hardware::StageHardware;
use crate::micro_stage::records::StageRecords;
use std::f64::consts::TAU;

fn say(found: &mut Identification, name: &str, value: DerivedNumber, unit: &'static str, recording: &str) {
    found.parameters.push(Identified::gaussian(name, value, unit, recording));
}

fn undetermined(found: &mut Identification, what: &str, why: &str) {
    found.undetermined.push(Undetermined { what: what.to_owned(), why: why.to_owned() });
}

/// A sum of squares that is this many times what the noise makes of it is no longer noise.
const UNEXPLAINED: f64 = 1.2;

pub fn sweep(found: &mut Identification, records: &StageRecords, fitted: &SweepFit) {
    let place = &records.name;
    let mut add = |name: &str, value: DerivedNumber, unit| say(found, name, value, unit, place);
    add("natural frequency f_n", fitted.natural_frequency_hz(), "Hz");
    add("damping ratio zeta", fitted.damping_ratio(), "");
    add("quality factor Q", fitted.response.quality(), "");
    add("drive gain b_c", fitted.drive_gain(), "rad/s^2/V");
    let late = fitted.delay_s();
    add("delay of the vibrometer", DerivedNumber { value: records.delay_s + late.value, ..late }, "s");
    add("f_n by the circle", fitted.circle_frequency_hz(), "Hz");
    add("zeta by the circle", fitted.circle_damping_ratio(), "");
    add("b_c by the circle", fitted.circle_drive_gain(), "rad/s^2/V");
    // The offset does not depend on the frequency: the mean over the steps.
    let offsets: Vec<f64> = records.all.iter().filter_map(|r| r.rate.map(|rate| rate.offset)).collect();
    let count = offsets.len().max(2) as f64;
    let mean = offsets.iter().sum::<f64>() / count;
    let variance = offsets.iter().map(|o| (o - mean).powi(2)).sum::<f64>() / (count - 1.0) / count;
    add("offset of the vibrometer", DerivedNumber { value: mean, deviation: variance.sqrt() }, "rad/s");
    let natural = fitted.natural_frequency_hz().value;
    // As the instruments show it, with all of the vibrometer's delay in it.
    let phase = fitted.phase_at_resonance().value - TAU * natural * records.delay_s;
    // The phase of the rate falls by 1/(ζ·f_n) rad per Hz there.
    let moved = phase * fitted.damping_ratio().value * natural;
    found.notes.push(format!(
        "{place}: at resonance the rate that the vibrometer shows has the phase {phase:+.4} rad, because it is late; the \
         frequency at which that is 0 is {moved:+.2} Hz from f_n and no resonance"
    ));
    let leftover = fitted.response.fit.residual_deviation();
    if leftover > UNEXPLAINED {
        found.warnings.push(format!(
            "{place}: the response is {leftover:.1} times as far from the fitted one as its noise; the motion was not steady \
             at every step, or another mode is near: the standard errors are scaled by that"
        ));
    }
}

pub fn noise(found: &mut Identification, place: &str, name: &str, still: &StillNoise) {
    let value = DerivedNumber { value: still.variance, deviation: still.variance_deviation };
    say(found, &format!("noise variance R of {name}"), value, "V^2", place);
    if !still.whiteness.is_white() {
        found.warnings.push(format!(
            "{place}, {name}: the noise is not white (Durbin-Watson {:.2}, Ljung-Box p = {:.1e}); a filter takes it for white",
            still.whiteness.durbin_watson, still.whiteness.probability
        ));
    }
}

/// The largest correlation of the noises of two channels.
pub fn common_noise(found: &mut Identification, place: &str, common: &CommonNoise, names: &[String]) {
    if let Some((r, one, other)) = common.largest() {
        let (one, other) = (&names[one], &names[other]);
        found.notes.push(format!(
            "{place}: the largest correlation of two channels' noise is {r:+.3}, of {one} and {other}; the filters take them \
             for independent"
        ));
    }
}

pub fn gaps(found: &mut Identification, hardware: &StageHardware, records: &StageRecords, fitted: &GapFit) {
    let place = &records.name;
    for (electrode, by) in &fitted.electrodes {
        let name = &hardware.channels[*electrode].name;
        if fitted.trusted != Some(TrustedNumber::Gap) {
            say(found, &format!("gap D_n of {name}"), by.gap, "m", place);
        }
        if fitted.trusted != Some(TrustedNumber::Gain) {
            say(found, &format!("gain eta of {name}"), by.gain, "V ohm", place);
        }
        if let Some(crests) = by.crests {
            say(found, &format!("gap of {name} by crest and trough"), crests.gap, "m", place);
            say(found, &format!("gain of {name} by the height"), crests.gain, "V ohm", place);
        }
        if by.correlation.is_finite() {
            let names = [format!("gap of {name}"), format!("gain of {name}")];
            let correlation = by.correlation;
            found.worst_pairs.push(Correlated { names, correlation, recording: place.clone() });
        }
        if let Some([gain, slope]) = by.feedthrough {
            found.notes.push(format!(
                "{place}: {name} shows {gain:.4e} of the drive and {slope:.4e} s of its rate of change"
            ));
        }
    }
    if let Some(delay) = fitted.delay {
        say(found, "delay of the vibrometer", delay, "s", place);
    }
    if let Some(fit) = &fitted.fit {
        let known = hardware.channels.iter().all(|channel| channel.noise_variance.is_some());
        let leftover = fit.residual_deviation();
        if known && leftover > UNEXPLAINED {
            found.warnings.push(format!(
                "{place}: the waveforms are {leftover:.2} times as far from the fitted ones as the channels' noise; the \
                 electrodes' edges, feedthrough that is not in the record without bias, or off-axis motion would do that"
            ));
        }
        let offsets = (0..fitted.electrodes.len()).map(|i| fit.parameter(unknown::offset(i)));
        let largest = offsets.max_by(|a, b| a.value.abs().total_cmp(&b.value.abs()));
        if let Some(offset) = largest {
            found.notes.push(format!(
                "{place}: with the bias on a signal's offset changes by {:.1e} V at most (standard error {:.0e})",
                offset.value, offset.deviation
            ));
        }
    }
    drive(found, hardware, place, fitted);
    match fitted.trusted {
        Some(trusted) => {
            let (known, follows) = match trusted {
                TrustedNumber::Gain => ("gains", "gaps"),
                TrustedNumber::Gap => ("gaps", "gains"),
            };
            let stated = fitted.electrodes.iter().any(|(_, by)| match trusted {
                TrustedNumber::Gain => by.gain.deviation > 0.0,
                TrustedNumber::Gap => by.gap.deviation > 0.0,
            });
            let words = format!(
                "{place}: no vibrometer; the {known} are those of the device table, and an error of theirs is in the {follows} \
                 and in the estimated rate in full"
            );
            if stated {
                found.notes.push(format!(
                    "{words}; what is stated of it is in the standard errors of the {follows}"
                ));
            } else {
                found.warnings.push(format!(
                    "{words}; they are taken as exact: state their uncertainty in the device's table, and it is in the standard errors of \
                     the {follows} and in every estimate"
                ));
            }
        }
        None => undetermined(
            found,
            "scale of the motion",
            "it is that of the vibrometer: gain and target width of the device table go into gaps, gains and rates in full",
        ),
    }
    undetermined(
        found,
        "static tilt of the stage",
        "it makes a gap larger on one side and smaller on the other, by the distance from the axis times the angle; the gaps \
         are those with it, which is what an estimate needs",
    );
    undetermined(
        found,
        "length of the inner stators along the axis",
        "the signal is in proportion to it and to the gain; the gain has it",
    );
}

/// How the stage followed the drive.
fn drive(found: &mut Identification, hardware: &StageHardware, place: &str, fitted: &GapFit) {
    let Some(variance) = fitted.drive_variance else { return };
    let interval_s = fitted.records.first().map_or(0.0, |record| {
        let t = &record.time_s;
        t.last().zip(t.first()).map_or(0.0, |(last, first)| (last - first) / (t.len().max(2) - 1) as f64)
    });
    let density = hardware.stage.drive_gain.powi(2) * variance * interval_s;
    found.notes.push(format!(
        "{place}: the stage's model and the motion differ by what a variance Q of the drive of {variance:.2e} V^2 per sample \
         would do, an angular acceleration of density {density:.2e} rad^2/s^3; it is no white noise but a wrong gain, so \
         that a filter needs more"
    ));
    let (first, last) = (fitted.drive_gains.first(), fitted.drive_gains.last());
    if let (Some([low, least]), Some([high, most])) = (first, last)
        && (most / least - 1.0).abs() > 0.01
    {
        found.notes.push(format!(
            "{place}: b_c is {least:.0} rad/s^2/V at {low:.2} V of drive and {most:.0} at {high:.2} V: the piezoelectric \
             gain depends on the amplitude"
        ));
    }
}

pub fn correction(found: &mut Identification, records: &StageRecords, line: &RateLine) {
    let place = &records.name;
    say(found, &format!("scale factor alpha of {}", line.filter), line.scale, "", place);
    say(found, &format!("bias beta of {}", line.filter), line.bias, "rad/s", place);
}
