//! Steps of a rate table.

use super::coverage::assert_95_of_100;
use super::simulated::{Noise, Vector};
use kalmems_applications::ApplicationFile;
use kalmems_applications::calibration::{
    Calibration, CalibrationError, CalibrationSummary, Certificate, GyroscopeCalibration, calibrate,
    calibrate_with_parts, write_refused_calibration,
};
use kalmems_engines::progress::Silent;
use kalmems_store::{Output, Work};
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs;
use std::path::Path;

const FILE: &str = "name = \"table\"\n[gyroscope]\nrate = \"100 Hz\"\n\
    channels = { x = \"gx_rad_per_s\", y = \"gy_rad_per_s\", z = \"gz_rad_per_s\" }\n\
    [[rates]]\nname = \"z\"\nfile = \"rates.csv\"\naxis = \"z\"\ntable = \"table_rad_per_s\"\n";

/// A gyroscope on a table: what the main axis and the others show.
#[derive(Clone, Copy)]
struct Gyroscope {
    bias: f64,
    slope: f64,
    /// Of the magnitude, the square and the cube of the rate.
    magnitude: f64,
    square: f64,
    cube: f64,
    /// What the shown rate is larger by if the rate was reached from below.
    hysteresis: f64,
    others: Vector,
    noise: f64,
    /// What each step is off by itself.
    scatter: f64,
    /// The time constant of its low pass in samples.
    lag: f64,
}

const GYROSCOPE: Gyroscope = Gyroscope {
    bias: 3e-3,
    slope: 1.012,
    magnitude: 4e-4,
    square: 1.5e-4,
    cube: -6e-5,
    hysteresis: 4e-4,
    others: [0.004, -0.007, 0.0],
    noise: 2e-3,
    scatter: 1.5e-4,
    lag: 0.0,
};

/// The rates of a staircase up and down twice, in rad/s.
fn staircase() -> Vec<f64> {
    let up: Vec<f64> = (-6..=6).map(|k| 0.5 * f64::from(k)).collect();
    let down = up.iter().rev().skip(1).copied();
    let once: Vec<f64> = up.iter().copied().chain(down).collect();
    let again = once.iter().skip(1).copied();
    once.iter().copied().chain(again).collect()
}

const HOLD: usize = 150;
const RAMP: usize = 80;

impl Gyroscope {
    fn at(&self, rate: f64, direction: f64) -> f64 {
        self.bias
            + self.slope * rate
            + self.magnitude * rate.abs()
            + self.square * rate * rate
            + self.cube * rate.powi(3)
            + 0.5 * self.hysteresis * direction
    }

    fn write(&self, path: &Path, rates: &[f64], seed: u64) {
        let mut noise = Noise::new(seed);
        let mut text = "table_rad_per_s,gx_rad_per_s,gy_rad_per_s,gz_rad_per_s\n".to_owned();
        let mut before = rates[0];
        let mut followed = rates[0];
        for rate in rates {
            let direction = (rate - before).signum() * f64::from(u8::from(*rate != before));
            // The table does not keep the rate while it accelerates.
            let ramp = (0..if *rate == before { 0 } else { RAMP }).map(|k| {
                let part = (std::f64::consts::PI * k as f64 / RAMP as f64).cos();
                before + (rate - before) * 0.5 * (1.0 - part)
            });
            let off: Vector = std::array::from_fn(|_| self.scatter * noise.normal());
            for (place, now) in ramp.chain(std::iter::repeat_n(*rate, HOLD)).enumerate() {
                let is_still = place >= RAMP || *rate == before;
                let off = if is_still { off } else { [0.0; 3] };
                followed += (now - followed) / (1.0 + self.lag);
                let main = self.at(followed, direction) + off[2] + self.noise * noise.normal();
                let [x, y] =
                    [0, 1].map(|axis| self.others[axis] * now + off[axis] + self.noise * noise.normal());
                writeln!(text, "{now:.6},{x:.7},{y:.7},{main:.7}").unwrap();
            }
            before = *rate;
        }
        fs::write(path, text).unwrap();
    }

    /// The slope of the least-squares line through what the axis shows at these rates.
    fn line(&self, rates: impl Iterator<Item = f64> + Clone) -> f64 {
        let count = rates.clone().count() as f64;
        let mean = rates.clone().sum::<f64>() / count;
        let products: f64 = rates.clone().map(|rate| (rate - mean) * self.at(rate, 0.0)).sum();
        products / rates.map(|rate| (rate - mean).powi(2)).sum::<f64>()
    }

