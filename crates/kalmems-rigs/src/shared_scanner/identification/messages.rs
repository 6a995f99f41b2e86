//! Messages about the fits: values, what is not determined and why.

use super::identified_table::is_known;
use super::unknown::{STIFFNESS, WIDTH};
use super::{
    RingDown, RingDownFit, SteadyState, SteadyStateFit, gain_ambiguity, integrated_capacitance, unknown,
};
use crate::fit::DerivedNumber;
use crate::identify::{
    Correlated, Identification, Identified, Material, StillNoise, Undetermined, Whiteness,
};
use kalmems_core::Portable;
use kalmems_core::Scalar;
use std::f64::consts::TAU;

/// Names and units of a ring-down's unknowns.
const NAMES: [(&str, &str); unknown::COUNT] = [
    ("stiffness k", "N m/rad"),
    ("damping b", "N m s/rad"),
    ("nominal capacitance C0", "F"),
    ("angular width theta0", "rad"),
    ("angle at the start", "rad"),
    ("rate at the start", "rad/s"),
    ("offset of V_o1", "V"),
    ("offset of the reference", "rad"),
];

const CB: &str = "bias capacitance C_b";

fn undetermined(found: &mut Identification, what: &str, why: String) {
    found.undetermined.push(Undetermined { what: what.to_owned(), why });
}

/// Fits claim errors of white noise.
fn warn_of_memory(found: &mut Identification, place: &str, whiteness: &Whiteness) {
    if whiteness.samples > 0 && !whiteness.is_white() {
        found.warnings.push(format!(
            "{place}: the residuals are not white (Durbin-Watson {:.2}, Ljung-Box p = {:.1e}): the model leaves \
             something, or the noise has a memory; the standard errors are those of white noise",
            whiteness.durbin_watson, whiteness.probability
        ));
    }
}

/// Three digits of a number that may be very large or small.
fn short(value: f64) -> String {
    if value != 0.0 && !(1e-3..1e4).contains(&value.abs()) {
        format!("{value:.2e}")
    } else {
        format!("{value:.3}")
    }
}

pub fn ring_down(found: &mut Identification, material: &Material, record: &RingDown, fitted: &RingDownFit) {
    let place = &material.name;
    let fit = &fitted.fit;
    for (index, (name, unit)) in NAMES.into_iter().enumerate() {
        if index == unknown::ANGLE_OFFSET && !fitted.with_reference {
            continue;
        }
        found.parameters.push(Identified::gaussian(name, fit.parameter(index), unit, place));
    }
    let inertia = record.scanner.resonator.inertia;
    let derived: [(&str, DerivedNumber, &str); 3] = [
        ("resonance sqrt(k/J)/2pi", fit.derived(|p| (p[0] * inertia.recip()).sqrt() * (1.0 / TAU)), "Hz"),
        ("quality sqrt(k J)/b", fit.derived(|p| (p[0] * inertia).sqrt() / p[1]), ""),
        (
            "stiffness of the bias C0 V^2/theta0^2",
            fit.derived(|p| p[2] * (record.bias * record.bias) / (p[3] * p[3])),
            "N m/rad",
        ),
    ];
    for (name, value, unit) in derived {
        found.parameters.push(Identified::gaussian(name, value, unit, place));
    }
    for (index, (name, unit)) in
        [("noise of V_o1, sd", "V"), ("noise of the reference, sd", "rad")].into_iter().enumerate()
    {
        let count = fitted.whiteness[index].samples;
        if count > 0 {
            let value = fitted.deviations[index];
            let deviation = value / (2.0 * count as f64).sqrt();
            found.parameters.push(Identified::gaussian(
                name,
                DerivedNumber { value, deviation },
                unit,
                place,
            ));
        }
    }
    ring_down_unknown(found, material, record, fitted);
    worst_pair(found, fitted, place);
    for (whiteness, channel) in fitted.whiteness.iter().zip(["V_o1", "reference"]) {
        warn_of_memory(found, &format!("{place}, {channel}"), whiteness);
    }
    let last = integrated_capacitance(record.signal, record.interval_s, record.gain);
    let comb = |angle: f64| fit.parameters[2] * (-(angle / fit.parameters[3]).powi(2)).portable_exp();
    let angle =
        |k: usize| fitted.fitted.get(k).map_or(f64::NAN, |f| f[1] - fit.parameters[unknown::ANGLE_OFFSET]);
    let end = last.len().saturating_sub(1);
    let true_change = comb(angle(end)) - comb(angle(0));
    found.notes.push(format!(
        "{place}: adding up the charge instead of fitting would be {} pF off at the end of the record",
        short(1e12 * (last.get(end).copied().unwrap_or(f64::NAN) - true_change))
    ));
}

