//! The devices, with filters of them and samples.

use super::host;
use crate::common::{self, Chance};
use kalmems_equations::{
    Device, EmitDigits, EmitGain, EmitMeasure, EmitRequest, EmitWatch, FreeParameter, StateStart, StepMethod,
    TestSample,
};
use std::f64::consts::TAU;

/// How many samples a filter runs over.
pub const SAMPLES: usize = 3000;

/// A comb drive on a spring that stiffens (Duffing), by formulas of the language alone.
const COMB: &str = r#"
[states]
x = "m"
v = "m/s"
[inputs]
V = "V"
[parameters]
m = "1.2e-9 kg"
damping = "2.0e-7 N s/m"
linear = "0.9 N/m"
cubic = "3e9 N/m^3"
slope = "9 pF/mm"
overlap = "20 um"
stage = "1e11 V/F"
[let]
C = "slope*(overlap + x)*(1 + 0.05*tanh(x/10[um]))"
[derivative]
x = "v"
v = "(electrostatic_force(d(C, x), V^2) - viscous_damping(damping, v) - cubic_spring(x, linear, cubic))/m"
[measure]
signal = "stage*C in V"
"#;

/// A tuning fork: two coupled tines, of which one is driven and both are read, one with less gain.
const FORK: &str = r#"
[states]
x_left = "m"
v_left = "m/s"
x_right = "m"
v_right = "m/s"
[inputs]
V = "V"
[parameters]
f = "32768 Hz"
Q = "400"
coupling = "2 %"
drive = "3e3 m/s^2/V"
sense = "2e5 V/m"
[let]
rate = "2*pi*f"
pull = "coupling*rate^2*(x_left - x_right)"
[derivative]
x_left = "v_left"
v_left = "drive*V - rate/Q*v_left - rate^2*x_left - pull"
x_right = "v_right"
v_right = "-rate/Q*v_right - rate^2*x_right + pull"
[measure]
signal = "sense*(x_right - 0.8*x_left) in V"
"#;

/// A plate before a curve that was measured, a stop by a branch, and a disk: what the other devices do not use.
const PLATE: &str = r#"
[states]
z = "m"
v = "m/s"
[inputs]
V = "V"
[parameters]
m = "2e-6 kg"
k = "80 N/m"
b = "2e-4 N s/m"
radius = "1 mm"
gap = "0.3 mm"
stop = "8e3 N/m^2"
excess = "0.1 mm"
[tables]
C = { x = [-0.2, -0.15, -0.1, -0.05, 0.0, 0.05, 0.1, 0.15, 0.2], y = [1.0, 1.12, 1.3, 1.6, 2.0, 2.4, 2.7, 2.88, 3.0], x_unit = "mm", y_unit = "pF", outside = "linear" }
[let]
distance = "gap + z"
beyond = "if(z < excess, 0[m], z - excess)"
[derivative]
z = "v"
v = "(0.5*d(C(z), z)*V^2 - b*v - k*z - stop*beyond^2/1[m]*1[m])/m"
[measure]
disks = "1e11[V/F]*disks(distance, radius) in V"
curve = "1e11[V/F]*C(z)*sqrt(1 + z/gap) + 0.1[V]*ln(1.5 + sin(z/gap)) in V"
[events]
middle = "z - 0.01[mm]"
"#;

/// A pendulum with dry friction and a stop of its own, pulled by a force that was measured over angle and voltage, and read by its coordinates.
const PENDULUM: &str = r#"
[states]
angle = "rad"
rate = "rad/s"
[inputs]
V = "V"
[parameters]
length = "2 mm"
w = "300 rad/s"
b = "40 1/s"
friction = "900 rad/s^2"
drive = "9e3 rad/s^2/V"
[tables.pull]
x = [-1.0, -0.6, -0.3, 0.0, 0.2, 0.5, 1.0]
y = [-2.0, -1.0, -0.3, 0.4, 1.2, 2.0]
z = [
    [-4670.5, -3412.6, -2852.5, -2556.3, -2541.1, -2870.5],
    [-3861.0, -2776.5, -2269.0, -1968.8, -1879.5, -2061.0],
    [-2544.2, -1741.8, -1320.0, -1013.2, -803.5, -744.2],
    [-900.0, -450.0, -135.0, 180.0, 540.0, 900.0],
    [217.1, 427.7, 670.1, 990.7, 1452.8, 2017.1],
    [1676.6, 1574.5, 1722.0, 2049.9, 2645.4, 3476.6],
    [2870.5, 2512.6, 2582.5, 2916.3, 3621.1, 4670.5],
]
x_unit = "rad"
y_unit = "V"
z_unit = "rad/s^2"
outside = "linear"
[let]
x = "length*sin(angle)"
y = "length*cos(angle)"
reach = "if(not (angle < 0.2 or angle < -0.2) and rate < 1e6[rad/s], 0.2[rad], -0.2[rad])"
beyond = "if(angle > 0.2 or not angle > -0.2, 0.3*w^2*(asin(sin(angle)/1.1) - asin(sin(reach)/1.1)), 0)"
[derivative]
angle = "rate"
rate = "drive*V - b*rate - w^2*atan2(x, y) - beyond - pull(angle, V) - friction*tanh(rate/3[rad/s])*sign(hypot(x, y))"
[measure]
signal = "10[V]*(acos(0.8*cos(angle + 1.2)) + atan(angle/2[rad])/3 + 0.2*(angle/0.3 - floor(angle/9[rad] + 0.5))) in V"
"#;

