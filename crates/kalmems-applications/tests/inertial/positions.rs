//! Multi-position calibration without a table.

use super::coverage::assert_95_of_100;
use super::simulated::{GRAVITY, Noise, TURNS, Turns, UNIT, Unit, Vector, dot, frame, scales_and_angles};
use kalmems_applications::ApplicationFile;
use kalmems_applications::calibration::{
    Calibration, CalibrationError, CalibrationSummary, Certificate, GyroscopeCalibration, RecordOutcome,
    calibrate,
};
use kalmems_engines::progress::Silent;
use std::collections::BTreeMap;

const FILE: &str = "name = \"unit\"\n[gyroscope]\nrate = \"100 Hz\"\n\
    channels = { x = \"gx_rad_per_s\", y = \"gy_rad_per_s\", z = \"gz_rad_per_s\" }\n\
    accelerometers = { x = \"ax_m_per_s2\", y = \"ay_m_per_s2\", z = \"az_m_per_s2\" }\n\
    [positions]\nfile = \"positions.csv\"\ngravity = \"9.80665 m/s^2\"\n";

fn calibrated(unit: &Unit, turns: &Turns, seed: u64, text: &str) -> Result<Calibration, CalibrationError> {
    let folder = tempfile::tempdir().unwrap();
    unit.write_positions(&folder.path().join("positions.csv"), turns, seed);
    calibrate(&GyroscopeCalibration::parse(text, &folder.path().join("unit.toml")).unwrap(), &Silent)
}

/// Each number by its name, as the simulation had it.
fn truth(unit: &Unit, turns: &Turns, is_latitude_stated: bool) -> BTreeMap<String, f64> {
    let mut truth = BTreeMap::new();
    let mut put = |name: &str, axes: [&str; 3], values: Vector| {
        for (axis, value) in axes.into_iter().zip(values) {
            truth.insert(format!("{name}_{axis}"), value);
        }
    };
    let (axes, pairs) = (["x", "y", "z"], ["xy", "xz", "yz"]);
    let [scale, angles] = scales_and_angles(&unit.accelerometers);
    put("accelerometer_scale_factor", axes, scale);
    put("accelerometer_non_orthogonality", pairs, angles);
    put("accelerometer_bias", axes, unit.accelerometer_bias);
    let [scale, angles] = scales_and_angles(&unit.gyroscopes);
    put("gyroscope_scale_factor", axes, scale);
    put("gyroscope_non_orthogonality", pairs, angles);
    put("gyroscope_bias", axes, unit.gyroscope_bias);
    // From the accelerometers' axes to the gyroscopes': the antisymmetric part of the rotation between both frames.
    let (of_forces, of_rates) = (frame(&unit.accelerometers), frame(&unit.gyroscopes));
    let turn = |i: usize, j: usize| dot(of_rates[i], of_forces[j]);
    let half = |i: usize, j: usize| 0.5 * (turn(i, j) - turn(j, i));
    put("gyroscope_mounting", axes, [half(1, 2), half(2, 0), half(0, 1)]);
    // The sensitivity is to the force in the accelerometers' frame; the Earth turns a resting unit about the vertical.
    let earth = if is_latitude_stated { 0.0 } else { 7.292e-5 * turns.latitude.sin() / GRAVITY };
    for (i, row) in axes.into_iter().enumerate() {
        for (j, column) in axes.into_iter().enumerate() {
            let value = dot(unit.force_sensitivity[i], of_forces[j]) + if i == j { earth } else { 0.0 };
            truth.insert(format!("gyroscope_force_sensitivity_{row}{column}"), value);
        }
    }
    truth
}

/// How many of these seeds hold each number, and whether each point lies in its own interval.
fn coverage(seeds: std::ops::Range<u64>) -> BTreeMap<String, usize> {
    let text = format!("{FILE}latitude = \"{} rad\"\n", TURNS.latitude);
    let truth = truth(&UNIT, &TURNS, true);
    let mut held: BTreeMap<String, usize> = truth.keys().map(|name| (name.clone(), 0)).collect();
    for seed in seeds {
        let found = calibrated(&UNIT, &TURNS, seed, &text).unwrap();
        let record = &found.records[0];
        assert_eq!(record.quantities.len(), truth.len(), "{:?}", record.not_observed);
        for quantity in &record.quantities {
            let [low, high] = quantity.estimate.interval;
            assert!(low < quantity.estimate.value && quantity.estimate.value < high, "{quantity:?}");
            let value = truth[&quantity.name];
            *held.get_mut(&quantity.name).unwrap() += usize::from(low <= value && value <= high);
        }
    }
    held
}

