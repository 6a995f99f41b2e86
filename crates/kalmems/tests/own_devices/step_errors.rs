//! The error of the integration step of a filter, in standard deviations that it claims, against the same filter with a converged step.
//!
//! The devices, their noises and starts are those with which the step was chosen, their drives straight between the samples. The recordings are simulated here, in classical
//! Runge–Kutta steps of a fraction of the sampling interval, by equations that are written down a second time.

use crate::events::recorded;
use crate::parts::same_bits_in_parts;
use kalmems::config::Experiment;
use kalmems::estimate::Trajectory;
use kalmems::evaluate::Grade;
use kalmems::progress::Silent;
use kalmems::results::Metrics;
use kalmems::rigs::published;
use kalmems::simulate::WhiteNoise;
use kalmems::workflow;
use std::f64::consts::{PI, TAU};
use std::fmt::Write as _;
use std::path::Path;

/// The rates of a state under an input, and what is read of it.
type RateFunction<const N: usize> = Box<dyn Fn(&[f64; N], f64) -> [f64; N]>;
type ReadoutFunction<const N: usize, const M: usize> = Box<dyn Fn(&[f64; N]) -> [f64; M]>;

/// The whole part of a count.
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // counts of a test
pub(super) fn whole(count: f64) -> usize {
    count as usize
}

/// How a drive goes from one sample to the next.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Between {
    Held,
    Straight,
    AsItIs,
    /// The same, and the experiment says that it is a sine.
    AlongItsSine,
}

