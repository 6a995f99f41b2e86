//! The motion of the micro-stage from its own electrodes, as simply as it can be had: a sine whose amplitude and phase
//! make the four channels' waveforms, with gaps and gains from the training records beside the vibrometer.

use kalmems::fit::{ByDual, FitSettings, Law, fit};
use kalmems::signal::{Sine, fit_sine_at};
use kalmems_core::Over;
use kalmems_models::capacitance::TiltingPlate;
use std::collections::BTreeMap;
use std::f64::consts::TAU;
use std::fs;
use std::path::Path;

const CHANNELS: [&str; 4] = ["1A", "1B", "2A", "2B"];
const DRIVE_HZ: f64 = 1700.0;
/// Metres by volt of the vibrometer, and of its velocity twice the lever: rad/s by V.
const RATE_BY_VOLT: f64 = 2.0 / (50.0 * 3e-3);

type Columns = BTreeMap<String, Vec<f64>>;

fn read(path: &Path) -> BTreeMap<String, Columns> {
    let text = fs::read_to_string(path).unwrap();
    let mut lines = text.lines();
    let names: Vec<&str> = lines.next().unwrap().split(',').collect();
    let mut records: BTreeMap<String, Columns> = BTreeMap::new();
    for line in lines {
        let cells: Vec<&str> = line.split(',').collect();
        let record = records.entry(cells[0].to_owned()).or_default();
        for (name, cell) in names.iter().zip(&cells).skip(1) {
            record.entry((*name).to_owned()).or_default().push(cell.parse().unwrap());
        }
    }
    records
}

/// One record: times and what the motion alone makes of each channel.
struct Record {
    time_s: Vec<f64>,
    channels: [Vec<f64>; 4],
    vibrometer: Sine,
}

impl Record {
    /// The record without bias is feedthrough alone: scaled and turned as the drives of both say, and taken off.
    fn new(on: &Columns, off: &Columns) -> Self {
        let time_s = on["time_s"].clone();
        let sine = |of: &Columns, name: &str| fit_sine_at(&of["time_s"], &of[name], DRIVE_HZ).unwrap();
        let (drive, drive_off) = (sine(on, "drive_V"), sine(off, "drive_V"));
        let channels = CHANNELS.map(|name| {
            let name = format!("cap{name}_V");
            let left = sine(off, &name);
            let left = Sine {
                amplitude: left.amplitude * drive.amplitude / drive_off.amplitude,
                phase_rad: left.phase_rad + drive.phase_rad - drive_off.phase_rad,
                ..left
            };
            time_s.iter().zip(&on[&name]).map(|(t, y)| y - left.at(*t)).collect()
        });
        Self { vibrometer: sine(on, "ldv_V"), channels, time_s }
    }

    /// Every so many rows.
    fn rows(&self) -> impl Iterator<Item = (f64, [f64; 4])> + '_ {
        (0..self.time_s.len())
            .step_by(7)
            .map(|k| (self.time_s[k], std::array::from_fn(|c| self.channels[c][k])))
    }
}

fn plate<S: Over<f64>>(channel: usize, gap: S) -> TiltingPlate<S> {
    let (inner, outer) = (0.32e-3, 0.4e-3);
    let [w1, w2] = match channel {
        0 => [-1.39e-3, -1.39e-3 + outer],
        1 => [0.475e-3, 0.475e-3 + inner],
        2 => [1.39e-3 - outer, 1.39e-3],
        _ => [-0.475e-3 - inner, -0.475e-3],
    };
    let of = |value: f64| S::lift(value);
    TiltingPlate {
        w1: of(w1),
        w2: of(w2),
        w3: of(-0.2e-3),
        w4: of(0.2e-3),
        gap,
        permittivity: of(8.8542e-12),
    }
}

/// η·C′(θ)·ω of a sine: amplitude in rad/s and phase at t.
fn signal<S: Over<f64>>(plate: &TiltingPlate<S>, gain: S, [amplitude, phase]: [S; 2]) -> S {
    let angle = amplitude * phase.sin() * S::lift(1.0 / (TAU * DRIVE_HZ));
    plate.slope(angle) * gain * amplitude * phase.cos()
}

/// Four gaps in µm, four gains in 1e7 V·Ω, and the vibrometer's delay in µs. An angle at rest is part of the gaps: nothing
/// tells the two apart.
struct Training<'a>(&'a [Record]);

impl Law<9> for Training<'_> {
    fn residuals<S: Over<f64>>(&self, p: &[S; 9], each: &mut impl FnMut(S)) {
        for record in self.0 {
            let ldv = &record.vibrometer;
            let amplitude = S::lift(ldv.amplitude * RATE_BY_VOLT);
            for (t, y) in record.rows() {
                let phase = p[8] * (1e-6 * TAU * DRIVE_HZ) + S::lift(TAU * DRIVE_HZ * t + ldv.phase_rad);
                for (c, y) in y.iter().enumerate() {
                    let plate = plate(c, p[c] * 1e-6);
                    let model = signal(&plate, p[4 + c] * 1e7, [amplitude, phase]);
                    each((model - S::lift(*y)) * 1e3);
                }
            }
        }
    }
}

/// Amplitude in rad/s and phase of one record.
struct Test<'a>(&'a Record, &'a [f64; 9]);

impl Law<2> for Test<'_> {
    fn residuals<S: Over<f64>>(&self, p: &[S; 2], each: &mut impl FnMut(S)) {
        let Self(record, known) = self;
        for (t, y) in record.rows() {
            let phase = p[1] + S::lift(TAU * DRIVE_HZ * t);
            for (c, y) in y.iter().enumerate() {
                let plate = plate(c, S::lift(known[c] * 1e-6));
                let gain = S::lift(known[4 + c] * 1e7);
                let model = signal(&plate, gain, [p[0], phase]);
                each((model - S::lift(*y)) * 1e3);
            }
        }
    }
}

/// Writes the rates of the test records as the electrodes tell them.
pub fn write_rates(folder: &Path, to: &Path) {
    let (on, off) = (read(&folder.join("bias_on.csv")), read(&folder.join("bias_off.csv")));
    let records = |of: &str| -> Vec<(String, Record)> {
        let wanted = on.iter().filter(|(name, _)| name.starts_with(of));
        wanted.map(|(name, columns)| (name.clone(), Record::new(columns, &off[name]))).collect()
    };
    let training: Vec<Record> = records("train").into_iter().map(|(_, record)| record).collect();
    let start = [19.2, 19.2, 19.2, 19.2, -2.4, -2.4, -2.4, -2.4, 6.9];
    let known = fit(&ByDual(Training(&training)), &FitSettings::from_start(start)).unwrap().parameters;
    println!("gaps, gains, delay: {known:?}");
    let mut text = String::from("record,time_s,rate_rad_per_s\n");
    for (name, record) in records("test") {
        let start = [record.vibrometer.amplitude * RATE_BY_VOLT, record.vibrometer.phase_rad];
        let [amplitude, phase] =
            fit(&ByDual(Test(&record, &known)), &FitSettings::from_start(start)).unwrap().parameters;
        for t in &record.time_s {
            let rate = amplitude * (TAU * DRIVE_HZ * t + phase).cos();
            text += &format!("{name},{t:e},{rate:e}\n");
        }
    }
    fs::write(to, text).unwrap();
}
