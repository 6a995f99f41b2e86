//! Devices in which a mechanical motion is coupled with heat, charge, friction or other motions, by their text and by functions.

use super::step_errors::{Between, Device};
use std::f64::consts::TAU;

/// A mirror that the current of a coil turns, whose resistance grows as the coil becomes warm.
pub(super) fn magnetic_mirror() -> Device<3, 1> {
    let text = r#"
[device.equations]
states = { theta = "rad", omega = "rad/s", T = "K" }
inputs = { drive = "V" }
let = { current = "drive/(R*(1 + alpha*T))" }
derivative = { theta = "omega", omega = "(field*current - b*omega - k*theta)/J", T = "(drive*current - loss*T)/heat" }
measure = { signal0 = "gain*theta in V" }
noise = { signal0 = "1e-6[V^2]", omega = "0.1[rad^2/s^3]", T = "1e-3[K^2/s]" }
[device.equations.parameters]
J = "2e-12 kg m^2"
k = "7.8957e-5 N m/rad"
b = "1.2566e-10 N m s/rad"
field = "2e-6 N m/A"
R = "100 ohm"
alpha = "3.9e-3 1/K"
loss = "2e-4 W/K"
heat = "4e-6 J/K"
gain = "10 V/rad"
"#;
    Device {
        text: text.to_owned(),
        states: ["theta", "omega", "T"],
        units: ["rad", "rad/s", "K"],
        rate: Box::new(|[angle, rate, warm], u| {
            let current = u / (100.0 * (1.0 + 3.9e-3 * warm));
            let torque = 2e-6 * current - 1.2566e-10 * rate - 7.8957e-5 * angle;
            [*rate, torque / 2e-12, (u * current - 2e-4 * warm) / 4e-6]
        }),
        read: Box::new(|[angle, _, _]| [10.0 * angle]),
        noise: [0.0, 0.1, 1e-3],
        sample_sd: [1e-3],
        start: [0.0; 3],
        start_sd: [1e-4, 1.0, 1.0],
        drive: Box::new(|t| (TAU * 1002.0 * t).sin()),
        is_driven: true,
        between: Between::AsItIs,
        rate_hz: 64e3,
        substeps: 20,
        skip_s: 20e-3,
    }
}

/// A piezoelectric mirror whose restoring force follows Dahl's model of friction: the force h grows with the way until it is at its limit.
pub(super) fn hysteretic_mirror() -> Device<3, 1> {
    let text = r#"
[device.equations]
states = { x = "m", v = "m/s", h = "N" }
inputs = { drive = "V" }
derivative = { x = "v", v = "(force*drive - b*v - k*x - h)/m", h = "stick*v - stick/limit*abs(v)*h" }
measure = { signal0 = "gain*x in V" }
noise = { signal0 = "1e-6[V^2]", v = "1e-3[m^2/s^3]" }
[device.equations.parameters]
m = "1e-6 kg"
k = "157.91 N/m"
b = "2.513e-4 N s/m"
force = "1e-4 N/V"
stick = "30 N/m"
limit = "5e-5 N"
gain = "0.1 V/um"
"#;
    Device {
        text: text.to_owned(),
        states: ["x", "v", "h"],
        units: ["m", "m/s", "N"],
        rate: Box::new(|[x, v, h], u| {
            let force = 1e-4 * u - 2.513e-4 * v - 157.91 * x - h;
            [*v, force / 1e-6, 30.0 * v - 30.0 / 5e-5 * v.abs() * h]
        }),
        read: Box::new(|[x, _, _]| [1e5 * x]),
        noise: [0.0, 1e-3, 0.0],
        sample_sd: [1e-3],
        start: [0.0; 3],
        start_sd: [1e-8, 1e-4, 1e-6],
        drive: Box::new(|t| 10.0 * (TAU * 300.0 * t).sin()),
        is_driven: true,
        between: Between::AsItIs,
        rate_hz: 40e3,
        substeps: 40,
        skip_s: 20e-3,
    }
}

/// A microphone whose plates hold a charge that leaks through a resistor, under a sound pressure that a reference microphone states.
pub(super) fn microphone() -> Device<3, 1> {
    let text = r#"
[device.equations]
states = { x = "m", v = "m/s", q = "C" }
inputs = { drive = "V" }
let = { plate = "8.8542e-12[F/m]*area", voltage = "q*(gap - x)/plate" }
derivative = { x = "v", v = "(area*reference*drive + q^2/(2*plate) - b*v - k*x)/m", q = "(bias - voltage)/R" }
measure = { signal0 = "voltage in V" }
noise = { signal0 = "1e-8[V^2]", v = "1e-6[m^2/s^3]", q = "1e-34[C^2/s]" }
[device.equations.parameters]
m = "1e-9 kg"
k = "35.53 N/m"
b = "1.2566e-4 N s/m"
gap = "3 um"
area = "1e-6 m^2"
bias = "3 V"
R = "1e9 ohm"
reference = "1 Pa/V"
"#;
    Device {
        text: text.to_owned(),
        states: ["x", "v", "q"],
        units: ["m", "m/s", "C"],
        rate: Box::new(|[x, v, charge], u| {
            let plate = 8.8542e-18;
            let force = 1e-6 * u + charge * charge / (2.0 * plate) - 1.2566e-4 * v - 35.53 * x;
            [*v, force / 1e-9, (3.0 - charge * (3e-6 - x) / plate) / 1e9]
        }),
        read: Box::new(|[x, _, charge]| [charge * (3e-6 - x) / 8.8542e-18]),
        noise: [0.0, 1e-6, 1e-34],
        sample_sd: [1e-4],
        start: [1.36e-7, 0.0, 9.275e-12],
        start_sd: [1e-9, 1e-4, 1e-14],
        drive: Box::new(|t| (TAU * 1e3 * t).sin() + (TAU * 3.3e3 * t).sin() + (TAU * 7e3 * t).sin()),
        is_driven: true,
        between: Between::AsItIs,
        rate_hz: 200e3,
        substeps: 16,
        skip_s: 6e-3,
    }
}

