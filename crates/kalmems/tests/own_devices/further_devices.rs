//! Devices by their text and by functions, which are simulated in classical Runge–Kutta steps by equations that are written down a second time.

use super::step_errors::{Between, Device, whole};
use std::f64::consts::TAU;

/// The polynomial through six samples of the drive alone makes errors of 1.4 times the claim at 20 samples in a cycle, as `inspect` says.
pub(super) fn between(per_cycle: f64) -> Between {
    if per_cycle < 26.0 { Between::AlongItsSine } else { Between::AsItIs }
}

fn interpolation(per_cycle: f64) -> &'static str {
    if per_cycle < 26.0 { "sine" } else { "quintic" }
}

/// A comb resonator whose spring hardens, behind an amplifier with a lag.
pub(super) fn comb_resonator(per_cycle: f64) -> Device<3, 1> {
    let text = r#"
[device.equations]
states = { x = "m", v = "m/s", passed = "V" }
inputs = { drive = "V" }
interpolation = "BETWEEN"
measure = { signal0 = "passed in V" }
noise = { signal0 = "1e-6[V^2]", v = "2*4.0453e-21[J]*b/m^2" }
parameters = { m = "1.2e-9 kg", k = "4.7374 N/m", b = "3.0159e-7 N s/m", force = "2.96e-9 N/V^2", hardening = "6.25e8 1/m^2", sensitivity = "0.2 V/um", lag = "4 us" }
[device.equations.derivative]
x = "v"
v = "(force*drive^2 - b*v - k*x*(1 + hardening*x^2))/m"
passed = "(sensitivity*x - passed)/lag"
"#;
    Device {
        text: text.replace("BETWEEN", interpolation(per_cycle)),
        states: ["x", "v", "passed"],
        units: ["m", "m/s", "V"],
        rate: Box::new(|[x, v, passed], u| {
            let spring = 4.7374 * x * (1.0 + 6.25e8 * x * x);
            let force = 2.96e-9 * u * u - 3.0159e-7 * v - spring;
            [*v, force / 1.2e-9, (0.2e6 * x - passed) / 4e-6]
        }),
        read: Box::new(|[_, _, passed]| [*passed]),
        noise: [0.0, 2.0 * 4.0453e-21 * 3.0159e-7 / 1.2e-9_f64.powi(2), 0.0],
        sample_sd: [1e-3],
        start: [0.0; 3],
        start_sd: [1e-7, 6e-3, 2e-2],
        drive: Box::new(|t| 10.0 + 2.0 * (TAU * 10e3 * t).sin()),
        is_driven: true,
        between: between(per_cycle),
        rate_hz: 10e3 * per_cycle,
        substeps: whole(1600.0 / per_cycle),
        skip_s: 6e-3,
    }
}

/// A tuning fork behind a charge amplifier, in a gas that makes a hundred times as much noise as its damping does.
pub(super) fn tuning_fork(per_cycle: f64) -> Device<3, 1> {
    let text = r#"
[device.equations]
states = { x = "m", v = "m/s", passed = "C" }
inputs = { drive = "V" }
interpolation = "BETWEEN"
measure = { signal0 = "-(coupling*x - passed)/feedback in V" }
noise = { signal0 = "2.5e-9[V^2]", v = "2.5e-11[m^2/s^3]" }
parameters = { m = "6.6e-7 kg", k = "27966.9 N/m", b = "1.3586e-5 N s/m", coupling = "9.2e-6 C/m", feedback = "4.7 pF", leak = "0.1034 ms" }
[device.equations.derivative]
x = "v"
v = "(coupling*drive - b*v - k*x)/m"
passed = "(coupling*x - passed)/leak"
"#;
    Device {
        text: text.replace("BETWEEN", interpolation(per_cycle)),
        states: ["x", "v", "passed"],
        units: ["m", "m/s", "C"],
        rate: Box::new(|[x, v, passed], u| {
            let force = 9.2e-6 * u - 1.3586e-5 * v - 27966.9 * x;
            [*v, force / 6.6e-7, (9.2e-6 * x - passed) / 1.034e-4]
        }),
        read: Box::new(|[x, _, passed]| [-(9.2e-6 * x - passed) / 4.7e-12]),
        noise: [0.0, 2.5e-11, 0.0],
        sample_sd: [5e-5],
        start: [0.0; 3],
        start_sd: [1e-10, 2e-5, 1e-15],
        drive: Box::new(|t| 0.01 * (TAU * 32_762.0 * t).sin()),
        is_driven: true,
        between: between(per_cycle),
        rate_hz: 32_762.0 * per_cycle,
        substeps: whole(1600.0 / per_cycle),
        skip_s: 10e-3,
    }
}

