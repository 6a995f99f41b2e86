//! Messages about the fit: values, what is not determined and why.

use super::{DecayResult, WORTH_SETTING, is_known, unknown};
use crate::fit::DerivedNumber;
use crate::identify::{Correlated, Identification, Identified, Material, Undetermined};
use kalmems_core::Scalar;
use std::f64::consts::TAU;

/// The unknowns that describe the device, with names and units.
const DEVICE: [(usize, &str, &str); 5] = [
    (unknown::DAMPING_RATIO, "damping ratio zeta", ""),
    (unknown::THRESHOLD, "threshold angle theta_th", "rad"),
    (unknown::GAIN, "comb gain N_g", "V s/rad"),
    (unknown::STEEPNESS, "comb steepness N_theta", "1/rad"),
    (unknown::OFFSET, "offset of the signal", "V"),
];

pub fn of(identification: &mut Identification, material: &Material, found: &DecayResult) {
    let (place, fit) = (&material.name, &found.decay.fit);
    let mut say = |name: &str, value: DerivedNumber, unit: &'static str| {
        identification.parameters.push(Identified::gaussian(name, value, unit, place));
    };
    say("natural frequency f_n", fit.derived(|p| p[unknown::NATURAL_RATE] * (1.0 / TAU)), "Hz");
    for (index, name, unit) in DEVICE {
        say(name, fit.parameter(index), unit);
    }
    let slope = fit.derived(|p| p[unknown::GAIN] * p[unknown::STEEPNESS] * 0.25);
    say("comb slope N_g N_theta/4", slope, "V s/rad^2");
    say("delay of the reference", found.delay, "s");
    say("offset of the reference", fit.parameter(unknown::ANGLE_OFFSET), "rad");
    let amplitude = fit.derived(|p| (p[unknown::ANGLE].sq() + p[unknown::SINE].sq()).sqrt());
    say("amplitude at the start", amplitude, "rad");
    let noise = |channel: usize, scale: f64| {
        let value = found.decay.deviations[channel] * scale;
        let count = found.decay.whiteness[channel].samples.max(1) as f64;
        DerivedNumber { value, deviation: value / (2.0 * count).sqrt() }
    };
    say("noise of the signal, sd", noise(0, 1.0), "V");
    match found.per_volt {
        Some(per_volt) => say("noise of the reference, sd", noise(1, 1.0 / per_volt), "V"),
        None => say("noise of the reference, sd", noise(1, 1.0), "rad"),
    }
    for (count, channel) in found.decay.left_out.into_iter().zip(["signal", "reference"]) {
        if count > 0 {
            identification.warnings.push(format!(
                "{place}, {channel}: {count} samples are outliers, more than 5.33 standard deviations off the motion that fits the others, and were \
                 left out"
            ));
        }
    }
    let counted =
        ["are those of white noise", "include a memory of a few samples, as interpolation leaves it"];
    let channels = ["signal", "reference"].into_iter().zip(counted);
    for (whiteness, (channel, counted)) in found.decay.whiteness.iter().zip(channels) {
        if whiteness.samples > 0 && !whiteness.is_white() {
            identification.warnings.push(format!(
                "{place}, {channel}: the residuals are not white (Durbin-Watson {:.2}, Ljung-Box p = {:.1e}): the \
                 model leaves something, or the noise has a memory; the standard errors {counted}",
                whiteness.durbin_watson, whiteness.probability
            ));
        }
    }
    undetermined(identification, place, found);
    worst_pair(identification, place, found);
    curve(identification, material, found);
}

fn undetermined(identification: &mut Identification, place: &str, found: &DecayResult) {
    let mut add = |what: &str, why: String| {
        identification.undetermined.push(Undetermined { what: what.to_owned(), why });
    };
    add(
        "scale of the angle",
        "it is that of the reference: a detector whose distance or gain is off by 1 % makes all angles off by as much"
            .to_owned(),
    );
    add(
        "R_s V_bias and the capacitance of the comb apart",
        "the signal knows their product; C(theta) takes R_s V_bias from the file, and its constant part has no current"
            .to_owned(),
    );
    let half_ms = 0.5e3 * TAU / found.decay.fit.parameters[unknown::NATURAL_RATE];
    add(
        "delay of the reference beyond a quarter of a cycle",
        format!(
            "a reference that is later or earlier by half a cycle, {half_ms:.3} ms, and a threshold on the other side of the \
             middle explain the recording as well"
        ),
    );
    for index in [unknown::NATURAL_RATE, unknown::DAMPING_RATIO, unknown::GAIN, unknown::STEEPNESS] {
        let parameter = found.decay.fit.parameter(index);
        if !is_known(&found.decay, index) {
            let name = DEVICE
                .iter()
                .find(|(i, ..)| *i == index)
                .map_or("natural frequency f_n", |(_, name, _)| name);
            add(
                name,
                format!(
                    "its standard error is {:.0} % of it, or it stands at a bound; above {:.0} % the experiment keeps \
                     the value that it had",
                    100.0 * parameter.deviation / parameter.value.abs(),
                    100.0 * WORTH_SETTING
                ),
            );
        }
    }
    for direction in &found.decay.fit.undetermined {
        let parts: Vec<String> = DEVICE
            .iter()
            .filter(|(index, ..)| direction.parts[*index].abs() > 0.1)
            .map(|(index, name, _)| format!("{:+.2} {name}", direction.parts[*index]))
            .collect();
        add(&parts.join(", "), format!("{place} says nothing of this combination"));
    }
}

fn worst_pair(identification: &mut Identification, place: &str, found: &DecayResult) {
    let c = &found.decay.fit.covariance;
    let pairs =
        DEVICE.iter().enumerate().flat_map(|(k, one)| DEVICE[..k].iter().map(move |other| (one, other)));
    let correlation = |i: usize, j: usize| c.get(i.max(j), i.min(j)) / (c.get(i, i) * c.get(j, j)).sqrt();
    let worst = pairs
        .map(|((i, one, _), (j, other, _))| ((*other, *one), correlation(*i, *j)))
        .filter(|(_, correlation)| correlation.is_finite())
        .max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()));
    if let Some(((one, other), correlation)) = worst {
        let names = [one.to_owned(), other.to_owned()];
        identification.worst_pairs.push(Correlated { names, correlation, recording: place.to_owned() });
    }
}

/// How the curve without a formula compares with the formula.
fn curve(identification: &mut Identification, material: &Material, found: &DecayResult) {
    let p = &found.decay.fit.parameters;
    let comb = found.decay.comb();
    let squares = found
        .curve
        .iter()
        .map(|point| ((point.sensitivity[0] - comb.sensitivity(point.angle)) / point.sensitivity[1]).powi(2));
    let normalised = (squares.sum::<f64>() / found.curve.len().max(1) as f64).sqrt();
    identification.notes.push(format!(
        "{}: h(theta) without a formula differs from the fitted one by {normalised:.1} of its standard errors (root mean \
         square); far above 1 the comb has another shape",
        material.name
    ));
    if p[unknown::GAIN] < 0.0 {
        identification.notes.push(format!(
            "{}: the gain is negative: the stage does not invert, and crossings are falling edges",
            material.name
        ));
    }
    identification
        .notes
        .extend(material.diagnosis.iter().map(|finding| format!("{}: {finding}", material.name)));
}