/// Six resonators in a row, each coupled with its neighbours; the first is driven and the last is read.
pub(super) fn chain() -> Device<12, 1> {
    let names = ["x1", "x2", "x3", "x4", "x5", "x6", "v1", "v2", "v3", "v4", "v5", "v6"];
    let is_place = |i: usize| i < 6;
    let units: [&str; 12] = std::array::from_fn(|i| if is_place(i) { "m" } else { "m/s" });
    let declared: Vec<String> =
        names.iter().zip(units).map(|(n, unit)| format!("{n} = \"{unit}\"")).collect();
    let derivative = |i: usize| {
        if is_place(i) {
            return format!("{} = \"v{}\"", names[i], i + 1);
        }
        let own = i - 5;
        let neighbours = [own - 1, own + 1].into_iter().filter(|one| (1..=6).contains(one));
        let coupling: Vec<String> = neighbours.map(|one| format!(" - coupling*(x{own} - x{one})")).collect();
        let coupling = coupling.concat();
        let drive = if own == 1 { "force*drive" } else { "0[N]" };
        format!("{} = \"({drive} - b*v{own} - anchor*x{own}{coupling})/m\"", names[i])
    };
    let derivatives: Vec<String> = (0..12).map(derivative).collect();
    let noises: Vec<String> = (1..=6).map(|i| format!("v{i} = \"1e-8[m^2/s^3]\"")).collect();
    let text = format!(
        "[device.equations]\nstates = {{ {} }}\ninputs = {{ drive = \"V\" }}\nmeasure = {{ signal0 = \"gain*x6 in V\" }}\n\
         noise = {{ signal0 = \"1e-6[V^2]\", {} }}\nderivative = {{ {} }}\n[device.equations.parameters]\nm = \"1e-9 kg\"\n\
         anchor = \"3.948 N/m\"\ncoupling = \"0.079 N/m\"\nb = \"3.14e-7 N s/m\"\nforce = \"1e-7 N/V\"\ngain = \"1 V/um\"\n",
        declared.join(", "),
        noises.join(", "),
        derivatives.join(", ")
    );
    Device {
        text,
        states: names,
        units,
        rate: Box::new(|x, u| {
            std::array::from_fn(|i| {
                if i < 6 {
                    return x[i + 6];
                }
                let own = i - 6;
                let mut force = -3.14e-7 * x[i] - 3.948 * x[own] + if own == 0 { 1e-7 * u } else { 0.0 };
                if own > 0 {
                    force -= 0.079 * (x[own] - x[own - 1]);
                }
                if own < 5 {
                    force -= 0.079 * (x[own] - x[own + 1]);
                }
                force / 1e-9
            })
        }),
        read: Box::new(|x| [1e6 * x[5]]),
        noise: std::array::from_fn(|i| if i < 6 { 0.0 } else { 1e-8 }),
        sample_sd: [1e-3],
        start: [0.0; 12],
        start_sd: std::array::from_fn(|i| if i < 6 { 1e-9 } else { 1e-4 }),
        drive: Box::new(|t| (TAU * 10.05e3 * t).sin() + (TAU * 10.2e3 * t).sin()),
        is_driven: true,
        between: Between::AsItIs,
        rate_hz: 320e3,
        substeps: 16,
        skip_s: 6e-3,
    }
}

/// A pressure sensor with a thermometer, of whose samples a recording has one in eight.
pub(super) fn pressure_sensor() -> Device<2, 2> {
    let text = r#"
[device.equations]
states = { p = "Pa", T = "K" }
inputs = { drive = "V" }
derivative = { p = "(pump*drive - p)/fill", T = "(heat*drive^2 - T)/warm" }
measure = { signal0 = "offset + gain*p*(1 + tempco*T) in V", signal1 = "sensor*T in V" }
noise = { signal0 = "1e-6[V^2]", signal1 = "1e-6[V^2]", p = "1e6[Pa^2/s]", T = "1e-2[K^2/s]" }
[device.equations.parameters]
pump = "1e5 Pa/V"
fill = "10 ms"
heat = "5 K/V^2"
warm = "0.2 s"
offset = "0.1 V"
gain = "1e-5 V/Pa"
tempco = "2e-3 1/K"
sensor = "10 mV/K"
"#;
    Device {
        text: text.to_owned(),
        states: ["p", "T"],
        units: ["Pa", "K"],
        rate: Box::new(|[pressure, warm], u| [(1e5 * u - pressure) / 10e-3, (5.0 * u * u - warm) / 0.2]),
        read: Box::new(|[pressure, warm]| [0.1 + 1e-5 * pressure * (1.0 + 2e-3 * warm), 10e-3 * warm]),
        noise: [1e6, 1e-2],
        sample_sd: [1e-3, 1e-3],
        start: [0.0; 2],
        start_sd: [1e3, 1.0],
        drive: Box::new(|t| 0.5 + 0.5 * (TAU * 7.0 * t).sin() + 0.2 * (TAU * 31.0 * t).sin()),
        is_driven: true,
        between: Between::AsItIs,
        rate_hz: 10e3,
        substeps: 16,
        skip_s: 0.1,
    }
}