/// Two modes that a rate of rotation couples, which is a state with its own bandwidth.
pub(super) fn vibrating_gyroscope(per_cycle: f64) -> Device<6, 2> {
    let text = r#"
[device.equations]
states = { Omega = "rad/s", alpha = "rad/s^2", x = "m", v = "m/s", y = "m", w = "m/s" }
inputs = { drive = "V" }
interpolation = "BETWEEN"
measure = { signal0 = "drive_gain*x in V", signal1 = "sense_gain*y in V" }
[device.equations.derivative]
x = "v"
v = "(force*drive - b*v - k*x - coupling*y)/m + 2*Omega*w"
y = "w"
w = "(-sense_b*w - sense_k*y - coupling*x)/m - 2*Omega*v"
Omega = "alpha"
alpha = "-bandwidth^2*Omega - 2*bandwidth*alpha"
[device.equations.noise]
v = "2*4.0453e-21[J]*b/m^2"
w = "2*4.0453e-21[J]*sense_b/m^2"
alpha = "4*bandwidth^3*1[rad^2/s^2]"
signal0 = "1e-6[V^2]"
signal1 = "9e-8[V^2]"
[device.equations.parameters]
m = "1e-8 kg"
k = "39.44 N/m"
b = "1.2e-7 N s/m"
sense_k = "41.5 N/m"
sense_b = "6.8e-7 N s/m"
coupling = "5e-3 N/m"
force = "3.9e-8 N/V"
drive_gain = "0.2 V/um"
sense_gain = "10 V/um"
bandwidth = "125.66 rad/s"
"#;
    let thermal = |damping: f64| 2.0 * 4.0453e-21 * damping / 1e-16;
    Device {
        text: text.replace("BETWEEN", interpolation(per_cycle)),
        states: ["Omega", "alpha", "x", "v", "y", "w"],
        units: ["rad/s", "rad/s^2", "m", "m/s", "m", "m/s"],
        rate: Box::new(|[turning, change, x, v, y, w], u| {
            let of_drive = 3.9e-8 * u - 1.2e-7 * v - 39.44 * x - 5e-3 * y;
            let of_sense = -6.8e-7 * w - 41.5 * y - 5e-3 * x;
            let (b, coriolis) = (125.66, 2.0 * turning);
            let settles = -b * b * turning - 2.0 * b * change;
            [*change, settles, *v, of_drive / 1e-8 + coriolis * w, *w, of_sense / 1e-8 - coriolis * v]
        }),
        read: Box::new(|[_, _, x, _, y, _]| [2e5 * x, 1e7 * y]),
        noise: [0.0, 4.0 * 125.66_f64.powi(3), 0.0, thermal(1.2e-7), 0.0, thermal(6.8e-7)],
        sample_sd: [1e-3, 3e-4],
        start: [0.0, 0.0, -4e-6, 0.0, 0.0, 0.0],
        start_sd: [1.0, 125.66, 1e-7, 6e-3, 2e-8, 1.3e-3],
        drive: Box::new(|t| (TAU * 9995.0 * t).sin()),
        is_driven: true,
        between: between(per_cycle),
        rate_hz: 9995.0 * per_cycle,
        substeps: whole(1600.0 / per_cycle),
        skip_s: 20e-3,
    }
}

/// A plate whose distance swings, with amplitude, frequency and phase as states.
pub(super) fn piston_mirror(per_cycle: f64) -> Device<5, 1> {
    let text = r#"
[device.equations]
states = { A = "m", f = "Hz", phi = "rad", d0 = "m", A_rate = "m/s" }
let = { near = "1[mm]/(d0 + A*cos(phi))" }
derivative = { A = "A_rate", f = "0", phi = "2*pi*f", d0 = "0", A_rate = "0" }
measure = { signal0 = "gain*(stray + plate*near + fringe*near^2) in V" }
cyclic = { phi = "2*pi" }
noise = { f = "1e-4[Hz^2/s]", d0 = "1e-13[m^2/s]", A_rate = "1e-9[m^2/s^3]", signal0 = "1e-10[V^2]" }
parameters = { gain = "1 V/pF", stray = "3 fF", plate = "100 fF", fringe = "9.3 fF" }
"#;
    Device {
        text: text.to_owned(),
        states: ["A", "f", "phi", "d0", "A_rate"],
        units: ["m", "Hz", "rad", "m", "m/s"],
        rate: Box::new(|x, _| [x[4], 0.0, TAU * x[1], 0.0, 0.0]),
        read: Box::new(|[amplitude, _, phase, distance, _]| {
            let near = 1e-3 / (distance + amplitude * phase.cos());
            [3e-3 + 0.1 * near + 9.3e-3 * near * near]
        }),
        noise: [0.0, 1e-4, 0.0, 1e-13, 1e-9],
        sample_sd: [1e-5],
        start: [0.5e-3, 500.0, 0.7, 1e-3, 0.0],
        start_sd: [1e-7, 0.01, 1e-3, 1e-7, 1e-6],
        drive: Box::new(|_| 0.0),
        is_driven: false,
        between: Between::Held,
        rate_hz: 500.0 * per_cycle,
        substeps: 16,
        skip_s: 40e-3,
    }
}

