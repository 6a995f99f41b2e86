//! Gaps, gains and the vibrometer's delay of the micro-stage, from three training records.

use super::chance::Chance;
use super::harm::{Harm, error, named, ratio};
use super::rows::Rows;
use kalmems::config::Experiment;
use kalmems::diagnose::identify;
use kalmems::progress::Silent;
use kalmems::rigs::published;
use std::f64::consts::TAU;
use std::fmt::Write as _;
use std::fs;
use std::path::Path;

const NAMES: [&str; 4] = ["1A", "1B", "2A", "2B"];
/// Inner and outer end of each electrode in m, from the axis.
const ENDS: [[f64; 2]; 4] = [[-1.39e-3, -0.99e-3], [475e-6, 795e-6], [0.99e-3, 1.39e-3], [-795e-6, -475e-6]];
const GAPS: [f64; 4] = [19.23e-6, 19.18e-6, 19.15e-6, 19.21e-6];
const GAINS: [f64; 4] = [-2.431e7, -2.377e7, -2.399e7, -2.452e7];
const DELAY_S: f64 = 6.87e-6;
pub const HZ: f64 = 1700.0;
/// ω_n, 2ζω_n and the drive's gain of the stage.
const NATURAL: f64 = TAU * 1714.5;
const DAMPING: f64 = 0.01 * TAU * 1714.5;
const DRIVE: f64 = 3782.5;
const INTERVAL: f64 = 1.6e-6;

/// Places and weights of Gauss and Legendre's formula with five points.
const POINTS: [(f64, f64); 5] = [
    (0.0, 0.568_888_888_888_888_9),
    (0.538_469_310_105_683, 0.478_628_670_499_366_5),
    (-0.538_469_310_105_683, 0.478_628_670_499_366_5),
    (0.906_179_845_938_664, 0.236_926_885_056_189_1),
    (-0.906_179_845_938_664, 0.236_926_885_056_189_1),
];

/// dC/dθ = ε·b·(1 + t²)·∫ w/(D − w·t)² dw over the electrode, by Gauss and Legendre's formula on four parts: the closed form loses all digits
/// near t = 0.
fn slope(electrode: usize, angle: f64) -> f64 {
    let (gap, [from, to]) = (GAPS[electrode], ENDS[electrode]);
    let t = angle.tan();
    let half = (to - from) / 8.0;
    let part = |k: f64| -> f64 {
        let middle = from + half * (2.0 * k + 1.0);
        POINTS
            .iter()
            .map(|(x, weight)| {
                let w = middle + half * x;
                half * weight * w / ((gap - w * t) * (gap - w * t))
            })
            .sum()
    };
    let integral: f64 = [0.0, 1.0, 2.0, 3.0].into_iter().map(part).sum();
    8.8542e-12 * 0.4e-3 * (1.0 + t * t) * integral
}

/// The answer of the angle to a drive of 1 V, a sine: real and imaginary part by sine and cosine.
pub fn response() -> [f64; 2] {
    let w = TAU * HZ;
    let (a, b) = (NATURAL * NATURAL - w * w, DAMPING * w);
    let size = a * a + b * b;
    [DRIVE * a / size, -DRIVE * b / size]
}

/// Records of these drives in V with so many samples each, and of the noise alone.
pub fn write(chance: &mut Chance, (drives, samples): (&[f64], u32), noise_v: f64, folder: &Path) {
    let mut on = "record,time_s,drive_V,c1A_V,c1B_V,c2A_V,c2B_V,ldv_V\n".to_owned();
    let mut off = "record,time_s,drive_V,c1A_V,c1B_V,c2A_V,c2B_V\n".to_owned();
    let w = TAU * HZ;
    let [re, im] = response();
    for (record, volts) in drives.iter().enumerate() {
        for k in 0..samples {
            let time = f64::from(k) * INTERVAL;
            let motion = |time: f64| {
                let (sine, cosine) = (w * time).sin_cos();
                [volts * (re * sine + im * cosine), volts * w * (re * cosine - im * sine)]
            };
            let (sine, cosine) = (w * time).sin_cos();
            let through = |electrode: f64| volts * (2e-4 * (1.0 + 0.2 * electrode) * sine + 4e-4 * cosine);
            let shown = volts * sine;
            write!(on, "r{record},{time:.7},{:.6}", shown + 3e-4 * chance.normal()).unwrap();
            write!(off, "r{record},{time:.7},{:.6}", shown + 3e-4 * chance.normal()).unwrap();
            let [angle, rate] = motion(time);
            for (electrode, gain) in GAINS.iter().enumerate() {
                let signal = gain * slope(electrode, angle) * rate;
                write!(on, ",{:e}", signal + through(electrode as f64) + noise_v * chance.normal()).unwrap();
                write!(off, ",{:e}", through(electrode as f64) + noise_v * chance.normal()).unwrap();
            }
            let velocity = motion(time - DELAY_S)[1] * 50.0 * 1.5e-3 + 0.0123 + 2e-4 * chance.normal();
            writeln!(on, ",{velocity:.6}").unwrap();
            off.push('\n');
        }
    }
    let mut still = "time_s,c1A_V,c1B_V,c2A_V,c2B_V\n".to_owned();
    for k in 0..2000 {
        write!(still, "{:.7}", f64::from(k) * INTERVAL).unwrap();
        (0..4).for_each(|_| write!(still, ",{:e}", noise_v * chance.normal()).unwrap());
        still.push('\n');
    }
    fs::write(folder.join("on.csv"), on).unwrap();
    fs::write(folder.join("off.csv"), off).unwrap();
    fs::write(folder.join("still.csv"), still).unwrap();
}