/// A device, by its text and by functions.
pub(super) struct Device<const N: usize, const M: usize> {
    /// Everything before the recording.
    pub text: String,
    pub states: [&'static str; N],
    pub units: [&'static str; N],
    pub rate: RateFunction<N>,
    pub read: ReadoutFunction<N, M>,
    /// Density of the noise of each state's rate.
    pub noise: [f64; N],
    /// Standard deviation of a sample of each signal.
    pub sample_sd: [f64; M],
    pub start: [f64; N],
    pub start_sd: [f64; N],
    pub drive: Box<dyn Fn(f64) -> f64>,
    /// Whether the device has a drive, and how that goes from each sample to the next.
    pub is_driven: bool,
    pub between: Between,
    pub rate_hz: f64,
    /// Steps of the simulation from one sample to the next.
    pub substeps: usize,
    /// The settling time in s, which is not compared.
    pub skip_s: f64,
}

impl<const N: usize, const M: usize> Device<N, M> {
    /// Writes a recording of so many samples and its reference into a folder.
    pub fn record(&self, folder: &Path, samples: usize, seed: u64) {
        self.record_from(self.start, folder, samples, seed);
    }

    /// The same of a motion that begins elsewhere.
    pub fn record_from(&self, start: [f64; N], folder: &Path, samples: usize, seed: u64) {
        let mut chance = WhiteNoise::new(seed, 5);
        let interval = 1.0 / self.rate_hz;
        let h = interval / self.substeps as f64;
        let mut x = start;
        let mut recording = String::from("time_s,drive_V");
        (0..M).for_each(|k| write!(recording, ",signal{k}_V").unwrap());
        let headers = self.states.iter().zip(self.units);
        let headers =
            headers.map(|(name, unit)| format!("{name}_{}", unit.replace('/', "_per_").replace('^', "")));
        let mut reference = format!("time_s,{}\n", headers.collect::<Vec<_>>().join(","));
        recording.push('\n');
        for sample in 0..samples {
            let time = sample as f64 * interval;
            write!(recording, "{time:e},{:e}", (self.drive)(time)).unwrap();
            for (value, sd) in (self.read)(&x).iter().zip(&self.sample_sd) {
                write!(recording, ",{:e}", value + sd * chance.sample()).unwrap();
            }
            recording.push('\n');
            let states: Vec<String> = x.iter().map(|x| format!("{x:e}")).collect();
            writeln!(reference, "{time:e},{}", states.join(",")).unwrap();
            for step in 0..self.substeps {
                let at = |part: f64| {
                    let part = (step as f64 + part) / self.substeps as f64;
                    match self.between {
                        Between::Held => (self.drive)(time),
                        Between::Straight => {
                            (1.0 - part) * (self.drive)(time) + part * (self.drive)(time + interval)
                        }
                        Between::AsItIs | Between::AlongItsSine => (self.drive)(time + part * interval),
                    }
                };
                x = runge_kutta(&*self.rate, &x, h, [at(0.0), at(0.5), at(1.0)]);
                for (x, density) in x.iter_mut().zip(&self.noise) {
                    *x += (density * h).sqrt() * chance.sample();
                }
            }
        }
        std::fs::write(folder.join("recording.csv"), recording).unwrap();
        std::fs::write(folder.join("reference.csv"), reference).unwrap();
    }

    /// An experiment with an EKF for each of these lines.
    pub fn experiment(&self, folder: &Path, lines: &[&str]) -> Experiment {
        self.experiment_by("ekf", folder, lines)
    }

    /// The same with filters of another method.
    fn experiment_by(&self, method: &str, folder: &Path, lines: &[&str]) -> Experiment {
        let mut channels: Vec<String> = (0..M).map(|k| format!("signal{k} = \"signal{k}_V\"")).collect();
        if self.is_driven {
            channels.push("drive = \"drive_V\"".to_owned());
        }
        let values = |values: &[f64]| {
            let each = self.states.iter().zip(self.units).zip(values);
            let each = each.map(|((name, unit), value)| format!("{name} = \"{value:e} {unit}\""));
            each.collect::<Vec<_>>().join(", ")
        };
        let reference = |(name, unit): (&&str, &str)| {
            format!("{name} = \"{name}_{}\"", unit.replace('/', "_per_").replace('^', ""))
        };
        // A rate of an acceleration has no name in columns, and a phase is known but for turns.
        let has_reference = |(name, unit): &(&&str, &str)| !unit.contains("s^3") && **name != "phi";
        let known = self.states.iter().zip(self.units).filter(has_reference);
        let references: Vec<String> = known.map(reference).collect();
        let mut text = format!(
            "name = \"steps\"\n{}\n[[recording]]\nrole = \"test\"\nfile = \"recording.csv\"\nclock = {{ column = \"time_s\" }}\n\
             channels = {{ {} }}\nreference = {{ file = \"reference.csv\", channels = {{ {} }} }}\n[estimate]\nskip = \"{} s\"\n\
             check_numbers = false\n",
            self.text,
            channels.join(", "),
            references.join(", "),
            self.skip_s,
        );
        for (i, lines) in lines.iter().enumerate() {
            writeln!(
                text,
                "[[estimate.filter]]\nname = \"f{i}\"\nmethod = \"{method}\"\nstart = {{ {} }}\nstart_sd = {{ {} }}\n{lines}",
                values(&self.start),
                values(&self.start_sd),
            )
            .unwrap();
        }
        let parsed = published().parse(&text, &folder.join("experiment.toml"));
        parsed.unwrap_or_else(|error| panic!("{error}\n{text}"))
    }

    /// The worst state's root mean square of mean minus converged mean in claimed standard deviations, and the claims' largest
    /// relative difference, for each number of steps; with what the watch says of the first.
    fn errors(&self, method: &str, samples: usize, steps: &[usize], converged: usize) -> Vec<StepResult> {
        let folder = tempfile::tempdir().unwrap();
        self.record(folder.path(), samples, 1);
        let lines: Vec<String> =
            steps.iter().chain([&converged]).map(|steps| format!("steps = {steps}")).collect();
        let lines: Vec<&str> = lines.iter().map(String::as_str).collect();
        let experiment = self.experiment_by(method, folder.path(), &lines);
        let outcome = workflow::estimate(published(), &experiment, &Silent).unwrap();
        let watched: Vec<Option<f64>> = Metrics::of(&outcome)
            .estimators()
            .map(|one| one.step_errors.as_ref().map(|errors| errors.error))
            .collect();
        let all = &outcome.recordings[0].segments[0].estimate.trajectories;
        let (exact, found) = all.split_last().unwrap();
        assert_eq!(found.len(), steps.len());
        let result = |(one, watched): (&Trajectory, &Option<f64>)| {
            StepResult::between(one, exact, self.skip_s, *watched)
        };
        found.iter().zip(&watched).map(result).collect()
    }
}

/// What a number of steps costs a filter.
#[derive(Debug)]
struct StepResult {
    error: f64,
    claim: f64,
    watched: Option<f64>,
}

impl StepResult {
    fn between(one: &Trajectory, exact: &Trajectory, skip_s: f64, watched: Option<f64>) -> Self {
        let mut result = Self { error: 0.0, claim: 0.0, watched };
        let late = one.time_s.iter().position(|t| *t >= skip_s).unwrap();
        for (a, b) in one.states.iter().zip(&exact.states) {
            let (mut squares, mut count) = (0.0, 0.0);
            for i in (late..a.mean.len()).filter(|i| b.sd[*i] > 0.0) {
                squares += ((a.mean[i] - b.mean[i]) / b.sd[i]).powi(2);
                count += 1.0;
                result.claim = result.claim.max((a.sd[i] / b.sd[i] - 1.0).abs());
            }
            let error = f64::sqrt(squares / count);
            // One that is not a number is the worst.
            result.error = if error <= result.error { result.error } else { error };
        }
        result
    }
}

fn runge_kutta<const N: usize>(
    rate: &dyn Fn(&[f64; N], f64) -> [f64; N],
    x: &[f64; N],
    h: f64,
    [begin, middle, end]: [f64; 3],
) -> [f64; N] {
    let moved = |k: &[f64; N], s: f64| {
        let mut y = *x;
        y.iter_mut().zip(k).for_each(|(y, k)| *y += s * k);
        y
    };
    let k1 = rate(x, begin);
    let k2 = rate(&moved(&k1, h / 2.0), middle);
    let k3 = rate(&moved(&k2, h / 2.0), middle);
    let k4 = rate(&moved(&k3, h), end);
    let mut y = *x;
    for i in 0..N {
        y[i] += h / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]);
    }
    y
}