#[test]
fn positions_give_both_sensors_with_intervals_that_hold_what_was_simulated() {
    let held = coverage(0..6);
    // Three or fewer of six come once in 400 times for one number; all together are 5.7 of six.
    assert!(held.values().all(|held| *held >= 3), "{held:?}");
    let all: usize = held.values().sum();
    assert!(all as f64 >= 0.9 * 6.0 * held.len() as f64, "{all}: {held:?}");
}

#[test]
#[ignore = "400 records; cargo test -p kalmems-applications --test inertial -- --ignored slow_"]
fn slow_intervals_by_positions_hold_95_of_100() {
    let held = coverage(1000..1400);
    assert_95_of_100("positions", held, 400);
}

/// The diagonal of the covariance matrix is that of the standard uncertainties, and the errors of many records have its covariances.
#[test]
fn the_covariance_matrix_is_that_of_the_errors() {
    const RECORDS: u64 = 60;
    let stated = format!("{FILE}gravity_uncertainty = \"0.00980665 m/s^2\"\n");
    let found = calibrated(&UNIT, &TURNS, 3, &stated).unwrap();
    let (quantities, matrix) = (&record(&found).quantities, record(&found).covariance.as_ref().unwrap());
    let names: Vec<&String> = quantities.iter().map(|quantity| &quantity.name).collect();
    assert_eq!(matrix.parameters.iter().collect::<Vec<_>>(), names);
    for (i, quantity) in quantities.iter().enumerate() {
        let own = matrix.matrix[i][i].sqrt();
        assert!((own / quantity.estimate.uncertainty - 1.0).abs() < 1e-9, "{}: {own}", quantity.name);
        for j in 0..i {
            let (entry, other) = (matrix.matrix[i][j], matrix.matrix[j][i]);
            let most = (matrix.matrix[i][i] * matrix.matrix[j][j]).sqrt();
            assert!((entry - other).abs() < 1e-9 * most && entry.abs() < 1.001 * most);
        }
    }
    // Sums and differences of two errors by their standard uncertainties: the mean square of 60 of Student's t with 15 or more degrees of freedom is
    // 1.15 with a standard deviation of 0.25 at most. With the correlations left out it would be near 0 or 2 for numbers that hang together.
    let text = format!("{FILE}latitude = \"{} rad\"\n", TURNS.latitude);
    let truth = truth(&UNIT, &TURNS, true);
    let count = quantities.len();
    let mut squares = vec![vec![0.0; count]; count];
    let mut strong = 0;
    for seed in 600..600 + RECORDS {
        let found = calibrated(&UNIT, &TURNS, seed, &text).unwrap();
        let (own, matrix) = (record(&found), &record(&found).covariance.as_ref().unwrap().matrix);
        let errors: Vec<f64> =
            own.quantities.iter().map(|own| own.estimate.value - truth[&own.name]).collect();
        let unit: Vec<f64> = (0..count).map(|i| matrix[i][i].sqrt()).collect();
        for i in 0..count {
            for j in (0..count).filter(|j| *j != i) {
                let sign = if i < j { 1.0 } else { -1.0 };
                let sum = errors[i] / unit[i] + sign * errors[j] / unit[j];
                let correlation = matrix[i][j] / (unit[i] * unit[j]);
                squares[i][j] += sum * sum / (2.0 + 2.0 * sign * correlation) / RECORDS as f64;
                strong += usize::from(seed == 600 && i < j && correlation.abs() > 0.5);
            }
        }
    }
    let each = || (0..count).flat_map(|i| (0..count).filter(move |j| *j != i).map(move |j| (i, j)));
    let outside: Vec<(&str, &str, f64)> = each()
        .map(|(i, j)| (names[i].as_str(), names[j].as_str(), squares[i][j]))
        .filter(|(.., square)| !(0.3..2.6).contains(square))
        .collect();
    // Some pairs hang together, or the matrix would not be tested beside its diagonal.
    assert!(strong > 0 && outside.is_empty(), "{strong} {outside:?}");
}