    fn truth(&self, rates: &[f64]) -> BTreeMap<&'static str, f64> {
        let all = self.line(rates.iter().copied());
        let of = |sign: f64| self.line(rates.iter().copied().filter(move |rate| sign * rate > 1e-6));
        BTreeMap::from([
            ("scale_factor_z", all),
            ("asymmetry_z", (of(1.0) - of(-1.0)) / all),
            ("second_order_z", self.square / all),
            ("third_order_z", self.cube / all),
            ("bias_z", self.bias),
            ("hysteresis_z", self.hysteresis),
            ("cross_axis_sensitivity_xz", self.others[0]),
            ("cross_axis_sensitivity_yz", self.others[1]),
        ])
    }
}

fn calibrated(
    gyroscope: &Gyroscope,
    rates: &[f64],
    seed: u64,
    text: &str,
) -> Result<Calibration, CalibrationError> {
    let folder = tempfile::tempdir().unwrap();
    gyroscope.write(&folder.path().join("rates.csv"), rates, seed);
    calibrate(&GyroscopeCalibration::parse(text, &folder.path().join("table.toml")).unwrap(), &Silent)
}

fn coverage(seeds: std::ops::Range<u64>) -> BTreeMap<&'static str, usize> {
    let rates = staircase();
    let truth = GYROSCOPE.truth(&rates);
    let mut held: BTreeMap<&str, usize> = truth.keys().map(|name| (*name, 0)).collect();
    for seed in seeds {
        // The simulation has no Earth: at the equator the table's axis has no part of its rotation.
        let found = calibrated(&GYROSCOPE, &rates, seed, &format!("{FILE}latitude = \"0 deg\"\n")).unwrap();
        for (name, value) in &truth {
            let estimate = found.records[0].estimate(name).unwrap_or_else(|| panic!("{name}"));
            let [low, high] = estimate.interval;
            assert!(low < estimate.value && estimate.value < high, "{name} {estimate:?}");
            *held.get_mut(name).unwrap() += usize::from(low <= *value && *value <= high);
        }
    }
    held
}

#[test]
fn steps_give_scale_factor_nonlinearity_hysteresis_and_cross_axis_sensitivity() {
    let held = coverage(0..8);
    // Four or fewer of eight come once in 2700 times for one number.
    assert!(held.values().all(|held| *held >= 5), "{held:?}");
}

#[test]
#[ignore = "200 records; cargo test -p kalmems-applications --test inertial -- --ignored slow_"]
fn slow_intervals_by_steps_hold_95_of_100() {
    assert_95_of_100("steps", coverage(1000..1200), 200);
}

/// The sensitivity of the main axis to the specific force, in rad/s by m/s²; the other axes have none.
const BY_FORCE: f64 = 4e-5;

/// How often the sensitivities by an upright and an upside-down mounting are in their intervals.
fn mounted(seeds: std::ops::Range<u64>) -> BTreeMap<String, usize> {
    let mut text = FILE.split("[[rates]]").next().unwrap().to_owned();
    for mounting in ["up", "down"] {
        write!(
            text,
            "[[rates]]\nname = \"z_{mounting}\"\nfile = \"{mounting}.csv\"\naxis = \"z\"\ntable = \"table_rad_per_s\"\nmounting = \"{mounting}\"\n\
             latitude = \"0 deg\"\n"
        )
        .unwrap();
    }
    let mut held = BTreeMap::new();
    for seed in seeds {
        let folder = tempfile::tempdir().unwrap();
        for (sign, mounting) in [(1.0, "up"), (-1.0, "down")] {
            let bias = GYROSCOPE.bias + sign * BY_FORCE * 9.806_65;
            let path = folder.path().join(format!("{mounting}.csv"));
            Gyroscope { bias, ..GYROSCOPE }.write(&path, &staircase(), 2 * seed + u64::from(sign < 0.0));
            // Upside down the unit turns the other way round than the table.
            let written = fs::read_to_string(&path).unwrap();
            let lines = written.lines().enumerate().map(|(place, line)| match line.split_once(',') {
                Some((table, rest)) if place > 0 => {
                    format!("{:.6},{rest}\n", sign * table.parse::<f64>().unwrap())
                }
                _ => format!("{line}\n"),
            });
            fs::write(&path, lines.collect::<String>()).unwrap();
        }
        let file = GyroscopeCalibration::parse(&text, &folder.path().join("table.toml")).unwrap();
        let found = calibrate(&file, &Silent).unwrap();
        for (name, value) in [("xz", 0.0), ("yz", 0.0), ("zz", BY_FORCE)] {
            let record = found.records.iter().find(|record| record.kind == "mountings").unwrap();
            let name = format!("gyroscope_force_sensitivity_{name}");
            let [low, high] = record.estimate(&name).unwrap().interval;
            *held.entry(name).or_default() += usize::from(low <= value && value <= high);
        }
    }
    held
}