/// The pumped mirror, of so many samples in a cycle of its motion.
pub(super) fn scanner(per_cycle: f64, density: f64, between: Between) -> Device<2, 1> {
    let interpolation = match between {
        Between::Straight => "linear",
        Between::Held | Between::AsItIs => "quintic",
        Between::AlongItsSine => "sine",
    };
    let text = format!(
        r#"
[device.equations]
states = {{ theta = "rad", omega = "rad/s" }}
inputs = {{ drive = "V" }}
interpolation = "{interpolation}"
let = {{ C = "comb*exp(-(theta/width)^2)" }}
derivative = {{ theta = "omega", omega = "(0.5*d(C, theta)*(drive^2 + mean_square) - b*omega - k*theta)/J" }}
measure = {{ signal0 = "offset + gain*(C + stray) in V" }}
noise = {{ signal0 = "1.92e-4[V^2]", omega = "{density:e}[rad^2/s^3]" }}
[device.equations.parameters]
J = "1.15e-14 kg m^2"
k = "1.1e-4 N m/rad"
b = "5.95e-12 N m s/rad"
comb = "5.71 pF"
stray = "9.79 pF"
width = "0.2 rad"
mean_square = "18 V^2"
gain = "-0.3574 V/pF"
offset = "6.3945 V"
"#
    );
    let narrow = if density < 1e6 { 0.1 } else { 1.0 };
    Device {
        text,
        states: ["theta", "omega"],
        units: ["rad", "rad/s"],
        rate: Box::new(|x, u| {
            let e = (-(x[0] / 0.2).powi(2)).exp();
            let torque = -x[0] * e * 5.71e-12 / 0.04 * (u * u + 18.0);
            [x[1], (torque - 5.95e-12 * x[1] - 1.1e-4 * x[0]) / 1.15e-14]
        }),
        read: Box::new(|x| [6.3945 - 0.3574 * (5.71 * (-(x[0] / 0.2).powi(2)).exp() + 9.79)]),
        noise: [0.0, density],
        sample_sd: [1.92e-4_f64.sqrt()],
        start: [0.144_123_4, 5801.15],
        start_sd: [0.01 * narrow, 1e3 * narrow],
        drive: Box::new(|t| 90.0 + 90.0 * (TAU * 31_350.0 * t).sin()),
        is_driven: true,
        between,
        rate_hz: 15_675.0 * per_cycle,
        substeps: whole(1600.0 / per_cycle),
        skip_s: 15e-3,
    }
}

