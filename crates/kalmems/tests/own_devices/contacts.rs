//! A switch that pulls in, hits its contact and bounces: kinks and jumps of a force are passed at their own times.
//!
//! Recordings are simulated here, in a thousand classical Runge–Kutta steps of a sample: one that leads across a force that jumps is off by the jump
//! times its length, which fifty of a sample make more than a filter claims.

use crate::events::recorded;
use crate::parts::same_bits_in_parts;
use kalmems::config::Experiment;
use kalmems::diagnose::step_cost;
use kalmems::progress::Silent;
use kalmems::results::Metrics;
use kalmems::rigs::published;
use kalmems::simulate::WhiteNoise;
use kalmems::workflow;
use std::fmt::Write as _;
use std::path::Path;

/// A contact with a spring and a damping that begins at once.
#[derive(Clone, Copy)]
struct Contact {
    damping: f64,
    spring: ContactSpring,
}

/// The force of a contact over its depth.
#[derive(Clone, Copy)]
enum ContactSpring {
    /// 8000 N/m.
    Linear,
    /// Two spheres after Hertz, 8e7 N/m^1.5: as much at 10 nm.
    Hertzian,
}

impl ContactSpring {
    fn force(self, depth: f64) -> f64 {
        match self {
            Self::Linear => 8000.0 * depth,
            Self::Hertzian => 8e7 * depth * depth.sqrt(),
        }
    }

    fn text(self) -> &'static str {
        match self {
            Self::Linear => "8000[N/m]*(x - gc)",
            Self::Hertzian => "8e7[N/m^1.5]*(x - gc)^1.5",
        }
    }
}

const MASS: f64 = 2e-10;
const W: f64 = 251_327.412;
const STOP: f64 = 1.2e-6;
const EPS_AREA: f64 = 8.854e-12 * 2e-8;
const INTERVAL_S: f64 = 5e-7;
const SUBSTEPS: usize = 1000;
const SAMPLE_SD: f64 = 3e-16;
const DENSITY: f64 = 1e-3;

impl Contact {
    /// The rate of the speed.
    fn rate(self, [x, v]: [f64; 2], volts: f64) -> f64 {
        let depth = x - STOP;
        let force = if depth > 0.0 { self.spring.force(depth) + self.damping * v } else { 0.0 };
        let gap = 2e-6 - x;
        -W / 3.0 * v - W * W * x + EPS_AREA * volts * volts / (2.0 * MASS * gap * gap) - force / MASS
    }

    /// One step of length h in s.
    fn step(self, x: [f64; 2], volts: f64, h: f64) -> [f64; 2] {
        let stage = |k: [f64; 2], h: f64| {
            let at = [x[0] + h * k[0], x[1] + h * k[1]];
            [at[1], self.rate(at, volts)]
        };
        let k1 = stage([0.0; 2], 0.0);
        let k2 = stage(k1, 0.5 * h);
        let k3 = stage(k2, 0.5 * h);
        let k4 = stage(k3, h);
        [0, 1].map(|i| x[i] + h / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]))
    }

    /// A text with filters, each of a method, that begin at rest.
    fn experiment(self, folder: &Path, methods: &[&str]) -> Experiment {
        self.experiment_from("start = {}", folder, methods)
    }

    /// The same that begin elsewhere.
    fn experiment_from(self, start: &str, folder: &Path, methods: &[&str]) -> Experiment {
        let mut text = format!(
            r#"
name = "contact"
[device.equations]
states = {{ x = "m", v = "m/s" }}
inputs = {{ drive = "V" }}
interpolation = "hold"
let = {{ contact = "if(x > gc, {} + bc*v, 0[N])" }}
derivative = {{ x = "v", v = "-w/Q*v - w^2*x + eps*A*drive^2/(2*m*(g - x)^2) - contact/m" }}
measure = {{ cap = "eps*A/(g - x) in F" }}
noise = {{ cap = "9e-32[F^2]", v = "1e-3[m^2/s^3]" }}
parameters = {{ m = "2e-10 kg", w = "251327.412 rad/s", Q = "3", g = "2 um", A = "2e-8 m^2", eps = "8.854e-12 F/m", bc = "{:e} N s/m", gc = "1.2 um" }}
[[recording]]
role = "test"
file = "recording.csv"
clock = {{ column = "time_s" }}
channels = {{ drive = "drive_V", cap = "cap_fF" }}
reference = {{ file = "reference.csv", channels = {{ x = "x_m", v = "v_m_per_s" }} }}
[estimate]
skip = "20 us"
check_numbers = false
"#,
            self.spring.text(),
            self.damping
        );
        for method in methods {
            write!(
                text,
                "[[estimate.filter]]\nname = \"{method}\"\nmethod = \"{method}\"\n{start}\nstart_sd = {{ x = \"1 nm\", v = \"1 mm/s\" }}\n"
            )
            .unwrap();
        }
        published().parse(&text, &folder.join("experiment.toml")).unwrap_or_else(|why| panic!("{why}"))
    }

    /// Writes a recording with its reference.
    fn record(self, folder: &Path, samples: usize, seed: u64) {
        self.record_from([0.0; 2], folder, samples, seed);
    }

    /// The same of a motion that begins elsewhere.
    fn record_from(self, start: [f64; 2], folder: &Path, samples: usize, seed: u64) {
        let (mut of_rate, mut of_sample) = (WhiteNoise::new(seed, 1), WhiteNoise::new(seed, 2));
        let mut recording = String::from("time_s,drive_V,cap_fF\n");
        let mut reference = String::from("time_s,x_m,v_m_per_s\n");
        let mut x = start;
        let h = INTERVAL_S / SUBSTEPS as f64;
        for sample in 0..samples {
            let (time_s, volts) = (sample as f64 * INTERVAL_S, volts(sample));
            let signal = EPS_AREA / (2e-6 - x[0]) + SAMPLE_SD * of_sample.sample();
            writeln!(recording, "{time_s:.7},{volts},{:e}", signal * 1e15).unwrap();
            writeln!(reference, "{time_s:.7},{:e},{:e}", x[0], x[1]).unwrap();
            for _ in 0..SUBSTEPS {
                x = self.step(x, volts, h);
                x[1] += (DENSITY * h).sqrt() * of_rate.sample();
            }
        }
        std::fs::write(folder.join("recording.csv"), recording).unwrap();
        std::fs::write(folder.join("reference.csv"), reference).unwrap();
    }
}