#[test]
fn an_upside_down_mounting_gives_the_sensitivity_to_the_specific_force() {
    let held = mounted(0..8);
    // Four or fewer of eight come once in 2700 times for one number.
    assert!(held.len() == 3 && held.values().all(|held| *held >= 5), "{held:?}");
    // Without it the program says which mounting is missing.
    let said = |stated: &str| {
        let text = format!("{FILE}{stated}");
        calibrated(&GYROSCOPE, &staircase(), 3, &text).unwrap().records[0].not_observed.join("\n")
    };
    assert!(said("").contains("state where the axis points as `mounting`"));
    assert!(said("mounting = \"up\"\n").contains("add a record with the axis downwards"));
}

#[test]
#[ignore = "400 records; cargo test -p kalmems-applications --test inertial -- --ignored slow_"]
fn slow_intervals_by_mountings_hold_95_of_100() {
    assert_95_of_100("mountings", mounted(1000..1200), 200);
}

#[test]
fn the_table_the_alignment_and_the_earth_are_in_the_budget() {
    let rates = staircase();
    let stated = format!("{FILE}table_uncertainty = \"200 ppm\"\nalignment = \"2 mrad\"\n");
    let [without, with] = [FILE, &stated].map(|text| calibrated(&GYROSCOPE, &rates, 3, text).unwrap());
    let of = |found: &Calibration, name: &str| *found.records[0].estimate(name).unwrap();
    let scale = of(&with, "scale_factor_z");
    assert!((scale.uncertainty / scale.by_records.hypot(2e-4 * scale.value) - 1.0).abs() < 1e-4, "{scale:?}");
    let cross = of(&with, "cross_axis_sensitivity_xz");
    assert!((cross.uncertainty / cross.by_records.hypot(2e-3) - 1.0).abs() < 1e-9, "{cross:?}");
    // 15 degrees per hour in either direction, rectangular.
    let bias = of(&with, "bias_z");
    assert!(
        (bias.uncertainty / bias.by_records.hypot(7.292e-5 / 3.0_f64.sqrt()) - 1.0).abs() < 1e-4,
        "{bias:?}"
    );
    let missing = Certificate::of(&without).not_stated.join("\n");
    assert!(missing.contains("table_uncertainty") && missing.contains("alignment of the rates"), "{missing}");
    let text = CalibrationSummary::of(&with).to_text();
    for part in ["scale factor z", "ppm/(deg/s)^2", "hysteresis z", "reached from", "below"] {
        assert!(text.contains(part), "{part}: {text}");
    }
}