/// A device with a filter and what drives it.
pub struct Case {
    pub name: String,
    pub device: Device,
    pub request: EmitRequest,
    /// The truth at the start; that of the parameters is the device's.
    pub truth: Vec<f64>,
    /// An input at a time.
    pub drive: fn(f64) -> f64,
}

/// A device, how long an interval is, and of each state: truth and mean at the start, standard deviation, origin, typical size.
type Plan<'a> = (&'a str, Device, f64, &'a [[f64; 5]]);

/// Places with a density or a variance each.
type Sizes<'a> = &'a [(usize, f64)];

fn case(
    (name, device, interval_s, states): Plan<'_>,
    (accelerations, measures): (Sizes<'_>, Sizes<'_>),
    free: &[(&str, f64, f64)],
    drive: fn(f64) -> f64,
) -> Case {
    let n = states.len();
    let mut request = EmitRequest {
        linear: Vec::new(),
        name: name.to_owned(),
        heading: vec![format!("Equations `{name}`."), "sha256 of no experiment".to_owned()],
        interval_s,
        parts: 1,
        method: StepMethod::Euler,
        parameters: device.values(),
        adjustable: vec![],
        experiment: 0x1234_abcd,
        states: states.iter().map(|s| StateStart { mean: s[1], origin: s[3], typical: Some(s[4]) }).collect(),
        start_covariance: vec![],
        process_noise: vec![0.0; n * n],
        free: vec![],
        measures: measures
            .iter()
            .map(|(measure, variance)| EmitMeasure { measure: *measure, variance: *variance, range: None })
            .collect(),
        events: vec![],
        courses: vec![],
        gain: EmitGain::Covariance,
        digits: EmitDigits::Single,
        update_every: 1,
        watch: EmitWatch { rejects: true, settling: u32::MAX, ..EmitWatch::COUNTS },
        mirrored: false,
        rehearsal: vec![],
        vectors: None,
    };
    // A density of the rate of a state: q·T on itself, and through the state before it where that is its integral.
    for (state, density) in accelerations {
        let t = interval_s;
        request.process_noise[state * (n + 1)] = density * t;
        if *state > 0 && n == 2 {
            request.process_noise[0] = density * t.powi(3) / 3.0;
            request.process_noise[1] = density * t * t / 2.0;
            request.process_noise[2] = density * t * t / 2.0;
        }
    }
    // The start of a parameter is off by half its standard deviation.
    for (parameter, sd, walk) in free {
        let parameter = device.parameter(parameter).unwrap();
        let start = request.parameters[parameter] + 0.5 * sd;
        request.free.push(FreeParameter { parameter, start, scale: *sd, walk: walk * walk });
    }
    let size = n + free.len();
    request.start_covariance = vec![0.0; size * size];
    let sds = states.iter().map(|state| state[2]).chain(free.iter().map(|(_, sd, _)| *sd));
    for (k, sd) in sds.enumerate() {
        request.start_covariance[k * (size + 1)] = sd * sd;
    }
    let truth = states.iter().map(|s| s[0]).collect();
    Case { name: name.to_owned(), device, request, truth, drive }
}