/// 22 V for every other millisecond.
fn volts(sample: usize) -> f64 {
    if sample % 4000 < 2000 { 22.0 } else { 0.0 }
}

/// What the errors of filters of a contact are against their claims, and their mean NIS, over some seeds; the watch on their steps is within its
/// limit.
fn is_consistent(contact: Contact, methods: &[&str], largest_step_error: f64) {
    let mut found_of = vec![(Vec::new(), 0.0); methods.len()];
    for seed in 20..24 {
        let folder = tempfile::tempdir().unwrap();
        contact.record(folder.path(), 6000, seed);
        let experiment = contact.experiment(folder.path(), methods);
        let metrics = Metrics::of(&workflow::estimate(published(), &experiment, &Silent).unwrap());
        for (place, found) in metrics.estimators().enumerate() {
            let steps = found.step_errors.as_ref().unwrap();
            println!("{}: watch {:.4}, {} unresolved", found.key, steps.error, found.counts.unresolved_kinks);
            assert!(steps.error < largest_step_error, "{}: {steps:?}", found.key);
            assert_eq!(steps.steps_per_sample, None);
            let (squares, nis) = &mut found_of[place];
            squares.extend(found.values.values().filter_map(|of| Some(of.claim?.mean_square)));
            *nis += found.consistency.as_ref().unwrap().mean_nis / 4.0;
        }
    }
    for (squares, nis) in found_of {
        let mean = squares.iter().sum::<f64>() / squares.len() as f64;
        println!("mean square {mean:.3} of {squares:?}, mean NIS {nis:.4}");
        assert!((0.8..1.3).contains(&mean) && (0.97..1.03).contains(&nis), "{mean} {nis} {squares:?}");
    }
}

#[test]
fn a_contact_whose_force_jumps_is_passed_at_its_own_time() {
    is_consistent(Contact { damping: 2e-4, spring: ContactSpring::Linear }, &["ekf", "ukf"], 0.05);
}

/// It bounces 33 times each time it is pulled in, for a sample or two each. Behind each bounce place and speed together are known a hundred times better
/// than the speed alone, and the next bounces turn the one into the other.
#[test]
fn a_contact_that_damps_nothing_bounces_as_its_filter_claims() {
    is_consistent(Contact { damping: 0.0, spring: ContactSpring::Linear }, &["ekf"], 0.05);
}

/// Its force has no slope at first and an infinite curvature: some samples need more than 64 steps, and the watch says so.
#[test]
fn a_contact_of_two_spheres_is_followed_as_its_filter_claims() {
    for damping in [2e-4, 0.0] {
        is_consistent(Contact { damping, spring: ContactSpring::Hertzian }, &["ekf"], 0.2);
    }
}

/// Steps through kinks are planned from the state, wherever a part of the recording begins.
#[test]
fn a_contact_is_the_same_in_parts() {
    let (contact, folder) =
        (Contact { damping: 2e-4, spring: ContactSpring::Linear }, tempfile::tempdir().unwrap());
    contact.record(folder.path(), 3000, 20);
    let experiment = contact.experiment(folder.path(), &["ekf"]);
    same_bits_in_parts(&experiment, &recorded(&experiment), &[137, 2100]);
}