fn record(found: &Calibration) -> &RecordOutcome {
    &found.records[0]
}

/// Gravity that is stated with 100 ppm enters the scale factors of the accelerometers in full, and nothing else.
#[test]
fn the_uncertainty_of_gravity_is_that_of_the_scale_factors() {
    let stated = format!("{FILE}gravity_uncertainty = \"0.00980665 m/s^2\"\n");
    let [without, with] = [FILE, &stated].map(|text| calibrated(&UNIT, &TURNS, 3, text).unwrap());
    let of = |found: &Calibration, name: &str| *record(found).estimate(name).unwrap();
    for axis in ["x", "y", "z"] {
        let name = format!("accelerometer_scale_factor_{axis}");
        let (alone, all) = (of(&without, &name), of(&with, &name));
        let expected = alone.uncertainty.hypot(1e-3 * all.value);
        assert!((all.uncertainty / expected - 1.0).abs() < 1e-9, "{all:?}");
        let name = format!("accelerometer_bias_{axis}");
        assert_eq!(of(&without, &name), of(&with, &name));
    }
    let missing = Certificate::of(&without).not_stated;
    assert!(missing.iter().any(|key| key == "positions.gravity_uncertainty"), "{missing:?}");
    assert!(!Certificate::of(&with).not_stated.iter().any(|key| key.starts_with("positions")));
    // The Earth's rotation at a latitude that nobody stated is in the sensitivity to the force along the own axis.
    let own = of(&with, "gyroscope_force_sensitivity_xx");
    assert!(own.uncertainty > 4.2e-6 && own.by_records < own.uncertainty, "{own:?}");
}

/// A unit without gyroscopes: the same nine numbers of the accelerometers, to the last bit but for what is taken as still.
#[test]
fn accelerometers_alone_are_calibrated_without_gyroscopes() {
    let channels = "channels = { x = \"gx_rad_per_s\", y = \"gy_rad_per_s\", z = \"gz_rad_per_s\" }\n";
    let [alone, both] = [FILE.replace(channels, ""), FILE.to_owned()]
        .map(|text| calibrated(&UNIT, &TURNS, 8, &text).unwrap());
    assert_eq!(record(&alone).quantities.len(), 9);
    for quantity in &record(&alone).quantities {
        let other = record(&both).estimate(&quantity.name).unwrap();
        let apart = (quantity.estimate.value - other.value).abs() / other.uncertainty;
        assert!(apart < 0.5, "{quantity:?} {other:?}");
    }
    let missing =
        FILE.replace(channels, "") + "[[condition]]\nname = \"c\"\nfile = \"c.csv\"\nreference = []\n";
    let said =
        GyroscopeCalibration::parse(&missing, std::path::Path::new("unit.toml")).unwrap_err().to_string();
    assert!(said.contains("only a unit of accelerometers that is not shaken has none"), "{said}");
}

#[test]
fn exchanged_and_turned_axes_are_named_and_not_certified() {
    for (from, to, named) in [
        (
            "x = \"gx_rad_per_s\", y = \"gy_rad_per_s\"",
            "x = \"gy_rad_per_s\", y = \"gx_rad_per_s\"",
            "x and y",
        ),
        ("z = \"gz_rad_per_s\"", "z = { column = \"gz_rad_per_s\", scale = -1 }", "gyroscope of z"),
    ] {
        let found = calibrated(&UNIT, &TURNS, 4, &FILE.replace(from, to)).unwrap();
        let warnings = record(&found).warnings.join("\n");
        assert!(warnings.contains(named) && warnings.contains("turns about another axis"), "{warnings}");
        assert!(record(&found).estimate("gyroscope_scale_factor_x").is_none());
        assert!(record(&found).estimate("accelerometer_scale_factor_x").is_some());
        let certificate = Certificate::of(&found);
        assert!(!certificate.valid && certificate.validity.iter().any(|check| !check.passes));
    }
}