/// All devices, with parameters as states.
#[allow(clippy::too_many_lines)] // a table
pub fn cases() -> Vec<Case> {
    let example = common::example;
    vec![
        case(
            (
                "shared_scanner",
                example("shared_scanner"),
                1e-6,
                &[[0.1, 0.05, 0.15, 0.0, 0.2], [0.0, 0.0, 15000.0, 0.0, 2e4]],
            ),
            (&[(1, 1e8)], &[(0, 1.92e-4)]),
            &[("k", 1e-6, 1e-11), ("offset", 0.02, 1e-6)],
            |t| 50.0 + 50.0 * (TAU * 31.1e3 * t).sin(),
        ),
        case(
            (
                "low_passed",
                example("shared_scanner_low_passed"),
                1e-6,
                &[
                    [0.1, 0.09, 0.05, 0.0, 0.2],
                    [0.0, 0.0, 8000.0, 0.0, 2e4],
                    [1.3, 1.2, 0.3, 0.0, 2.0],
                    [1.3, 1.2, 0.3, 0.0, 2.0],
                ],
            ),
            (&[(1, 1e8), (2, 1.0), (3, 1.0)], &[(0, 1.92e-4)]),
            &[("k", 1e-6, 1e-11)],
            |t| 50.0 + 50.0 * (TAU * 31.1e3 * t).sin(),
        ),
        case(
            (
                "threshold_scanner",
                example("threshold_scanner"),
                2e-6,
                &[[0.05, 0.045, 0.01, 0.0, 0.1], [0.0, 10.0, 30.0, 0.0, 400.0]],
            ),
            (&[(1, 1e3)], &[(0, 1.89225e-3), (1, 1e-34)]),
            &[("natural_frequency", 2.0, 1e-5), ("gain", 2e-5, 1e-10)],
            |t| if (TAU * 1250.0 * t).sin() > 0.0 { 60.0 } else { 0.0 },
        ),
        case(
            (
                "micro_stage",
                example("micro_stage"),
                1e-6,
                &[[0.006, 0.0055, 0.001, 0.0, 0.006], [0.0, 2.0, 10.0, 0.0, 60.0]],
            ),
            (&[(1, 1e2)], &[(0, 1.6e-11), (1, 1.6e-11), (2, 1.6e-11), (3, 1.6e-11)]),
            &[("natural_frequency", 0.5, 1e-6)],
            |t| 2.0 * (TAU * 1714.5 * t).cos(),
        ),
        case(
            (
                "piston_mirror",
                example("piston_mirror"),
                5e-5,
                &[
                    [2e-4, 1.9e-4, 2e-5, 1.9e-4, 1e-5],
                    [501.0, 500.0, 2.0, 500.0, 2.0],
                    [0.3, 0.0, 0.5, 0.0, 1.0],
                    [1.001e-3, 1e-3, 2e-6, 1e-3, 1e-6],
                    [1e-6, 0.0, 1e-5, 0.0, 1e-5],
                ],
            ),
            (&[(1, 1e-3), (3, 1e-16), (4, 1e-12)], &[(0, 2.28e-34)]),
            &[("C_fixed", 1e-16, 1e-22)],
            |_| 0.0,
        ),
        case(
            (
                "accelerometer",
                example("accelerometer"),
                1e-6,
                &[
                    [0.0, 1e-9, 1e-8, 0.0, 1e-8],
                    [0.0, 0.0, 1e-4, 0.0, 1e-4],
                    [5.0, 0.0, 9.8, 0.0, 10.0],
                    [500.0, 0.0, 3000.0, 0.0, 3000.0],
                ],
            ),
            (&[(3, 8.6e9)], &[(0, 4.88e-9)]),
            &[("spring", 0.03, 1e-7)],
            |t| 0.05 * (TAU * 900.0 * t).sin(),
        ),
        case(
            (
                "two_axes",
                example("two_axes"),
                1e-6,
                &[
                    [0.1, 0.09, 0.03, 0.0, 0.2],
                    [0.0, 0.0, 4000.0, 0.0, 2e4],
                    [0.05, 0.06, 0.03, 0.0, 0.1],
                    [1000.0, 0.0, 2000.0, 0.0, 5e3],
                ],
            ),
            (&[(1, 1e8), (3, 1e7)], &[(0, 1.92e-4)]),
            &[("k_x", 1e-6, 1e-11), ("k_y", 1e-6, 1e-11)],
            |t| 50.0 + 50.0 * (TAU * 31.1e3 * t).sin(),
        ),
        case(
            (
                "comb_resonator",
                common::device(COMB),
                1e-6,
                &[[2e-6, 1e-6, 3e-6, 0.0, 5e-6], [0.0, 0.0, 0.05, 0.0, 0.1]],
            ),
            (&[(1, 1e-4)], &[(0, 1e-8)]),
            &[("linear", 0.01, 1e-7), ("cubic", 1e8, 1e3)],
            |t| 30.0 + 10.0 * (TAU * 4400.0 * t).sin(),
        ),
        case(
            (
                "tuning_fork",
                common::device(FORK),
                2e-7,
                &[
                    [1e-7, 0.0, 2e-7, 0.0, 1e-6],
                    [0.0, 0.0, 0.05, 0.0, 0.2],
                    [-1e-7, 0.0, 2e-7, 0.0, 1e-6],
                    [0.0, 0.0, 0.05, 0.0, 0.2],
                ],
            ),
            (&[(1, 1e-2), (3, 1e-2)], &[(0, 1e-6)]),
            &[("f", 20.0, 1e-4)],
            |t| (TAU * 33100.0 * t).sin(),
        ),
        case(
            (
                "plate",
                common::device(PLATE),
                2e-5,
                &[[1e-4, 0.8e-4, 3e-5, 0.0, 1e-4], [0.0, 0.0, 0.1, 0.0, 0.5]],
            ),
            (&[(1, 1e-3)], &[(0, 1e-6), (1, 1e-6)]),
            &[("k", 0.5, 1e-6)],
            |t| 40.0 * (TAU * 900.0 * t).sin(),
        ),
        case(
            (
                "pendulum",
                common::device(PENDULUM),
                1e-4,
                &[[0.5, 0.48, 0.02, 0.0, 0.6], [0.0, 0.0, 5.0, 0.0, 200.0]],
            ),
            (&[(1, 1.0)], &[(0, 1e-4)]),
            &[("w", 1.0, 1e-3)],
            |t| (TAU * 47.0 * t).sin(),
        ),
    ]
}