#[test]
fn turned_saturated_and_too_few_steps_are_named_and_none_is_certified() {
    let rates = staircase();
    let turned = FILE.replace("z = \"gz_rad_per_s\"", "z = { column = \"gz_rad_per_s\", scale = -1 }");
    let found = calibrated(&GYROSCOPE, &rates, 3, &turned).unwrap();
    assert!(found.records[0].warnings.join("\n").contains("its sign is turned"));
    assert!(!Certificate::of(&found).valid);
    let other = FILE.replace("axis = \"z\"", "axis = \"x\"");
    let found = calibrated(&GYROSCOPE, &rates, 3, &other).unwrap();
    assert!(found.records[0].warnings.join("\n").contains("another axis lies along"));
    // What is beyond the range is named with its column and left out, and the table's own plateaus are no finding.
    let full =
        FILE.replace("z = \"gz_rad_per_s\"", "z = { column = \"gz_rad_per_s\", full_scale = \"2.9 rad/s\" }");
    let found = calibrated(&GYROSCOPE, &rates, 3, &full).unwrap();
    let said = found.findings.join("\n");
    assert!(said.contains("`gz_rad_per_s`: -3.0") && said.contains("beyond the stated range"), "{said}");
    assert!(!said.contains("table_rad_per_s"), "{said}");
    let of_unit = FILE.replace("[[rates]]", "full_scale = \"2.9 rad/s\"\n[[rates]]");
    let said = calibrated(&GYROSCOPE, &rates, 3, &of_unit).unwrap_err().to_string();
    assert!(said.contains("gz_rad_per_s") && said.contains("clipped"), "{said}");
    // A converter that ends at 2.9 rad/s, of which nothing is stated.
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("rates.csv");
    GYROSCOPE.write(&path, &rates, 3);
    let text = fs::read_to_string(&path).unwrap();
    let clipped = text.lines().map(|line| match line.rsplit_once(',') {
        Some((before, last)) if last.parse::<f64>().is_ok_and(|rate| rate.abs() > 2.9) => {
            format!("{before},{}\n", if last.starts_with('-') { -2.9 } else { 2.9 })
        }
        _ => format!("{line}\n"),
    });
    fs::write(&path, clipped.collect::<String>()).unwrap();
    let file = GyroscopeCalibration::parse(FILE, &folder.path().join("table.toml")).unwrap();
    let mut parts = Vec::new();
    let said = calibrate_with_parts(&file, &Silent, &mut parts).unwrap_err().to_string();
    assert!(said.contains("gz_rad_per_s") && said.contains("clipped"), "{said}");
    // Three gyroscopes, and below them the parts in which they are still.
    assert!(parts.len() == 1 && parts[0].id == "refused" && parts[0].panels[0].series.len() > 3);
    let said = calibrated(&GYROSCOPE, &[0.0, 1.0, 2.0, 3.0], 3, FILE).unwrap_err().to_string();
    assert!(said.contains("found 4 parts") && said.contains("at least 10"), "{said}");
    // The parts that were found are drawn all the same.
    GYROSCOPE.write(&path, &[0.0, 1.0, 2.0, 3.0], 3);
    let mut parts = Vec::new();
    let why = calibrate_with_parts(&file, &Silent, &mut parts).unwrap_err();
    let [figure] = &parts[..] else { panic!("{}", parts.len()) };
    let constant = figure.panels[0].series.len() - 1;
    assert!(figure.id == "rates-z" && constant == 4, "{} {constant}", figure.id);
    let out = folder.path().join("out");
    let output = Output::begin(&out, &Work::named("calibrate gyro", "table")).unwrap();
    write_refused_calibration(&file, &why, &parts, &output).unwrap();
    output.commit().unwrap();
    let page = fs::read_to_string(out.join("report.html")).unwrap();
    assert!(page.contains("found 4 parts") && out.join("figures/rates-z.svg").is_file());
    // Only upwards: hysteresis is not seen, all else is.
    let up: Vec<f64> = (-12..=12).map(|k| 0.25 * f64::from(k)).collect();
    let found = calibrated(&GYROSCOPE, &up, 3, FILE).unwrap();
    let record = &found.records[0];
    assert!(record.estimate("scale_factor_z").is_some() && record.estimate("bias_z").is_some());
}

/// A low pass of 0.12 s, with further keys of the record.
pub fn slow(keys: &str) -> Calibration {
    let slow = Gyroscope { lag: 12.0, hysteresis: 0.0, ..GYROSCOPE };
    let text = FILE.replace("table = ", &format!("shortest = \"0.5 s\"\n{keys}table = "));
    calibrated(&slow, &staircase(), 41, &text).unwrap()
}

/// What it still follows of the rate before looks like hysteresis, until that time is left out.
#[test]
fn a_slow_gyroscope_is_named_and_is_right_once_its_settling_is_left_out() {
    let check = |keys: &str| {
        let found = slow(keys);
        let [record] = &found.records[..] else { panic!("{:?}", found.records) };
        let settled = record.checks.iter().find(|check| check.what.contains("has settled")).unwrap();
        let [low, high] = record.estimate("hysteresis_z").unwrap().interval;
        (settled.passes, low < 0.0 && 0.0 < high)
    };
    assert_eq!(check(""), (false, false));
    assert_eq!(check("settling = \"0.9 s\"\n"), (true, true));
}

/// The gyroscope of this axis on a table about z.
pub fn about(axis: &str) -> Calibration {
    let text = FILE.replace("axis = \"z\"", &format!("axis = \"{axis}\""));
    calibrated(&GYROSCOPE, &staircase(), 3, &text).unwrap()
}

/// One step at which the gyroscope of z shows this much more, in rad/s.
pub fn with_a_disturbed_step(more: f64) -> Calibration {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("rates.csv");
    GYROSCOPE.write(&path, &staircase(), 3);
    // The first rate is held for the first rows; each later one after a ramp.
    let step = 1 + HOLD + 9 * (RAMP + HOLD) + RAMP;
    let written = fs::read_to_string(&path).unwrap();
    let lines = written.lines().enumerate().map(|(row, line)| match line.rsplit_once(',') {
        Some((before, last)) if (step..step + HOLD).contains(&row) => {
            format!("{before},{:.7}\n", last.parse::<f64>().unwrap() + more)
        }
        _ => format!("{line}\n"),
    });
    fs::write(&path, lines.collect::<String>()).unwrap();
    let file = GyroscopeCalibration::parse(FILE, &folder.path().join("table.toml")).unwrap();
    calibrate(&file, &Silent).unwrap()
}