/// An accelerometer under a bit that keeps it in the middle.
pub(super) fn accelerometer(rate_hz: f64) -> Device<4, 1> {
    let text = r#"
[device.equations]
states = { x = "m", v = "m/s", a = "m/s^2", a_rate = "m/s^3" }
inputs = { drive = "V" }
interpolation = "hold"
[device.equations.let]
near = "(0.1[V] - drive)^2 + 0.18[V^2]"
far = "(0.1[V] + drive)^2 + 0.18[V^2]"
force = "0.5*eps*area*(near/(gap - x)^2 - far/(gap + x)^2)"
film = "0.6*damping + 0.4*damping/(1 - (x/gap)^2)"
[device.equations.derivative]
x = "v"
v = "a + (force - film*v - k*x)/m"
a = "a_rate"
a_rate = "-corner^2*a - 1.44*corner*a_rate"
[device.equations.measure]
signal0 = "0.6[V]*eps*area/feedback*(1/(gap - x) - 1/(gap + x)) in V"
[device.equations.noise]
signal0 = "4.88e-9[V^2]"
v = "4*1.38e-23[J/K]*300[K]*damping/2/m^2"
a_rate = "2.88*corner^3*(9.8[m/s^2])^2"
[device.equations.parameters]
gap = "2.3 um"
eps = "35.4e-12 F/m"
area = "1.86e-6 m^2"
damping = "7e-4 N s/m"
k = "3 N/m"
m = "3.8e-9 kg"
feedback = "20 pF"
corner = "314.1592653589793 rad/s"
"#;
    let corner: f64 = 100.0 * PI;
    Device {
        text: text.to_owned(),
        states: ["x", "v", "a", "a_rate"],
        units: ["m", "m/s", "m/s^2", "m/s^3"],
        rate: Box::new(move |x, u| {
            let (gap, plate) = (2.3e-6, 35.4e-12 * 1.86e-6);
            let (near, far) = ((0.1 - u).powi(2) + 0.18, (0.1 + u).powi(2) + 0.18);
            let force = 0.5 * plate * (near / (gap - x[0]).powi(2) - far / (gap + x[0]).powi(2));
            let film = 7e-4 * (0.6 + 0.4 / (1.0 - (x[0] / gap).powi(2)));
            let push = (force - film * x[1] - 3.0 * x[0]) / 3.8e-9;
            [x[1], x[2] + push, x[3], -corner * corner * x[2] - 1.44 * corner * x[3]]
        }),
        read: Box::new(|x| {
            let gap = 2.3e-6;
            [0.6 * 35.4e-12 * 1.86e-6 / 20e-12 * (1.0 / (gap - x[0]) - 1.0 / (gap + x[0]))]
        }),
        noise: [
            0.0,
            4.0 * 1.38e-23 * 300.0 * 7e-4 / 2.0 / 3.8e-9_f64.powi(2),
            0.0,
            2.88 * corner.powi(3) * 9.8 * 9.8,
        ],
        sample_sd: [4.88e-9_f64.sqrt()],
        start: [0.0, 0.0, 9.8, 0.0],
        start_sd: [1e-8, 1e-5, 9.8, 3140.0],
        drive: Box::new(move |t| {
            let sample = whole(t * rate_hz + 0.5) as u64;
            if sample.wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 63 == 1 { 0.05 } else { -0.05 }
        }),
        is_driven: true,
        between: Between::Held,
        rate_hz,
        substeps: whole(8e6 / rate_hz),
        skip_s: 20e-3,
    }
}

/// A linear stage, its drive linear between the samples.
pub(super) fn stage() -> Device<2, 1> {
    let text = r#"
[device.equations]
states = { x = "m", v = "m/s" }
inputs = { drive = "V" }
interpolation = "linear"
derivative = { x = "v", v = "force*drive - 2*zeta*w*v - w^2*x" }
measure = { signal0 = "gain*v in V" }
noise = { signal0 = "1.6e-6[V^2]", v = "20[m^2/s^3]" }
parameters = { w = "10772.521208637304 rad/s", zeta = "5e-3", force = "3782.5 m/(s^2 V)", gain = "0.01 V s/m" }
"#;
    let w = TAU * 1714.5;
    Device {
        text: text.replace("10772.521208637304", &w.to_string()),
        states: ["x", "v"],
        units: ["m", "m/s"],
        rate: Box::new(move |x, u| [x[1], 3782.5 * u - 0.01 * w * x[1] - w * w * x[0]]),
        read: Box::new(|x| [0.01 * x[1]]),
        noise: [0.0, 20.0],
        sample_sd: [1.6e-6_f64.sqrt()],
        start: [0.0, 0.0],
        start_sd: [5e-5, 1.0],
        drive: Box::new(|t| (TAU * 1711.0 * t).sin()),
        is_driven: true,
        between: Between::Straight,
        rate_hz: 625e3 / 12.0,
        substeps: 32,
        skip_s: 20e-3,
    }
}

