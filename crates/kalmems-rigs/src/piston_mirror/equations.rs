//! The piston mirror before its electrode as differential equations: a phasor whose amplitude, frequency and rest position drift, and the mirror
//! under its drive.

use super::device::PistonMirror;
use super::mechanics::Mechanics;
use crate::Expansion;
use crate::config::Quantity;

/// The motion, of which no number of the experiment is a part.
const MOTION: &str = r#"
[device.equations.states]
amplitude = "m"
frequency = "Hz"
phase = "rad"
offset = "m"
amplitude_rate = "m/s"

[device.equations.let]
c = "cos(phase)"
s = "sin(phase)"
c2 = "c*c - s*s"
s2 = "2*c*s"
c3 = "c*c2 - s*s2"
s3 = "s*c2 + c*s2"
second_harmonic = "second_harmonic_cosine*c2 + second_harmonic_sine*s2"
third_harmonic = "third_harmonic_cosine*c3 + third_harmonic_sine*s3"
distance = "offset + amplitude*c + second_harmonic + third_harmonic"
slope = "-amplitude*s - 2*second_harmonic_cosine*s2 + 2*second_harmonic_sine*c2 - 3*third_harmonic_cosine*s3 + 3*third_harmonic_sine*c3"
near = "reference_distance/distance"

[device.equations.derivative]
amplitude = "amplitude_rate"
frequency = "0"
phase = "2*pi*frequency"
offset = "0"
amplitude_rate = "0"

[device.equations.quantities]
position = "distance in m"
velocity = "amplitude_rate*c + 2*pi*frequency*slope in m/s"

[device.equations.sine]
of = "position"
rate = "velocity"
offset = "offset"
amplitude = "amplitude"
frequency = "frequency"
phase = "phase"
amplitude_rate = "amplitude_rate"
held = ["offset", "amplitude_rate"]
trigger = { channel = "trigger", rises = 2 }

[device.equations.cyclic]
phase = "2*pi"
"#;

/// The mirror under its drive: m·z̈ + m·ω/Q·ż + m·ω²·z = ½·C_d′(z)·V² for the comb C_d = C·exp(−z²/w²), whose plane is that of the rest position, so
/// that it pulls back from either side and a voltage at twice the frequency of the motion keeps it going (Faller and Zangl, 2017, section II-A).
const DRIVEN: &str = r#"
[device.equations.states]
displacement = "m"
velocity = "m/s"
offset = "m"

[device.equations.inputs]
trigger = "V"

[device.equations.let]
distance = "offset + displacement"
near = "reference_distance/distance"
comb_slope = "-2*displacement/comb_width^2*comb_capacitance*exp(-(displacement/comb_width)^2)"

[device.equations.derivative]
displacement = "velocity"
velocity = "(0.5*comb_slope*trigger^2 - damping*velocity - stiffness*displacement)/mass"
offset = "0"

[device.equations.quantities]
position = "distance in m"
"#;