/// A switch that is pulled in, bounces off its contact as off a spring, and is let go.
pub(super) fn contact_switch(per_cycle: f64) -> Device<2, 1> {
    let text = r#"
[device.equations]
states = { x = "m", v = "m/s" }
inputs = { drive = "V" }
interpolation = "hold"
let = { contact = "if(x > travel, 8000[N/m]*(x - travel), 0[N])" }
measure = { signal0 = "1[V/fF]*plate/(gap - x) in V" }
noise = { v = "1e-3[m^2/s^3]", signal0 = "0.09[V^2]" }
parameters = { w = "251327.412 rad/s", Q = "3", m = "2e-10 kg", gap = "2 um", travel = "1.2 um", plate = "1.7708e-19 F m" }
[device.equations.derivative]
x = "v"
v = "-w/Q*v - w^2*x + plate*drive^2/(2*m*(gap - x)^2) - contact/m"
"#;
    Device {
        text: text.to_owned(),
        states: ["x", "v"],
        units: ["m", "m/s"],
        rate: Box::new(|[x, v], u| {
            let (w, gap) = (251_327.412, 2e-6 - x);
            let contact = 8000.0 * (x - 1.2e-6).max(0.0);
            let pull = 1.7708e-19 * u * u / (2.0 * gap * gap);
            [*v, (pull - contact) / 2e-10 - w / 3.0 * v - w * w * x]
        }),
        read: Box::new(|[x, _]| [1.7708e-4 / (2e-6 - x)]),
        noise: [0.0, 1e-3],
        sample_sd: [0.3],
        start: [0.0; 2],
        start_sd: [1e-9, 1e-3],
        drive: Box::new(|t| if t < 1e-3 { 22.0 } else { 0.0 }),
        is_driven: true,
        between: Between::Held,
        rate_hz: 40e3 * per_cycle,
        substeps: whole(20_000.0 / per_cycle),
        skip_s: 2e-5,
    }
}

/// A mirror in resonance that is read by a comb at a threshold.
pub(super) fn threshold(per_cycle: f64) -> Device<2, 1> {
    let text = r#"
[device.equations]
states = { theta = "rad", omega = "rad/s" }
inputs = { drive = "V" }
interpolation = "BETWEEN"
let = { form = "1/(1 + exp(-steepness*(theta - edge)))" }
derivative = { theta = "omega", omega = "-2*zeta*w*omega - w^2*theta + torque*drive" }
measure = { signal0 = "gain*form*omega + offset in V" }
noise = { omega = "1e3[rad^2/s^3]", signal0 = "1e-6[V^2]" }
parameters = { w = "3924.477 1/s", zeta = "0.0066", torque = "600 rad/(s^2 V)", gain = "2.82 mV s/rad", offset = "1 mV", steepness = "76 1/rad", edge = "0.0037 rad" }
"#;
    Device {
        text: text.replace("BETWEEN", interpolation(per_cycle)),
        states: ["theta", "omega"],
        units: ["rad", "rad/s"],
        rate: Box::new(|[angle, rate], u| {
            let w = 3924.477;
            [*rate, -0.0132 * w * rate - w * w * angle + 600.0 * u]
        }),
        read: Box::new(|[angle, rate]| [2.82e-3 * rate / (1.0 + (-76.0 * (angle - 3.7e-3)).exp()) + 1e-3]),
        noise: [0.0, 1e3],
        sample_sd: [1e-3],
        start: [-0.088, 0.0],
        start_sd: [1e-3, 4.0],
        drive: Box::new(|t| 30.0 * (TAU * 624.6 * t).sin()),
        is_driven: true,
        between: between(per_cycle),
        rate_hz: 624.6 * per_cycle,
        substeps: whole(1600.0 / per_cycle),
        skip_s: 20e-3,
    }
}