/// A unit that shows a force that is 1 % too large in the seventh position.
pub fn moved_in_a_position() -> Calibration {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("positions.csv");
    UNIT.write_positions(&path, &TURNS, 5);
    let text = std::fs::read_to_string(&path).unwrap();
    let row = |position: usize| 1 + position * 320;
    let changed: Vec<String> = text
        .lines()
        .enumerate()
        .map(|(place, line)| {
            if !(row(6)..row(6) + 200).contains(&place) {
                return line.to_owned();
            }
            let mut cells: Vec<f64> = line.split(',').map(|cell| cell.parse().unwrap()).collect();
            (0..3).for_each(|axis| cells[axis] *= 1.01);
            cells.iter().map(ToString::to_string).collect::<Vec<_>>().join(",")
        })
        .collect();
    std::fs::write(&path, changed.join("\n")).unwrap();
    let file = GyroscopeCalibration::parse(FILE, &folder.path().join("unit.toml")).unwrap();
    calibrate(&file, &Silent).unwrap()
}

/// A unit in usual positions, with further keys of its third gyroscope.
pub fn usual(keys: &str) -> Calibration {
    let third = format!("z = {{ column = \"gz_rad_per_s\"{keys} }}");
    calibrated(&UNIT, &TURNS, 4, &FILE.replace("z = \"gz_rad_per_s\"", &third)).unwrap()
}

#[test]
fn a_unit_that_moved_in_a_position_is_named_with_its_time() {
    let found = moved_in_a_position();
    let warnings = record(&found).warnings.join("\n");
    assert!(warnings.contains("position 7 at 19.") && warnings.contains("may have moved"), "{warnings}");
    assert!(!Certificate::of(&found).valid);
}

#[test]
fn what_the_positions_do_not_determine_is_named_with_the_position_to_add() {
    // The third axis stays within 30 degrees of level: nothing tells it well, and the position to add has it upright.
    let found = calibrated(&UNIT, &TURNS, 6, FILE).unwrap();
    let lines = record(&found).not_observed.join("\n");
    assert!(
        lines.contains("a further position") && lines.contains("orientation of the accelerometers"),
        "{lines}"
    );
    let text = CalibrationSummary::of(&found).to_text();
    for part in ["accelerometer scale factor x", "gyroscope mounting z", "Positions at rest", "deg/h/gn"] {
        assert!(text.contains(part), "{part}: {text}");
    }
    let few = calibrated(&UNIT, &Turns { positions: 9, ..TURNS }, 6, FILE).unwrap_err().to_string();
    assert!(few.contains("found 9 positions") && few.contains("expected at least 12"), "{few}");
    let refused = |text: &str| {
        GyroscopeCalibration::parse(text, std::path::Path::new("unit.toml")).unwrap_err().to_string()
    };
    let said = refused(&FILE.replace(", z = \"az_m_per_s2\"", ""));
    assert!(said.contains("positions calibrate three accelerometers"), "{said}");
    let said = refused(&FILE.replace(", z = \"gz_rad_per_s\"", ""));
    assert!(said.contains("three gyroscopes or none"), "{said}");
}

/// A bias, a scale factor and terms of second and third order of each accelerometer, in m/s².
const TUMBLED: [[f64; 4]; 3] =
    [[0.02, 1.01, 4e-6, -6e-7], [-0.03, 0.99, -5e-6, 8e-7], [0.01, 1.005, 7e-6, 9e-7]];