/// What a ring-down does not tell.
fn ring_down_unknown(
    found: &mut Identification,
    material: &Material,
    record: &RingDown,
    fitted: &RingDownFit,
) {
    let (place, fit, inertia) = (&material.name, &fitted.fit, record.scanner.resonator.inertia);
    undetermined(
        found,
        "inertia J",
        format!(
            "free motion knows k/J and b/J alone; J = {inertia:e} kg m^2 is held as the file has it, from geometry: k \
             and b are off by as much, in per cent, as it is, and C0 by as much as R_f V is"
        ),
    );
    undetermined(
        found,
        CB,
        "a constant capacitance under a constant bias has no current and no torque: it does not enter V_o1 nor the \
         motion; only a C_b + b is seen, in the steady state"
            .to_owned(),
    );
    if !fitted.with_reference {
        undetermined(
            found,
            "sign of the motion",
            "the angle and its mirror image give the same V_o1; the answer that starts to the positive side is \
             given; a reference or a calibration says which"
                .to_owned(),
        );
        let parts = fit.weakest.map(|d| {
            (d.parts[WIDTH], d.parts[unknown::ANGLE].portable_hypot(d.parts[unknown::RATE]), d.relative)
        });
        if let Some((width, start, relative)) = parts {
            found.warnings.push(format!(
                "{place}: without a reference theta0 and the angle grow together almost unseen, the direction that \
                 the record says least of ({:.0} % of its square theta0, {:.0} % the start; singular value {:.1e} of \
                 the largest); only the weakening of the bias's pull with the angle tells them apart",
                100.0 * width * width,
                100.0 * start * start,
                relative
            ));
        }
    }
    for direction in &fit.undetermined {
        let parts = NAMES.iter().zip(direction.parts).filter(|(_, part)| part.abs() > 0.1);
        let named: Vec<String> = parts.map(|((name, _), part)| format!("{part:+.2} {name}")).collect();
        undetermined(
            found,
            &named.join(", "),
            format!("{place} says nothing of this combination, each in units of what it does to the record"),
        );
    }
    for index in [STIFFNESS, unknown::DAMPING, unknown::NOMINAL, WIDTH] {
        let parameter = fit.parameter(index);
        if !is_known(fitted, index) {
            undetermined(
                found,
                NAMES[index].0,
                format!(
                    "its standard error is {:.0} % of it; the experiment keeps the value that it had",
                    100.0 * parameter.deviation / parameter.value.abs()
                ),
            );
        }
    }
}

fn worst_pair(found: &mut Identification, fitted: &RingDownFit, place: &str) {
    let c = &fitted.fit.covariance;
    let mut worst: Option<Correlated> = None;
    let physical = &NAMES[..=WIDTH];
    for (i, (one, _)) in physical.iter().enumerate() {
        for (j, (other, _)) in physical.iter().enumerate().take(i) {
            let correlation = c.get(i, j) / (c.get(i, i) * c.get(j, j)).sqrt();
            if correlation.is_finite()
                && worst.as_ref().is_none_or(|w| correlation.abs() > w.correlation.abs())
            {
                let names = [(*other).to_owned(), (*one).to_owned()];
                worst = Some(Correlated { names, correlation, recording: place.to_owned() });
            }
        }
    }
    found.worst_pairs.extend(worst);
}

/// Amplitudes that the cost of an unknown gain is said for, in degrees.
const AMPLITUDES_DEG: [f64; 3] = [6.0, 9.0, 15.0];

fn ambiguity(width: f64) -> String {
    let factors =
        AMPLITUDES_DEG.map(|deg| format!("{:.0} at {deg} deg", gain_ambiguity(deg.to_radians(), width)));
    format!(
        "fitting gain and offset with the amplitude multiplies the amplitude's standard deviation by {}",
        factors.join(", ")
    )
}

pub fn steady_state(
    found: &mut Identification,
    material: &Material,
    record: &SteadyState,
    fitted: &SteadyStateFit,
) {
    let place = &material.name;
    for (name, value, unit) in [
        ("circuit swing a C0", fitted.swing, "V"),
        ("circuit level a C_b + b", fitted.level, "V"),
        ("circuit gain a", fitted.gain, "V/F"),
        ("circuit offset b", fitted.offset, "V"),
    ] {
        found.parameters.push(Identified::gaussian(name, value, unit, place));
    }
    undetermined(
        found,
        "a, b and C_b apart",
        format!(
            "only a C0 and a C_b + b are observable: a is theirs over C0, and b that for C_b = {:e} F, which is held \
             as the file has it",
            record.comb.bias
        ),
    );
    found.notes.push(format!(
        "{place}: without the reference the recording hardly distinguishes gain and amplitude: {}; here, at {:.1} deg, {:.0}",
        ambiguity(record.comb.angular_width),
        fitted.amplitude.to_degrees(),
        gain_ambiguity(fitted.amplitude, record.comb.angular_width)
    ));
    let affine = 100.0 * fitted.affine_residual(&material.signal);
    if let (Some(poles), Some(left)) = (&fitted.poles, fitted.poles_residual(&material.signal)) {
        let fit = &poles.fit;
        for (name, value, unit) in [
            ("demodulator poles (two)", poles.frequency_hz(), "Hz"),
            ("circuit gain a, with poles", fit.parameter(1), "V/F"),
            ("circuit offset b, with poles", fit.parameter(2), "V"),
        ] {
            found.parameters.push(Identified::gaussian(name, value, unit, place));
        }
        found.warnings.push(format!(
                "{place}: the demodulator's poles are seen: the signal is affine in C to {affine:.2} % of its rms, and \
                 to {:.2} % in C behind two poles; gain and offset of the experiment are the affine ones, and an \
                 estimate without the poles carries that error",
                100.0 * left
            ));
        warn_of_memory(found, &format!("{place}, with poles"), &poles.whiteness);
    } else {
        found.notes.push(format!(
                "{place}: the signal is affine in C to {affine:.2} % of its rms; poles of the demodulator are not seen"
            ));
        let whiteness = &fitted.affine.whiteness;
        if !whiteness.is_white() {
            found.warnings.push(format!(
                    "{place}: the residuals are not white (Durbin-Watson {:.2}, Ljung-Box p = {:.1e}); the standard \
                     errors allow for that after Newey and West",
                    whiteness.durbin_watson, whiteness.probability
                ));
        }
    }
    let c = &fitted.affine.covariance;
    found.worst_pairs.push(Correlated {
        names: ["circuit gain a".to_owned(), "circuit offset b".to_owned()],
        correlation: c.get(0, 1) / (c.get(0, 0) * c.get(1, 1)).sqrt(),
        recording: place.clone(),
    });
}