/// The stiffening resonator whose resonance is a parameter.
pub(super) fn stiffening_of_known_resonance(rate_hz: f64) -> Device<2, 1> {
    let unknown = stiffening(rate_hz);
    let text = unknown.text.replace(", f0 = \"Hz\" }", " }").replace(", f0 = \"0\" }", " }");
    let text = text
        .replace(", f0 = \"0.1[1/s^3]\"", "")
        .replace("parameters = {", "parameters = { f0 = \"20 kHz\",");
    let rate = unknown.rate;
    Device {
        text,
        states: ["x", "v"],
        units: ["m", "m/s"],
        rate: Box::new(move |x, u| {
            let [v, acceleration, _] = rate(&[x[0], x[1], 20e3], u);
            [v, acceleration]
        }),
        read: Box::new(|x| [1e6 * x[0]]),
        noise: [0.0, 0.2],
        sample_sd: unknown.sample_sd,
        start: [1e-6, 0.0],
        start_sd: [1e-7, 0.01],
        drive: unknown.drive,
        is_driven: true,
        between: Between::Straight,
        rate_hz,
        substeps: unknown.substeps,
        skip_s: unknown.skip_s,
    }
}

/// A stiffening resonator whose resonance is a state.
pub(super) fn stiffening(rate_hz: f64) -> Device<3, 1> {
    let text = r#"
[device.equations]
states = { x = "m", v = "m/s", f0 = "Hz" }
inputs = { drive = "V" }
interpolation = "linear"
derivative = { x = "v", v = "force*drive - (2*pi*f0)^2*x - 2*pi*f0/50*v - cubic*x^3", f0 = "0" }
measure = { signal0 = "gain*x in V" }
noise = { signal0 = "4e-4[V^2]", v = "0.2[m^2/s^3]", f0 = "0.1[1/s^3]" }
parameters = { force = "1000 m/(s^2 V)", cubic = "7.895e20 1/(m^2 s^2)", gain = "1 V/um" }
"#;
    Device {
        text: text.to_owned(),
        states: ["x", "v", "f0"],
        units: ["m", "m/s", "Hz"],
        rate: Box::new(|x, u| {
            let w = TAU * x[2];
            [x[1], 1000.0 * u - w * w * x[0] - w / 50.0 * x[1] - 7.895e20 * x[0].powi(3), 0.0]
        }),
        read: Box::new(|x| [1e6 * x[0]]),
        noise: [0.0, 0.2, 0.1],
        sample_sd: [0.02],
        start: [1e-6, 0.0, 20e3],
        start_sd: [1e-7, 0.01, 20.0],
        drive: Box::new(|t| 0.3 * (TAU * 20.2e3 * t).sin()),
        is_driven: true,
        between: Between::Straight,
        rate_hz,
        substeps: whole(8e6 / rate_hz),
        skip_s: 10e-3,
    }
}

/// The resonance of the ring gyroscope in rad/s.
const RING_W: f64 = 47_123.889_803_846_9;

/// The rates of the two modes of a ring that turns.
fn ring_rates(w: f64, turning: f64, [x, vx, y, vy]: [f64; 4]) -> [f64; 4] {
    let coupling = 1.48 * turning;
    [
        vx,
        -w / 2e5 * vx - w * w * 1.00002 * x + coupling * vy,
        vy,
        -w / 2e5 * vy - w * w * 0.99998 * y - coupling * vx,
    ]
}

/// A ring gyroscope, the turning rate a state.
pub(super) fn ring() -> Device<5, 2> {
    let text = r#"
[device.equations]
states = { Omega = "rad/s", x = "m", vx = "m/s", y = "m", vy = "m/s" }
measure = { signal0 = "gain*x in V", signal1 = "gain*y in V" }
[device.equations.derivative]
Omega = "0"
x = "vx"
vx = "-w/Q*vx - w^2*(1 + split)*x + 4*kappa*Omega*vy"
y = "vy"
vy = "-w/Q*vy - w^2*(1 - split)*y - 4*kappa*Omega*vx"
[device.equations.noise]
signal0 = "4e-6[V^2]"
signal1 = "4e-6[V^2]"
vx = "1e-10[m^2/s^3]"
vy = "1e-10[m^2/s^3]"
Omega = "216[rad^2/s^3]"
[device.equations.parameters]
w = "47123.8898038469 rad/s"
Q = "200000"
split = "2e-5"
kappa = "0.37"
gain = "0.2 V/um"
"#;
    Device {
        text: text.to_owned(),
        states: ["Omega", "x", "vx", "y", "vy"],
        units: ["rad/s", "m", "m/s", "m", "m/s"],
        rate: Box::new(|x, _| {
            let [turning, a, a_rate, b, b_rate] = *x;
            let [a, a_rate, b, b_rate] = ring_rates(RING_W, turning, [a, a_rate, b, b_rate]);
            [0.0, a, a_rate, b, b_rate]
        }),
        read: Box::new(|x| [2e5 * x[1], 2e5 * x[3]]),
        noise: [216.0, 0.0, 1e-10, 0.0, 1e-10],
        sample_sd: [2e-3, 2e-3],
        start: [3.0, 5e-6, 0.0, 0.0, 0.0],
        start_sd: [1.0, 1e-8, 5e-4, 1e-8, 5e-4],
        drive: Box::new(|_| 0.0),
        is_driven: false,
        between: Between::Held,
        rate_hz: 50e3,
        substeps: 64,
        skip_s: 40e-3,
    }
}