/// Rests of 2 s at these attitudes, with a shake between them.
fn tumbled(attitudes: &[Vector], seed: u64) -> Calibration {
    let folder = tempfile::tempdir().unwrap();
    let mut noise = Noise::new(seed);
    let mut text = "ax_m_per_s2,ay_m_per_s2,az_m_per_s2\n".to_owned();
    for attitude in attitudes {
        for sample in 0..250 {
            let shake = if sample < 200 { 0.0 } else { 2.0 * (0.7 * f64::from(sample)).sin() };
            let shown = attitude.iter().zip(TUMBLED).map(|(part, [bias, scale, square, cube])| {
                let force = GRAVITY * part + shake;
                let shown = bias + scale * force + square * force.powi(2) + cube * force.powi(3);
                format!("{:.7}", shown + 1e-3 * noise.normal())
            });
            text += &(shown.collect::<Vec<_>>().join(",") + "\n");
        }
    }
    std::fs::write(folder.path().join("positions.csv"), text).unwrap();
    let listed: Vec<String> = attitudes.iter().map(|[x, y, z]| format!("[{x:?}, {y:?}, {z:?}]")).collect();
    let text = format!(
        "name = \"unit\"\n[gyroscope]\nrate = \"100 Hz\"\naccelerometers = {{ x = \"ax_m_per_s2\", y = \"ay_m_per_s2\", z = \"az_m_per_s2\" }}\n\
         [positions]\nfile = \"positions.csv\"\ngravity = \"{GRAVITY} m/s^2\"\nattitudes = [{}]\n",
        listed.join(", ")
    );
    calibrate(&GyroscopeCalibration::parse(&text, &folder.path().join("unit.toml")).unwrap(), &Silent)
        .unwrap()
}

/// Directions in steps of 45°, 22.5° apart, in the three planes of two axes.
fn circles() -> Vec<Vector> {
    let on = |k: usize| (std::f64::consts::TAU * (k as f64 + 0.5) / 8.0).sin_cos();
    let each = |k: usize| {
        let (s, c) = on(k);
        [[s, c, 0.0], [0.0, s, c], [c, 0.0, s]]
    };
    (0..8)
        .flat_map(each)
        .chain([[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0], [-1.0, 0.0, 0.0]])
        .collect()
}

/// How often the terms of second and third order of each accelerometer are in their intervals.
fn tumbles_held(seeds: std::ops::Range<u64>) -> BTreeMap<String, usize> {
    let (attitudes, mut held) = (circles(), BTreeMap::new());
    for seed in seeds {
        let found = tumbled(&attitudes, seed);
        for (axis, [_, scale, square, cube]) in ["x", "y", "z"].into_iter().zip(TUMBLED) {
            for (order, value) in [("second", square), ("third", cube)] {
                let name = format!("accelerometer_{order}_order_{axis}");
                let of = record(&found).estimate(&name).unwrap();
                let [low, high] = of.interval;
                assert!(low < of.value && of.value < high, "{name}: {of:?}");
                // An interval as wide as twice the number would hold it whatever is found.
                assert!(of.expanded() < value.abs(), "{name}: {of:?}");
                *held.entry(name).or_default() += usize::from((low..high).contains(&(value / scale)));
            }
        }
    }
    held
}

/// IEEE Std 1293: the terms of second and third order from stated attitudes; 60 intervals of 95 %, of which 51 or fewer hold once in 700 times.
#[test]
fn known_attitudes_give_the_terms_of_second_and_third_order() {
    let held: usize = tumbles_held(900..910).values().sum();
    assert!(held > 51, "{held}");
}

#[test]
#[ignore = "200 records; cargo test -p kalmems-applications --test inertial -- --ignored slow_"]
fn slow_intervals_by_known_attitudes_hold_95_of_100() {
    assert_95_of_100("attitudes", tumbles_held(1000..1200), 200);
}

/// An axis that is only level or 45° to either side has no term of third order: it is named, those of the other axes stay.
#[test]
fn attitudes_that_do_not_determine_a_term_are_named() {
    let half = std::f64::consts::FRAC_1_SQRT_2;
    let each = |k: u32| {
        let (s, c) = (std::f64::consts::TAU * (f64::from(k) + 0.5) / 9.0).sin_cos();
        [[0.0, s, c], [half, half * s, half * c], [-half, half * s, half * c]]
    };
    let attitudes: Vec<Vector> = (0..9).flat_map(each).collect();
    let found = tumbled(&attitudes, 5);
    let record = record(&found);
    assert!(record.estimate("accelerometer_third_order_x").is_none());
    assert!(record.estimate("accelerometer_second_order_x").is_some());
    assert!(record.estimate("accelerometer_third_order_z").is_some());
    let missing = |part: &str| record.not_observed.iter().any(|why| why.contains(part));
    assert!(missing("the term of third order of the accelerometer x"), "{:?}", record.not_observed);
}