impl Case {
    /// The same with another method, and without parameters as states where they are not wanted.
    pub fn variant(&self, method: StepMethod, with_free: bool) -> EmitRequest {
        let mut request = self.request.clone();
        request.method = method;
        let of = if method == StepMethod::Euler { "euler" } else { "rk4" };
        let free = if with_free { "_free" } else { "" };
        request.name = format!("{}_{of}{free}", self.name);
        if !with_free {
            request.free.clear();
            let (size, states) = (self.request.states.len() + self.request.free.len(), request.states.len());
            let rows = self.request.start_covariance.chunks(size).take(states);
            request.start_covariance = rows.flat_map(|row| row[..states].to_vec()).collect();
        }
        request
    }

    /// Samples of the device that moves by Runge and Kutta's method, with the noise of the measurements, as numbers of 32 bits; and the
    /// states that the library's filter in 64 bits makes of them, with their standard deviations.
    pub fn samples(&self, request: &EmitRequest, seed: u64) -> (Vec<TestSample>, Vec<Vec<f64>>) {
        let mut chance = Chance::new(seed);
        let motion = self.device.motion(&[]).unwrap();
        let mut work = motion.work(&request.parameters);
        let periods = self.device.periods(&request.parameters).unwrap();
        let mut readouts: Vec<_> = request
            .measures
            .iter()
            .map(|measure| {
                let readout = self.device.readout(measure.measure, &[]).unwrap();
                let work = readout.work(&request.parameters);
                (readout, work, measure.variance.sqrt())
            })
            .collect();
        let mut x = self.truth.clone();
        let mut samples = Vec::new();
        for k in 0..SAMPLES {
            let at = |part: f64| {
                let inputs = self.device.inputs().iter();
                inputs
                    .map(|_| rounded((self.drive)((k as f64 + part) * request.interval_s)))
                    .collect::<Vec<f64>>()
            };
            let inputs = [at(0.0), at(0.5), at(1.0)];
            x = host::moved(&motion, &mut work, (&x, &inputs), (StepMethod::RungeKutta, request.interval_s))
                .0;
            for (state, period) in &periods {
                x[*state] = host::wrapped(x[*state], *period);
            }
            let measured = readouts.iter_mut().map(|(readout, work, sd)| {
                rounded(readout.read(work, &x, &inputs[2]) + *sd * normal(&mut chance))
            });
            let measured: Vec<f64> = measured.collect();
            assert!(
                measured.iter().all(|y| y.is_finite()),
                "{}, sample {k}: {measured:?} at {x:?}",
                request.name
            );
            samples.push(TestSample {
                inputs,
                measured,
                events: vec![None; request.events.len()],
                expected: vec![],
                expected_sd: vec![],
            });
        }
        let states = host::states(&self.device, request, &samples);
        let mut deviations = Vec::new();
        for (sample, [mean, sd]) in samples.iter_mut().zip(states) {
            sample.expected = mean;
            deviations.push(sd);
        }
        (samples, deviations)
    }
}

/// As a number of 32 bits.
#[allow(clippy::cast_possible_truncation)] // what is wanted
fn rounded(value: f64) -> f64 {
    f64::from(value as f32)
}

/// A number of the standard normal distribution (Box and Muller).
fn normal(chance: &mut Chance) -> f64 {
    let (u, v) = (chance.between(0.0, 1.0), chance.between(0.0, 1.0));
    (-2.0 * (1.0 - u).ln()).sqrt() * (TAU * v).cos()
}