/// The comb's width by the steady state, where no ring-down tells it.
pub fn steady_state_width(found: &mut Identification, material: &Material, width: Option<DerivedNumber>) {
    if let Some(width) = width {
        let name = "angular width theta0 by the steady state";
        found.parameters.push(Identified::gaussian(name, width, "rad", &material.name));
    }
}

/// A bias voltage that differs by more than this from what is stated is told.
const SAME_BIAS: f64 = 2e-3;

/// The bias voltage that was recorded, beside that which the file states.
pub fn recorded_bias(found: &mut Identification, material: &Material, (stated, recorded): (f64, f64)) {
    let place = &material.name;
    if (stated / recorded - 1.0).abs() > SAME_BIAS {
        found.warnings.push(format!(
            "{place}: `identify.ring_down.bias` says {stated} V, and the recording's channel `bias` shows {recorded:.4} V in the mean, \
             {:+.2} % from it: the recorded one is used, as C0 and theta0 depend on it; correct the file, or leave the channel out",
            100.0 * (recorded / stated - 1.0)
        ));
    } else {
        found.notes.push(format!(
            "{place}: the bias is that of the recording's channel `bias`, {recorded:.4} V in the mean"
        ));
    }
}

/// There is no steady state, or none with a reference.
pub fn no_reference(found: &mut Identification, material: Option<&Material>, width: f64) {
    let lacks = material.map_or_else(
        || "no recording has the role `steady_state`".to_owned(),
        |material| format!("{} has no reference", material.name),
    );
    undetermined(
        found,
        "circuit gain a and offset b",
        format!(
            "{lacks}; without the angle the recording hardly distinguishes gain and amplitude: {}",
            ambiguity(width)
        ),
    );
}

pub fn still(found: &mut Identification, material: &Material, fitted: &StillNoise) {
    let place = &material.name;
    found.parameters.push(Identified {
        name: "noise variance R".to_owned(),
        stated: None,
        value: fitted.variance,
        standard_error: fitted.variance_deviation,
        interval: fitted.interval,
        unit: "V^2",
        recording: place.clone(),
    });
    if !fitted.whiteness.is_white() {
        found.warnings.push(format!(
            "{place}: the noise is not white (correlation of neighbours {:.2}, Ljung-Box p = {:.1e}): a filter that \
             takes it as white claims too much",
            fitted.whiteness.neighbours, fitted.whiteness.probability
        ));
    }
    if fitted.drifts() {
        found.warnings.push(format!(
            "{place}: the level drifts by {} V/s ({} standard errors): the variance includes that",
            short(fitted.drift[0]),
            short(fitted.drift[0].abs() / fitted.drift[1])
        ));
    }
    for [frequency_hz, amplitude] in &fitted.lines {
        found.warnings.push(format!(
            "{place}: a line at {frequency_hz:.0} Hz, amplitude {} V: it is no noise, and the variance includes it; if \
             it is at the motion's frequency or twice that, the device moves",
            short(*amplitude)
        ));
    }
}

/// What a ring-down determines, its role, and what is taken where there is none.
pub const RING_DOWN: [&str; 3] =
    ["k, b, C0 and theta0", "ring_down", "the values of the file are taken as right"];
/// The same of a recording without a drive.
pub const STILL: [&str; 3] = ["noise variance R", "zero_drive", "the value of the file stands"];

/// What is not determined because no recording has the role that it needs.
pub fn no_recording(found: &mut Identification, [what, role, instead]: [&str; 3]) {
    undetermined(found, what, format!("no recording has the role `{role}`; {instead}"));
}