/// The ring gyroscope whose resonance is a state too.
fn ring_of_unknown_resonance() -> Device<6, 2> {
    let known = ring();
    let text = known.text.replace("vy = \"m/s\" }", "vy = \"m/s\", w = \"rad/s\" }");
    let text = text.replace("Omega = \"0\"", "Omega = \"0\"\nw = \"0\"");
    let text = text.replace("w = \"47123.8898038469 rad/s\"\n", "");
    let text = text.replace("[device.equations.noise]", "[device.equations.noise]\nw = \"1e-4[rad^2/s^3]\"");
    Device {
        text,
        states: ["Omega", "x", "vx", "y", "vy", "w"],
        units: ["rad/s", "m", "m/s", "m", "m/s", "rad/s"],
        rate: Box::new(|x, _| {
            let [turning, a, a_rate, b, b_rate, w] = *x;
            let [a, a_rate, b, b_rate] = ring_rates(w, turning, [a, a_rate, b, b_rate]);
            [0.0, a, a_rate, b, b_rate, 0.0]
        }),
        read: Box::new(|x| [2e5 * x[1], 2e5 * x[3]]),
        noise: [216.0, 0.0, 1e-10, 0.0, 1e-10, 1e-4],
        sample_sd: known.sample_sd,
        start: [3.0, 5e-6, 0.0, 0.0, 0.0, RING_W],
        start_sd: [1.0, 1e-8, 5e-4, 1e-8, 5e-4, 5.0],
        drive: known.drive,
        is_driven: false,
        between: Between::Held,
        rate_hz: known.rate_hz,
        substeps: known.substeps,
        skip_s: known.skip_s,
    }
}

/// A mirror that heat bends, with two thermal time constants of which nothing is random.
pub(super) fn thermal() -> Device<4, 1> {
    let text = r#"
[device.equations]
states = { angle = "rad", rate = "rad/s", T = "K", F = "K" }
inputs = { drive = "V" }
interpolation = "linear"
measure = { signal0 = "sensitivity*(1 - 2e-3[1/K]*F)*angle + 3e-3[V/K]*F + 0.04[V] in V" }
noise = { signal0 = "2.5e-7[V^2]", rate = "2*4.0453e-21[J]*b/J^2" }
[device.equations.let]
power = "drive^2/(500[ohm] + 1.5[ohm/K]*T)"
to_frame = "1e-4[W/K]*(T - F)"
rest = "2e-3[rad/K]*(T - 0.2*F)"
[device.equations.derivative]
angle = "rate"
rate = "(-b*rate - 3.09e-8[N m]*(angle - rest))/J"
T = "(power - to_frame)/8e-7[J/K]"
F = "(to_frame - 2e-3[W/K]*F)/6e-4[J/K]"
[device.equations.parameters]
J = "3.4e-15 kg m^2"
b = "2.7e-13 N m s"
sensitivity = "2.5 V/rad"
"#;
    Device {
        text: text.to_owned(),
        states: ["angle", "rate", "T", "F"],
        units: ["rad", "rad/s", "K", "K"],
        rate: Box::new(|x, u| {
            let power = u * u / (500.0 + 1.5 * x[2]);
            let to_frame = 1e-4 * (x[2] - x[3]);
            let rest = 2e-3 * (x[2] - 0.2 * x[3]);
            [
                x[1],
                (-2.7e-13 * x[1] - 3.09e-8 * (x[0] - rest)) / 3.4e-15,
                (power - to_frame) / 8e-7,
                (to_frame - 2e-3 * x[3]) / 6e-4,
            ]
        }),
        read: Box::new(|x| [2.5 * (1.0 - 2e-3 * x[3]) * x[0] + 3e-3 * x[3] + 0.04]),
        noise: [0.0, 2.0 * 4.0453e-21 * 2.7e-13 / 3.4e-15_f64.powi(2), 0.0, 0.0],
        sample_sd: [5e-4],
        start: [0.1, 0.0, 50.0, 3.0],
        start_sd: [1e-3, 1.0, 0.1, 0.1],
        drive: Box::new(|t| 2.5 + 1.2 * (TAU * 10.0 * t).sin() + 0.5 * (TAU * 470.0 * t).sin()),
        is_driven: true,
        between: Between::Straight,
        rate_hz: 10e3,
        substeps: 64,
        skip_s: 0.5,
    }
}