#[test]
fn what_steps_through_kinks_cost_is_stated_without_a_number_of_steps() {
    let (contact, folder) =
        (Contact { damping: 2e-4, spring: ContactSpring::Linear }, tempfile::tempdir().unwrap());
    contact.record(folder.path(), 3000, 20);
    let topic = step_cost(published(), &contact.experiment(folder.path(), &["ekf"]), &Silent).unwrap();
    let fact = &topic.facts[0];
    println!("{}", fact.text);
    assert!(fact.text.contains("up to 64 steps") && !fact.text.contains("`steps`"), "{fact:?}");
    assert!(matches!(fact.values[..], [error] if error < 0.05), "{fact:?}");
}

/// A contact that is pressed is a spring of 1 MHz, sampled at 2 MHz: from sample to sample half a cycle turns the noise that has entered. The claims of a filter that rests on it are those of a Kalman filter of the same spring, with its own exact noise.
#[test]
fn the_noise_of_a_motion_that_rests_on_a_contact_is_that_of_the_contact() {
    for damping in [0.0, 2e-4] {
        let contact = Contact { damping, spring: ContactSpring::Linear };
        let folder = tempfile::tempdir().unwrap();
        // Where pull and springs are in balance under 22 V.
        let mut depth = 0.0;
        for _ in 0..100 {
            let gap = 2e-6 - STOP - depth;
            depth = (EPS_AREA * 484.0 / (2.0 * gap * gap) - MASS * W * W * (STOP + depth)) / 8000.0;
        }
        let rests = [STOP + depth, 0.0];
        contact.record_from(rests, folder.path(), 2000, 7);
        let start = format!("start = {{ x = \"{:e} m\" }}", rests[0]);
        let experiment = contact.experiment_from(&start, folder.path(), &["ekf"]);
        let outcome = workflow::estimate(published(), &experiment, &Silent).unwrap();
        let found = &outcome.recordings[0].segments[0].estimate.trajectories[0];
        let gap = 2e-6 - rests[0];
        let stiffness = W * W + 8000.0 / MASS - EPS_AREA * 484.0 / (MASS * gap.powi(3));
        let expected = settled_sd(stiffness, W / 3.0 + damping / MASS, EPS_AREA / (gap * gap));
        let last = found.time_s.len() - 1;
        let claimed = [found.states[0].sd[last], found.states[1].sd[last]];
        println!("{damping}: {claimed:?} {expected:?}, {} unresolved", found.counts.unresolved_kinks);
        let apart =
            claimed.iter().zip(expected).map(|(claim, sd)| (claim / sd - 1.0).abs()).fold(0.0, f64::max);
        assert!(apart < 0.02, "{damping}: {claimed:?} {expected:?}");
        assert_eq!(found.counts.unresolved_kinks, 0);
    }
}

/// The standard deviations in which a Kalman filter of a damped spring settles: transition and noise by 2¹⁴ short steps of a sample.
fn settled_sd(stiffness: f64, damping: f64, slope: f64) -> [f64; 2] {
    const SHORT: u32 = 1 << 14;
    let h = INTERVAL_S / f64::from(SHORT);
    // One short step to second order.
    let a = [[0.0, 1.0], [-stiffness, -damping]];
    let product = |a: [[f64; 2]; 2], b: [[f64; 2]; 2]| {
        [0, 1].map(|i| [0, 1].map(|j| a[i][0] * b[0][j] + a[i][1] * b[1][j]))
    };
    let squared = product(a, a);
    let one = [0, 1]
        .map(|i| [0, 1].map(|j| f64::from(u8::from(i == j)) + h * a[i][j] + 0.5 * h * h * squared[i][j]));
    let moved = |f: [[f64; 2]; 2], p: [[f64; 2]; 2]| {
        let transposed = [0, 1].map(|i| [0, 1].map(|j| f[j][i]));
        product(product(f, p), transposed)
    };
    let (mut f, mut q) = ([[1.0, 0.0], [0.0, 1.0]], [[0.0; 2]; 2]);
    for _ in 0..SHORT {
        (f, q) = (product(one, f), moved(one, q));
        q[1][1] += DENSITY * h;
    }
    let mut p = [[1e-18, 0.0], [0.0, 1e-6]];
    for _ in 0..10_000 {
        p = moved(f, p);
        for (row, noise) in p.iter_mut().zip(q) {
            row.iter_mut().zip(noise).for_each(|(entry, noise)| *entry += noise);
        }
        let variance = slope * slope * p[0][0] + SAMPLE_SD * SAMPLE_SD;
        let gain = [0, 1].map(|i| p[i][0] * slope / variance);
        p = [0, 1].map(|i| [0, 1].map(|j| p[i][j] - gain[i] * variance * gain[j]));
    }
    [p[0][0].sqrt(), p[1][1].sqrt()]
}