/// What both have: the capacitance over the distance, the noise of its readout, and the distances that it is described for.
fn readout(mirror: &PistonMirror, all: &mut Expansion, numbers: &[(&str, f64, &str)]) {
    let series = &mirror.capacitance;
    // The highest power that there is: a series that goes on with zeros is the same.
    let powers = series.coefficients.iter().rposition(|c| c.si() != 0.0).map_or(1, |last| last + 1);
    let coefficients: Vec<String> = (0..powers).map(|k| format!("coefficient_{k}")).collect();
    let mut parameters = vec![("reference_distance", series.reference_distance.si(), "m")];
    parameters
        .extend(coefficients.iter().zip(&series.coefficients).map(|(name, c)| (name.as_str(), c.si(), "F")));
    parameters.extend([
        ("gain", 1.0, ""),
        ("stray_capacitance", 0.0, "F"),
        ("noise_density", mirror.readout.noise_density.si(), "F/sqrt(Hz)"),
    ]);
    parameters.extend(numbers);
    all.numbers("parameters", &parameters);
    let term = |(k, name): (usize, &String)| {
        if k == 1 { format!("{name}*near") } else { format!("{name}*near^{k}") }
    };
    let of_distance = coefficients.iter().enumerate().skip(1).map(term).collect::<Vec<_>>().join(" + ");
    let seen = format!("coefficient_0 + stray_capacitance + gain*({of_distance}) in F");
    all.table("measure", &[("signal", seen.as_str())]);
    all.table("noise", &[("signal", "noise_density^2")]);
    if let Some(bandwidth) = &mirror.readout.bandwidth {
        all.table("bandwidth", &[("signal", &format!("{:?} Hz", bandwidth.si()))]);
    }
    let nearest = format!("{:?} m", series.nearest.as_ref().map_or(0.0, Quantity::si));
    let farthest = series.farthest.as_ref().map(|farthest| format!("{:?} m", farthest.si()));
    let ends = [("from", nearest.as_str())].into_iter().chain(farthest.as_deref().map(|end| ("to", end)));
    all.table("range.position", &ends.collect::<Vec<_>>());
}

/// The equations of its filters.
pub fn motion(mirror: &PistonMirror) -> Expansion {
    with_second_harmonic(mirror, [0.0; 2])
}

/// The same with a second harmonic of these amplitudes by cos 2φ and sin 2φ, in m.
pub fn with_second_harmonic(mirror: &PistonMirror, [cosine, sine]: [f64; 2]) -> Expansion {
    let mut all = Expansion { text: MOTION.to_owned(), ..Expansion::default() };
    let harmonics = [
        ("second_harmonic_cosine", cosine, "m"),
        ("second_harmonic_sine", sine, "m"),
        ("third_harmonic_cosine", 0.0, "m"),
        ("third_harmonic_sine", 0.0, "m"),
    ];
    readout(mirror, &mut all, &harmonics);
    if mirror.mirror.is_some() {
        all.notes.push(
            "The mirror's mechanics and drive (`mirror`) are not part of the equations, as no filter has them.".to_owned(),
        );
    }
    all
}

/// The equations of the mirror under pulses, seen by the same readout, with the pulses as the trigger beside it.
pub fn driven(mirror: &PistonMirror, mechanics: &Mechanics) -> Expansion {
    let mut all = Expansion { text: DRIVEN.to_owned(), ..Expansion::default() };
    let device = mechanics.device(mechanics.pressure);
    let numbers = [
        ("mass", device.resonator.inertia, "kg"),
        ("damping", device.resonator.damping, "N s/m"),
        ("stiffness", device.resonator.stiffness, "N/m"),
        ("comb_capacitance", device.comb.nominal, "F"),
        ("comb_width", device.comb.angular_width, "m"),
    ];
    readout(mirror, &mut all, &numbers);
    all
}

/// Where a parameter of the equations stands in the device's table, with the power of it there.
pub fn keys(parameter: &str) -> Vec<(&'static str, i32)> {
    const COEFFICIENTS: [&str; super::plates::COEFFICIENTS] = [
        "capacitance.coefficients[0]",
        "capacitance.coefficients[1]",
        "capacitance.coefficients[2]",
        "capacitance.coefficients[3]",
        "capacitance.coefficients[4]",
        "capacitance.coefficients[5]",
        "capacitance.coefficients[6]",
        "capacitance.coefficients[7]",
        "capacitance.coefficients[8]",
    ];
    let coefficient =
        parameter.strip_prefix("coefficient_").and_then(|k| COEFFICIENTS.get(k.parse::<usize>().ok()?));
    match parameter {
        "gain" => COEFFICIENTS.iter().skip(1).map(|key| (*key, 1)).collect(),
        "stray_capacitance" => vec![(COEFFICIENTS[0], 1)],
        "reference_distance" => vec![("capacitance.reference_distance", 1)],
        "noise_density" => vec![("readout.noise_density", 1)],
        _ => coefficient.map(|key| (*key, 1)).into_iter().collect(),
    }
}