/// Holds the errors of these numbers of steps against their limits.
fn within<const N: usize, const M: usize>(
    name: &str,
    device: &Device<N, M>,
    samples: usize,
    limits: &[(usize, f64)],
) -> Vec<StepResult> {
    within_by("ekf", name, device, (samples, limits))
}

/// The same of filters of another method.
fn within_by<const N: usize, const M: usize>(
    method: &str,
    name: &str,
    device: &Device<N, M>,
    (samples, limits): (usize, &[(usize, f64)]),
) -> Vec<StepResult> {
    let steps: Vec<usize> = limits.iter().map(|(steps, _)| *steps).collect();
    let found = device.errors(method, samples, &steps, 32);
    for (one, (steps, _)) in found.iter().zip(limits) {
        println!(
            "{name}, {steps} steps: error {:.2e} sd, claim {:.1e}, watch {:?}",
            one.error, one.claim, one.watched
        );
    }
    for (one, (steps, limit)) in found.iter().zip(limits) {
        assert!(one.error <= *limit, "{name}, {steps} steps: {one:?}, limit {limit}");
    }
    found
}

#[test]
fn the_steps_of_a_scanner_are_off_by_a_small_part_of_its_claim() {
    within("scanner at 20", &scanner(20.0, 1e4, Between::Straight), 12_000, &[(2, 0.011)]);
    within("scanner at 26", &scanner(26.0, 1e4, Between::Straight), 15_000, &[(1, 0.06), (2, 0.005)]);
    within("scanner at 32", &scanner(32.0, 1e4, Between::Straight), 20_000, &[(1, 0.027)]);
    within("scanner at 64", &scanner(64.0, 1e4, Between::Straight), 40_000, &[(1, 0.002)]);
}

/// The stiffness at which the innovations of filters of one step and of 16 are likeliest, as a deviation from the true one in parts, with its
/// standard error.
fn likeliest_stiffness(per_cycle: f64, samples: usize) -> [[f64; 2]; 2] {
    let folder = tempfile::tempdir().unwrap();
    let device = || scanner(per_cycle, 1e4, Between::Straight);
    device().record(folder.path(), samples, 1);
    let log_likelihoods = |deviation: f64| {
        let stiffness = format!("k = \"{:.17e} N m/rad\"", 1.1e-4 * (1.0 + deviation));
        let text = device().text.replace("k = \"1.1e-4 N m/rad\"", &stiffness);
        let experiment = Device { text, ..device() }.experiment(folder.path(), &["steps = 1", "steps = 16"]);
        let outcome = workflow::estimate(published(), &experiment, &Silent).unwrap();
        let of = |filter: usize| -> f64 {
            let trajectory = &outcome.recordings[0].segments[0].estimate.trajectories[filter];
            trajectory.log_likelihood.iter().filter(|value| value.is_finite()).sum()
        };
        [of(0), of(1)]
    };
    let (mut width, mut found) = (1e-5, [[0.0; 2]; 2]);
    for _ in 0..2 {
        let [low, middle, high] = [-width, 0.0, width].map(log_likelihoods);
        found = [0, 1].map(|filter| {
            let curvature = (low[filter] - 2.0 * middle[filter] + high[filter]) / (width * width);
            [(low[filter] - high[filter]) / (2.0 * width * curvature), (-curvature).sqrt().recip()]
        });
        // Nearer to a parabola.
        width = found[1][1];
    }
    found
}