/// What a laboratory is told of the stage: each gap and gain as so many times what it is, with an uncertainty that stands behind the gain, and
/// whether a vibrometer stands beside the records.
pub struct Told<'a> {
    pub gaps: [f64; 4],
    pub gains: [f64; 4],
    pub of_gains: &'a str,
    /// The table `[identify]`.
    pub identify: &'a str,
    pub has_vibrometer: bool,
}

pub fn told(folder: &Path, Told { gaps, gains, of_gains, identify, has_vibrometer }: &Told) -> Experiment {
    let mut text = format!(
        r#"
name = "stage"
[device.micro_stage.resonator]
natural_frequency = "1714.5 Hz"
damping_ratio = "0.5 %"
drive_gain = "3782.5 rad/s^2/V"
[device.micro_stage.vibrometer]
gain = "50 V/(m/s)"
target_width = "3 mm"
[identify]
{identify}
[estimate]
skip = "0.3 ms"
process_noise = {{ angular_acceleration = "20 rad^2/s^3" }}
[[estimate.filter]]
name = "EKF"
method = "ekf"
start = "from_signal"
start_sd = {{ angle = "50 urad", rate = "1 rad/s" }}
"#
    );
    for (place, name) in NAMES.into_iter().enumerate() {
        let [from, to] = ENDS[place];
        let (gap, gain) = (GAPS[place] * gaps[place], GAINS[place] * gains[place]);
        write!(
            text,
            "[device.micro_stage.electrodes.{name}]\nw1 = \"{from:e} m\"\nw2 = \"{to:e} m\"\nw3 = \"-0.2 mm\"\nw4 = \"0.2 mm\"\n\
             gap = \"{gap:e} m\"\ngain = \"{gain:e} V ohm{of_gains}\"\nnoise_variance = \"1.6e-11 V^2\"\n"
        )
        .unwrap();
    }
    let channels = "drive = \"drive_V\", signal_1A = \"c1A_V\", signal_1B = \"c1B_V\", signal_2A = \"c2A_V\", signal_2B = \"c2B_V\"";
    for (role, file, reference) in [("bias_on", "on.csv", *has_vibrometer), ("bias_off", "off.csv", false)] {
        write!(
            text,
            "[[recording]]\nname = \"{role}\"\nrole = \"{role}\"\nfile = \"{file}\"\nsegments = {{ column = \"record\" }}\n\
             clock = {{ column = \"time_s\" }}\nchannels = {{ {channels} }}\n{}",
            if reference { "reference = { channels = { edge_velocity = \"ldv_V\" }, delay = \"6.9 us\" }\n" } else { "" }
        )
        .unwrap();
    }
    text += "[[recording]]\nname = \"still\"\nrole = \"zero_drive\"\nfile = \"still.csv\"\nclock = { column = \"time_s\" }\n\
             channels = { bias_on_1A = \"c1A_V\", bias_on_1B = \"c1B_V\", bias_on_2A = \"c2A_V\", bias_on_2B = \"c2B_V\" }\n";
    published().parse(&text, &folder.join("experiment.toml")).unwrap_or_else(|e| panic!("{e}"))
}

/// Error of the rate after over that before, of a record that is not trained with.
fn identified(
    words: &str,
    runs: u64,
    (training, noise_v, most_wrong): (usize, f64, f64),
    rows: &mut Rows,
) -> Vec<f64> {
    let drives = [1.0, 1.3, 1.15, 1.2];
    let names: Vec<String> =
        (0..=3).filter(|k| *k != 2).take(training).map(|k| format!("\"r{k}\"")).collect();
    rows.of_recordings(0..runs, |seed, folder, rows| {
        let mut chance = Chance::new(13_000 + seed);
        write(&mut chance, (&drives, 1200), noise_v, folder);
        let gaps = [0; 4].map(|_| chance.between(-0.3 * most_wrong, 0.3 * most_wrong).exp());
        let gains = [0; 4].map(|_| chance.between(-most_wrong, most_wrong).exp());
        let table = format!("training = [{}]", names.join(", "));
        let told = Told { gaps, gains, of_gains: "", identify: &table, has_vibrometer: true };
        let told = self::told(folder, &told);
        let before = error(&told, "rate");
        let found = match identify(published(), &told, &Silent) {
            Ok(found) => found,
            Err(refused) => {
                println!("{words}, seed {seed}: refused: {refused}");
                return 1.0;
            }
        };
        for (place, name) in NAMES.into_iter().enumerate() {
            let numbers =
                [(format!("gap D_n of {name}"), GAPS[place]), (format!("gain eta of {name}"), GAINS[place])];
            for (name, truth) in numbers {
                rows.push(&format!("{words}, {name}"), truth, named(&found, &name));
            }
        }
        rows.push(&format!("{words}, delay"), DELAY_S, named(&found, "delay of the vibrometer"));
        ratio(error(&found.experiment, "rate"), before)
    })
}

const USUAL: (usize, f64, f64) = (3, 4e-6, 0.1);

#[test]
fn a_few_stages() {
    let (mut rows, mut harm) = (Rows::default(), Harm::default());
    harm.take("stage", identified("stage", 1, USUAL, &mut rows));
    harm.judge();
    rows.judge();
}

#[test]
#[ignore = "slow: cargo test --release --workspace -- --ignored slow_"]
fn slow_stages() {
    let (mut rows, mut harm) = (Rows::default(), Harm::default());
    harm.take("stage", identified("stage", 100, USUAL, &mut rows));
    let mut unjudged = Rows::default();
    // Two training records behind much noise.
    harm.take("stage, told right", identified("poor", 60, (2, 2e-4, 0.0), &mut unjudged));
    harm.take("stage, told wrong", identified("poor", 60, (2, 2e-4, 0.3), &mut unjudged));
    harm.judge();
    rows.judge();
}