/// Of the accelerometers by K and about 300 K: scale factors, angles and biases.
const BY_KELVIN: [f64; 3] = [8e-5, -4e-5, 6e-4];

/// The unit at a temperature: the diagonal and the off-diagonal entries of the accelerometers' matrix, and their biases.
fn at_kelvin(kelvin: f64) -> Unit {
    let off = kelvin - 300.0;
    let mut unit = UNIT;
    for (i, row) in unit.accelerometers.iter_mut().enumerate() {
        for (j, entry) in row.iter_mut().enumerate() {
            *entry += off * BY_KELVIN[usize::from(i != j)];
        }
    }
    unit.accelerometer_bias = unit.accelerometer_bias.map(|bias| bias + off * BY_KELVIN[2]);
    unit
}

const KELVIN: [f64; 6] = [270.0, 282.0, 294.0, 306.0, 318.0, 330.0];

/// The accelerometers of the unit in positions at six temperatures.
fn at_temperatures(seed: u64) -> Calibration {
    let folder = tempfile::tempdir().unwrap();
    let gyroscopes = "channels = { x = \"gx_rad_per_s\", y = \"gy_rad_per_s\", z = \"gz_rad_per_s\" }\n";
    let mut text = FILE.replace(gyroscopes, "").split("[positions]").next().unwrap().to_owned();
    for (place, kelvin) in KELVIN.into_iter().enumerate() {
        let (file, table) =
            (format!("{kelvin}.csv"), if place == 0 { "[positions]" } else { "[[further_positions]]" });
        at_kelvin(kelvin).write_positions(&folder.path().join(&file), &TURNS, 10 * seed + place as u64);
        text += &format!(
            "{table}\nfile = \"{file}\"\ngravity = \"9.80665 m/s^2\"\ntemperature = \"{kelvin} K\"\n"
        );
    }
    text += "[positions_over_temperature]\norder = 1\nreference = \"300 K\"\n";
    calibrate(&GyroscopeCalibration::parse(&text, &folder.path().join("unit.toml")).unwrap(), &Silent)
        .unwrap()
}

/// How often the lines over the temperature hold the value at 300 K and the slope that was put in.
fn temperatures_held(seeds: std::ops::Range<u64>) -> BTreeMap<String, usize> {
    let mut held = BTreeMap::new();
    let [cold, warm] = [299.0, 301.0].map(|kelvin| truth(&at_kelvin(kelvin), &TURNS, true));
    for seed in seeds {
        let found = at_temperatures(seed);
        let over = found.records.iter().find(|record| record.kind == "positions_over_temperature").unwrap();
        assert_eq!(over.compensation.len(), 9);
        for (name, value) in
            truth(&UNIT, &TURNS, true).into_iter().filter(|(name, _)| name.starts_with("acc"))
        {
            for (ending, value) in [("0", value), ("1", 0.5 * (warm[&name] - cold[&name]))] {
                let name = format!("{name}_{ending}");
                let estimate =
                    over.estimate(&name).unwrap_or_else(|| panic!("{name}: {:?}", over.not_observed));
                let [low, high] = estimate.interval;
                assert!(low < estimate.value && estimate.value < high, "{name} {estimate:?}");
                *held.entry(name).or_default() += usize::from(low <= value && value <= high);
            }
        }
    }
    held
}

#[test]
fn positions_at_several_temperatures_give_accelerometers_over_the_temperature() {
    let held = temperatures_held(0..8);
    // Four or fewer of eight come once in 2700 times for one number.
    assert!(held.len() == 18 && held.values().all(|held| *held >= 5), "{held:?}");
    let without = FILE.to_owned() + "[[further_positions]]\nfile = \"b.csv\"\ngravity = \"9.8 m/s^2\"\n";
    let said =
        GyroscopeCalibration::parse(&without, std::path::Path::new("unit.toml")).unwrap_err().to_string();
    assert!(said.contains("several records of positions") && said.contains("`temperature`"), "{said}");
}

#[test]
#[ignore = "1200 records; cargo test -p kalmems-applications --test inertial -- --ignored slow_"]
fn slow_intervals_of_positions_over_the_temperature_hold_95_of_100() {
    assert_95_of_100("positions over the temperature", temperatures_held(1000..1200), 200);
}