#[test]
fn a_stiffness_by_likelihood_is_that_of_converged_steps() {
    for (per_cycle, samples) in [(26.0, 15_000), (32.0, 20_000), (64.0, 40_000)] {
        let [[one, _], [converged, error]] = likeliest_stiffness(per_cycle, samples);
        println!("{per_cycle}: {:.3} and {:.3} standard errors off", one / error, converged / error);
        assert!((one - converged).abs() < 0.06 * error, "{per_cycle}: {one:e} {converged:e} ± {error:e}");
        assert!(converged.abs() < 4.0 * error, "{per_cycle}: {converged:e} ± {error:e}");
    }
}

/// Within 5 %, small errors and large ones.
#[test]
fn the_watch_tells_how_large_the_error_of_a_step_is() {
    let each = |between| [10.0, 14.0, 20.0, 26.0].map(|per_cycle| (per_cycle, between));
    for (per_cycle, between) in [Between::Straight, Between::AsItIs].map(each).concat() {
        let found = within("scanner", &scanner(per_cycle, 1e4, between), 15_000, &[(1, f64::INFINITY)]);
        let one = &found[0];
        let watched = one.watched.unwrap();
        assert!((watched / one.error - 1.0).abs() < 0.05, "{per_cycle} a cycle: {one:?}");
    }
}

/// Each method against converged steps of its own, within the limits of the EKF.
#[test]
fn other_filters_take_the_same_step() {
    for method in ["square_root_ekf", "iterated_ekf", "ukf", "square_root_ukf"] {
        let of_scanner = &[(1, 0.06), (2, 0.005)];
        within_by(method, "scanner at 26", &scanner(26.0, 1e4, Between::Straight), (15_000, of_scanner));
        within_by(method, "stiffening at 44 kHz", &stiffening(44e3), (4_000, &[(4, 0.01)]));
    }
}

#[test]
fn steps_whose_linear_part_follows_the_state_have_the_same_bits_in_parts() {
    fn check<const N: usize, const M: usize>(device: &Device<N, M>) {
        let folder = tempfile::tempdir().unwrap();
        device.record(folder.path(), 3_000, 3);
        let experiment = device.experiment(folder.path(), &["", "steps = 2"]);
        same_bits_in_parts(&experiment, &recorded(&experiment), &[137, 1_100]);
    }
    check(&stiffening(44e3));
    check(&ring_of_unknown_resonance());
    check(&thermal());
}

#[test]
fn the_step_of_a_linear_device_is_exact() {
    let found = within("stage", &stage(), 5_000, &[(1, 1e-9)]);
    assert_eq!(found[0].watched, None, "{found:?}");
}

#[test]
fn the_step_of_a_stiff_accelerometer_is_off_by_a_small_part_of_its_claim() {
    within("accelerometer at 100 kHz", &accelerometer(100e3), 10_000, &[(1, 5e-4)]);
    within("accelerometer at 20 kHz", &accelerometer(20e3), 4_000, &[(1, 7e-3)]);
}

#[test]
fn the_steps_of_a_resonance_that_is_a_state_are_off_by_a_small_part_of_its_claim() {
    let found = within("stiffening at 44 kHz", &stiffening(44e3), 4_000, &[(4, 0.01)]);
    assert!(found[0].claim < 2e-3, "{found:?}");
    within("ring", &ring(), 6_000, &[(1, 1e-3)]);
    within("ring of unknown resonance", &ring_of_unknown_resonance(), 6_000, &[(4, 0.01)]);
}

#[test]
fn the_step_of_a_mirror_that_heat_bends_is_off_by_a_small_part_of_its_claim() {
    within("thermal", &thermal(), 20_000, &[(1, 0.012)]);
}

#[test]
fn a_true_sine_between_the_samples_is_followed_to_within_the_claim() {
    let mut squares = Vec::new();
    for seed in 0..8 {
        let device = scanner(26.0, 1e4, Between::AsItIs);
        let folder = tempfile::tempdir().unwrap();
        device.record(folder.path(), 20_000, 100 + seed);
        let outcome =
            workflow::estimate(published(), &device.experiment(folder.path(), &[""]), &Silent).unwrap();
        let metrics = Metrics::of(&outcome);
        let one = metrics.estimators().next().unwrap();
        assert!(one.grade.unwrap() <= Grade::PassesWithRemarks, "{:?}", one.grade);
        squares.push(one.values["theta"].claim.unwrap().mean_square);
    }
    let mean = squares.iter().sum::<f64>() / squares.len() as f64;
    println!("{squares:?} {mean}");
    assert!((0.7..1.4).contains(&mean), "{squares:?}");
}
