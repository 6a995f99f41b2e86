//! A micro-stage that is simulated here, and its recordings as files.
//!
//! The signal is the charge's rate of change by quadrature of dC = ε·dA/D, not by the program's closed form.

use kalmems::config::Experiment;
use kalmems::rigs::micro_stage::identification::WaveRecord;
use kalmems::rigs::published;
use kalmems::signal::Sine;
use kalmems::simulate::WhiteNoise;
use kalmems_models::capacitance::{StageLayout, TiltingPlate};
use std::f64::consts::TAU;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

pub const NAMES: [&str; 4] = ["1A", "1B", "2A", "2B"];
pub const GAPS: [f64; 4] = [19.23e-6, 19.18e-6, 19.15e-6, 19.21e-6];
pub const GAINS: [f64; 4] = [-2.431e7, -2.377e7, -2.399e7, -2.452e7];
pub const FEEDTHROUGH: [[f64; 2]; 4] =
    [[3.1e-4, 5.2e-8], [2.2e-4, 3.9e-8], [2.9e-4, 4.6e-8], [2.6e-4, 4.4e-8]];
pub const NOISE: f64 = 4e-6;
pub const INTERVAL: f64 = 1.6e-6;
pub const HZ: f64 = 1700.0;
/// Drives in V and amplitudes of the angle in rad.
pub const MOTIONS: [[f64; 2]; 4] = [[1.0, 1.366e-3], [1.1, 1.613e-3], [1.2, 1.880e-3], [1.3, 2.166e-3]];
/// The phase of the rate against a drive that is a sine.
pub const PHASE: f64 = -0.542;
const AIR: f64 = 8.8542e-12;

pub fn plates() -> [TiltingPlate<f64>; 4] {
    let mut plates = StageLayout::PUBLISHED.plates(19.2e-6, AIR);
    for (plate, gap) in plates.iter_mut().zip(GAPS) {
        plate.gap = gap;
    }
    plates
}

/// dC/dθ = ε·b·(1 + t²)·∫ w/(D − w·t)² dw by Simpson's rule.
fn slope(plate: &TiltingPlate<f64>, angle: f64) -> f64 {
    const HALVES: u32 = 20;
    let t = angle.tan();
    let h = (plate.w2 - plate.w1) / f64::from(2 * HALVES);
    let at = |k: u32| {
        let w = plate.w1 + h * f64::from(k);
        w / (plate.gap - w * t).powi(2)
    };
    let sum: f64 = (0..HALVES).map(|k| at(2 * k) + 4.0 * at(2 * k + 1) + at(2 * k + 2)).sum();
    AIR * (plate.w4 - plate.w3) * (1.0 + t * t) * sum * h / 3.0
}

/// η·dC/dt of an electrode in V at a time, under a motion of this amplitude.
pub fn signal(electrode: usize, amplitude: f64, time_s: f64) -> f64 {
    signal_of_gap(electrode, amplitude, time_s, GAPS[electrode])
}

/// The same with another gap.
pub fn signal_of_gap(electrode: usize, amplitude: f64, time_s: f64, gap: f64) -> f64 {
    let phase = TAU * HZ * time_s + PHASE;
    let (angle, rate) = (amplitude * phase.sin(), amplitude * TAU * HZ * phase.cos());
    GAINS[electrode] * slope(&TiltingPlate { gap, ..plates()[electrode] }, angle) * rate
}

/// Records with noise, as an identification takes them.
pub fn records(count: usize, seed: u64) -> Vec<WaveRecord> {
    let mut noise = WhiteNoise::new(seed, 0);
    let time_s: Vec<f64> = (0..count).map(|k| k as f64 * INTERVAL).collect();
    let one = |[volts, amplitude]: [f64; 2]| WaveRecord {
        drive: Sine {
            offset: 0.0,
            amplitude: volts,
            frequency_hz: HZ,
            phase_rad: -TAU / 4.0,
            residual_rms: 0.0,
        },
        angle: Sine {
            offset: 0.0,
            amplitude,
            frequency_hz: HZ,
            phase_rad: PHASE - TAU / 4.0,
            residual_rms: 0.0,
        },
        signals: (0..4)
            .map(|i| time_s.iter().map(|t| signal(i, amplitude, *t) + NOISE * noise.sample()).collect())
            .collect(),
        time_s: time_s.clone(),
    };
    MOTIONS.map(one).to_vec()
}

/// What a laboratory would hand over, with what may be wrong with it.
#[derive(Clone)]
pub struct Laboratory {
    /// The drives and motions of its records.
    pub motions: Vec<[f64; 2]>,
    /// The order in which the signals stand in the columns.
    pub order: [usize; 4],
    /// The drive's frequency while the bias is off.
    pub off_hz: f64,
    /// What no signal goes beyond, in V.
    pub clip: f64,
    /// How late the vibrometer is.
    pub delay_s: f64,
    pub seed: u64,
}

impl Default for Laboratory {
    fn default() -> Self {
        Self {
            motions: MOTIONS.to_vec(),
            order: [0, 1, 2, 3],
            off_hz: HZ,
            clip: f64::INFINITY,
            delay_s: 6.87e-6,
            seed: 1,
        }
    }
}

/// Samples of a record: a little more than three cycles.
const SAMPLES: usize = 1200;

impl Laboratory {
    /// Writes `on.csv`, `off.csv` and `still.csv`.
    pub fn write(&self, folder: &Path) {
        let mut noise = WhiteNoise::new(self.seed, 1);
        let mut noisy = |level: f64| level * noise.sample();
        let mut on = "record,time_s,drive_V,c1A_V,c1B_V,c2A_V,c2B_V,ldv_V\n".to_owned();
        let mut off = "record,time_s,drive_V,c1A_V,c1B_V,c2A_V,c2B_V\n".to_owned();
        for (i, [volts, amplitude]) in self.motions.iter().enumerate() {
            for k in 0..SAMPLES {
                let t = k as f64 * INTERVAL;
                let drive = |hz: f64| {
                    let (s, c) = (TAU * hz * t).sin_cos();
                    [volts * s, volts * TAU * hz * c]
                };
                let through =
                    |[v, slope]: [f64; 2], e: usize| FEEDTHROUGH[e][0] * v + FEEDTHROUGH[e][1] * slope;
                let (here, there) = (drive(HZ), drive(self.off_hz));
                let _ = write!(on, "r{i},{t:.7},{:.5}", here[0] + noisy(3e-4));
                let _ = write!(off, "r{i},{t:.7},{:.5}", there[0] + noisy(3e-4));
                for e in self.order {
                    let y = signal(e, *amplitude, t) + through(here, e) + noisy(NOISE);
                    let _ = write!(on, ",{:.7}", y.clamp(-self.clip, self.clip));
                    let _ = write!(off, ",{:.7}", through(there, e) + noisy(NOISE));
                }
                let rate = amplitude * TAU * HZ * (TAU * HZ * (t - self.delay_s) + PHASE).cos();
                let _ = writeln!(on, ",{:.5}", rate * 50.0 * 1.5e-3 + 0.0123 + noisy(2e-4));
                off.push('\n');
            }
        }
        let mut still = "time_s,c1A_V,c1B_V,c2A_V,c2B_V\n".to_owned();
        for k in 0..800 {
            let _ = write!(still, "{:.7}", f64::from(k) * INTERVAL);
            for _ in 0..4 {
                let _ = write!(still, ",{:.7}", noisy(NOISE));
            }
            still.push('\n');
        }
        for (name, text) in [("on.csv", on), ("off.csv", off), ("still.csv", still)] {
            std::fs::write(folder.join(name), text).unwrap();
        }
    }
}

/// One record of this many rows that goes on, its lines with the bias on and a shorter one's with the bias off: the generator
/// a little faster while the bias is on, and the motion with it.
pub fn going_on(rows: u32, on_hz: f64, amplitude: f64) -> [Vec<String>; 2] {
    let mut noise = WhiteNoise::new(7, 1);
    let header = "time_s,drive_V,c1A_V,c1B_V,c2A_V,c2B_V";
    let mut of = |rows: u32, hz: f64, motion: f64| {
        let mut lines = vec![header.to_owned()];
        for k in 0..rows {
            let t = f64::from(k) * INTERVAL;
            let (s, c) = (TAU * hz * t).sin_cos();
            let mut line = format!("{t:.7},{:.5}", 1.2 * s + 3e-4 * noise.sample());
            for (e, [gain, slope]) in FEEDTHROUGH.iter().enumerate() {
                // The motion in the time of its own frequency.
                let moved = if motion > 0.0 { signal(e, motion, t * hz / HZ) * hz / HZ } else { 0.0 };
                let y = moved + 1.2 * (gain * s + slope * TAU * hz * c) + NOISE * noise.sample();
                let _ = write!(line, ",{y:.7}");
            }
            lines.push(line);
        }
        lines
    };
    [of(rows, on_hz, amplitude), of(3000, HZ, 0.0)]
}

/// The device table with the gaps and gains that the signals are made with.
pub fn true_device() -> String {
    let mut text = device();
    for (gap, gain) in GAPS.iter().zip(GAINS) {
        text = text.replacen("\"19.2 um\"", &format!("\"{gap:e} m\""), 1);
        text = text.replacen("\"-2.40752e7 V ohm\"", &format!("\"{gain} V ohm\""), 1);
    }
    text
}

/// The device table of the stage, with nominal gaps and gains.
pub fn device() -> String {
    let mut text = "name = \"stage\"\n[device.micro_stage.resonator]\nnatural_frequency = \"1714.5 Hz\"\n\
                    damping_ratio = \"0.5 %\"\ndrive_gain = \"3782.5 rad/s^2/V\"\n\
                    [device.micro_stage.vibrometer]\ngain = \"50 V/(m/s)\"\ntarget_width = \"3 mm\"\n"
        .to_owned();
    for (name, plate) in NAMES.iter().zip(StageLayout::PUBLISHED.plates(19.2e-6, AIR)) {
        let _ = writeln!(
            text,
            "[device.micro_stage.electrodes.{name}]\nw1 = \"{:e} m\"\nw2 = \"{:e} m\"\nw3 = \"{:e} m\"\nw4 = \"{:e} m\"\n\
             gap = \"19.2 um\"\ngain = \"-2.40752e7 V ohm\"\nnoise_variance = \"1.6e-11 V^2\"",
            plate.w1, plate.w2, plate.w3, plate.w4
        );
    }
    text
}

fn channels() -> String {
    "[recording.channels]\ndrive = \"drive_V\"\nsignal_1A = \"c1A_V\"\nsignal_1B = \"c1B_V\"\n\
     signal_2A = \"c2A_V\"\nsignal_2B = \"c2B_V\"\n"
        .to_owned()
}

/// The recordings of the experiment.
pub const ON: &str = "on";
pub const OFF: &str = "off";
pub const STILL: &str = "still";

/// The tables of these recordings; `vibrometer` for what one is told of it.
pub fn recordings(names: &[&str], vibrometer: bool) -> String {
    let mut text = String::new();
    for name in names {
        let (role, segments) = match *name {
            ON => ("bias_on", "segments = { column = \"record\" }\n"),
            OFF => ("bias_off", "segments = { column = \"record\" }\n"),
            _ => ("zero_drive", ""),
        };
        let _ = write!(
            text,
            "[[recording]]\nname = \"{name}\"\nrole = \"{role}\"\nfile = \"{name}.csv\"\n{segments}\
             clock = {{ column = \"time_s\" }}\n"
        );
        text += &if *name == STILL { channels().replace("drive = \"drive_V\"\n", "") } else { channels() };
        if *name == ON && vibrometer {
            text += "[recording.reference]\nchannels = { edge_velocity = \"ldv_V\" }\ndelay = \"6.9 us\"\n";
        }
    }
    text
}

/// An estimate with all four channels, and with one.
pub const ESTIMATE: &str = "[estimate]\nskip = \"0.6 ms\"\n\
     process_noise = { angular_acceleration = \"20 rad^2/s^3\" }\n\
     [[estimate.filter]]\nname = \"EKF\"\nmethod = \"ekf\"\nstart = \"from_signal\"\n\
     start_sd = { angle = \"50 urad\", rate = \"1 rad/s\" }\n\
     [[estimate.filter]]\nname = \"EKF 1A\"\nmethod = \"ekf\"\nchannels = [\"1A\"]\nstart = \"from_signal\"\n\
     start_sd = { angle = \"50 urad\", rate = \"1 rad/s\" }\n";

/// The experiment in a folder.
pub fn experiment(folder: &Path, tables: &str) -> Experiment {
    published().parse(&(device() + tables), &folder.join("experiment.toml")).unwrap()
}

/// A folder of the reference recordings.
pub fn reference_folder(name: &str) -> PathBuf {
    let root = std::env::var("KALMEMS_REFERENCE_DATA").expect("KALMEMS_REFERENCE_DATA names the folder");
    Path::new(&root).join("recordings").join(name)
}

/// The answers that come with them.
pub fn expected(name: &str) -> serde_json::Value {
    let text = std::fs::read_to_string(reference_folder(name).join("expected.json")).unwrap();
    serde_json::from_str(&text).unwrap()
}

/// The experiment on a folder of the reference recordings, with tables added.
pub fn reference(name: &str, tables: &str) -> Experiment {
    let described = format!("tests/experiments/{name}.toml");
    let text = std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join(described)).unwrap();
    // The files are named from the folder above.
    let place = reference_folder(name).with_file_name(format!("{name}.toml"));
    published().parse(&(text + tables), &place).unwrap()
}
