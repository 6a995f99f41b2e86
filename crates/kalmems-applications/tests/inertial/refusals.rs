//! Records that the models do not describe: what is found is named, and no number is certified that does not hold.

use super::simulated::{Noise, TURNS, UNIT};
use kalmems_applications::ApplicationFile;
use kalmems_applications::calibration::{
    Calibration, CalibrationError, Certificate, GyroscopeCalibration, calibrate, calibrate_with_parts,
    calibration_figures,
};
use kalmems_engines::progress::Silent;
use kalmems_figures::{Panel, SeriesRole, Shape};
use std::f64::consts::TAU;
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

fn calibrated(text: &str, folder: &Path) -> Result<Calibration, CalibrationError> {
    calibrate(&GyroscopeCalibration::parse(text, &folder.join("file.toml")).unwrap(), &Silent)
}

/// A gyroscope behind a low pass of 200 Hz, shaken at five frequencies, three records at each.
#[test]
fn a_scale_factor_that_depends_on_the_frequency_is_withheld_and_given_for_each_frequency() {
    const CORNER: f64 = 200.0;
    /// Codes by deg/s.
    const CODES: f64 = 131.0;
    let folder = tempfile::tempdir().unwrap();
    let mut noise = Noise::new(11);
    let [mut shown, mut reference] = ["record,g\n".to_owned(), "record,r_rad_per_s\n".to_owned()];
    let frequencies = [20.0, 40.0, 80.0, 120.0, 180.0];
    for record in 0..15 {
        let frequency: f64 = frequencies[record / 3];
        let gain = 1.01 / 1.0_f64.hypot(frequency / CORNER) * (1.0 + 1e-4 * noise.normal());
        let [a, b] = [0, 1].map(|_| TAU * noise.uniform());
        for k in 0..1500 {
            let at = |rate: f64, start: f64| (TAU * frequency * f64::from(k) / rate + start).cos();
            let codes = CODES.to_degrees() * (gain * at(1000.0, a) + 1e-3 * noise.normal());
            writeln!(shown, "r{record},{codes:.4}").unwrap();
            writeln!(reference, "r{record},{:.8}", at(2000.0, b) + 1e-4 * noise.normal()).unwrap();
        }
    }
    fs::write(folder.path().join("g.csv"), shown).unwrap();
    fs::write(folder.path().join("r.csv"), reference).unwrap();
    let found = calibrated(
        "name = \"c\"\n[sensor]\nrate = \"1 kHz\"\nclock_tolerance = \"1 %\"\n\
         channels = { z = { column = \"g\", sensitivity = \"131 LSB/(deg/s)\" } }\n\
         [[condition]]\nname = \"room\"\nfile = \"g.csv\"\nsegments = { column = \"record\" }\n\
         [[condition.reference]]\nname = \"table\"\nfile = \"r.csv\"\nsegments = { column = \"record\" }\n\
         clock = { rate = \"2 kHz\" }\nchannels = { z = \"r_rad_per_s\" }\n",
        folder.path(),
    )
    .unwrap();
    let [result] = &found.results[..] else { panic!("one result") };
    assert!(result.withheld.as_ref().is_some_and(|why| why.contains("frequenc")), "{:?}", result.withheld);
    let by_frequency: Vec<f64> = result.by_frequency.iter().map(|one| one.scale_factor.value).collect();
    assert_eq!(by_frequency.len(), frequencies.len(), "{by_frequency:?}");
    for (found, frequency) in by_frequency.iter().zip(frequencies) {
        assert!((found * 1.0_f64.hypot(frequency / CORNER) / 1.01 - 1.0).abs() < 5e-4, "{by_frequency:?}");
    }
    // The same in codes by rad/s.
    let [codes] = &found.records[..] else { panic!("{:?}", found.records) };
    for (at, (quantity, frequency)) in
        result.by_frequency.iter().zip(codes.quantities.iter().zip(frequencies))
    {
        let own = at.scale_factor;
        let expected =
            [own.value, own.uncertainty, own.interval[0]].map(|number| number * CODES.to_degrees());
        assert_eq!(quantity.name, format!("sensitivity_z_at_{frequency:.2}_hz"));
        let found = quantity.estimate;
        for (found, expected) in [found.value, found.uncertainty, found.interval[0]].into_iter().zip(expected)
        {
            assert!((found / expected - 1.0).abs() < 1e-9, "{found} {expected}");
        }
    }
}

#[test]
fn a_saturated_record_at_rest_is_refused_by_its_column() {
    let folder = tempfile::tempdir().unwrap();
    let mut noise = Noise::new(12);
    let mut rows = "a_rad_per_s,b_rad_per_s\n".to_owned();
    for _ in 0..4096 {
        let [a, b] = [0, 1].map(|_| 1e-2 * noise.normal());
        writeln!(rows, "{a:.8},{:.8}", b.clamp(-8e-3, 8e-3)).unwrap();
    }
    fs::write(folder.path().join("rest.csv"), rows).unwrap();
    let file = |column: &str| {
        let text = "name = \"r\"\n[sensor]\nrate = \"10 Hz\"\nchannels = { z = \"COLUMN\" }\n[rest]\nfile = \"rest.csv\"\n";
        calibrated(&text.replace("COLUMN", column), folder.path())
    };
    assert!(file("a_rad_per_s").is_ok());
    let refused = file("b_rad_per_s").unwrap_err().to_string();
    assert!(refused.contains("b_rad_per_s") && refused.contains("clipped"), "{refused}");
    // Its parts are drawn all the same.
    let text = "name = \"r\"\n[sensor]\nrate = \"10 Hz\"\nchannels = { z = \"b_rad_per_s\" }\n[rest]\nfile = \"rest.csv\"\n";
    let refused = GyroscopeCalibration::parse(text, &folder.path().join("file.toml")).unwrap();
    let mut parts = Vec::new();
    assert!(calibrate_with_parts(&refused, &Silent, &mut parts).is_err());
    assert!(parts.len() == 1 && parts[0].id == "rest" && parts[0].panels[0].series.len() == 1);
    // What the range is stated to be, of the unit or of the column.
    let stated = "{ column = \"a_rad_per_s\", full_scale = \"0.02 rad/s\" }";
    let of_column = format!(
        "name = \"r\"\n[sensor]\nrate = \"10 Hz\"\nchannels = {{ z = {stated} }}\n[rest]\nfile = \"rest.csv\"\n"
    );
    let of_unit =
        of_column.replace(stated, "\"a_rad_per_s\"").replace("[rest]", "full_scale = \"0.02 rad/s\"\n[rest]");
    for text in [of_column, of_unit] {
        let refused = calibrated(&text, folder.path()).unwrap_err().to_string();
        assert!(refused.contains("a_rad_per_s") && refused.contains("clipped"), "{refused}");
        assert!(calibrated(&text.replace("0.02 rad/s", "0.2 rad/s"), folder.path()).is_ok());
    }
}

fn inertial_unit() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/inertial_unit")
}

/// A calibration file with one record of each kind alone, of the example of an inertial unit.
fn a_file_of_each_kind() -> [(&'static str, toml::Table); 5] {
    let kinds = [
        ("unit.toml", "rest"),
        ("unit.toml", "positions"),
        ("table.toml", "rates"),
        ("table.toml", "temperature"),
        ("motion.toml", "turns"),
    ];
    kinds.map(|(file, kind)| {
        let text = fs::read_to_string(inertial_unit().join(file)).unwrap();
        let mut table: toml::Table = text.parse().unwrap();
        table.retain(|key, _| ["name", "sensor", kind].contains(&key));
        (kind, table)
    })
}

#[test]
fn a_range_that_ends_refuses_a_record_of_each_kind() {
    for (kind, file) in a_file_of_each_kind() {
        let with_range = |range: &str| {
            let mut table = file.clone();
            table["sensor"].as_table_mut().unwrap().insert("full_scale".to_owned(), range.into());
            calibrated(&table.to_string(), &inertial_unit())
        };
        let refused = with_range("0.001 deg/s").unwrap_err().to_string();
        assert!(refused.contains("_dps") && refused.contains("clipped"), "{kind}: {refused}");
        assert!(with_range("10000 deg/s").is_ok(), "{kind}");
    }
}

/// Of a record of each kind, with the code that instruments write beyond their range in one cell of a sensor: refused where every sample counts,
/// and elsewhere left out and named.
#[test]
fn an_overload_code_is_refused_or_named_in_a_record_of_each_kind() {
    for (kind, file) in a_file_of_each_kind() {
        let place = tempfile::tempdir().unwrap();
        let records = match &file[kind] {
            toml::Value::Array(records) => records.clone(),
            one => vec![one.clone()],
        };
        for record in records {
            let name = record["file"].as_str().unwrap();
            let rows = fs::read_to_string(inertial_unit().join(name)).unwrap();
            let mut lines: Vec<String> = rows.lines().map(str::to_owned).collect();
            let gyroscope =
                lines[0].split(',').position(|column| column.contains("_dps") && column.starts_with('g'));
            let middle = lines.len() / 2;
            let mut cells: Vec<&str> = lines[middle].split(',').collect();
            cells[gyroscope.unwrap()] = "9.9E37";
            lines[middle] = cells.join(",");
            fs::write(place.path().join(name), lines.join("\n") + "\n").unwrap();
        }
        let said = match calibrated(&file.to_string(), place.path()) {
            Ok(found) => found.findings.join("\n"),
            Err(refused) => refused.to_string(),
        };
        assert!(
            said.contains("_dps") && (said.contains("clipped") || said.contains("beyond the range")),
            "{kind}: {said}"
        );
    }
}

/// A shake from 300 to 320 s; that and no other part of the record is drawn as one that moves.
#[test]
fn the_still_and_the_moving_parts_of_a_record_at_rest_are_drawn() {
    let folder = tempfile::tempdir().unwrap();
    let mut noise = Noise::new(16);
    let mut rows = "g_rad_per_s\n".to_owned();
    for k in 0..8192 {
        let shake = if (3000..3200).contains(&k) { 1e-2 * (0.4 * f64::from(k)).sin() } else { 0.0 };
        writeln!(rows, "{:.8}", 0.01 + shake + 1e-3 * noise.normal()).unwrap();
    }
    fs::write(folder.path().join("rest.csv"), rows).unwrap();
    let text = "name = \"r\"\n[sensor]\nrate = \"10 Hz\"\nchannels = { z = \"g_rad_per_s\" }\n[rest]\nfile = \"rest.csv\"\n";
    let figures = calibration_figures(&calibrated(text, folder.path()).unwrap());
    let panel = &figures.iter().find(|figure| figure.id == "rest").unwrap().panels[0];
    let spans = |role: SeriesRole| -> Vec<[f64; 2]> {
        let of_role = panel.series.iter().filter(|series| series.role() == role);
        let runs = of_role
            .filter_map(|series| if let Shape::Band(runs) = series.shape() { Some(runs) } else { None });
        runs.flatten().map(|run| [run[0][0], run[run.len() - 1][0]]).collect()
    };
    let moving = spans(SeriesRole::Failure);
    assert!(moving.iter().all(|[from, to]| *from > 290.0 && *to < 330.0), "{moving:?}");
    assert!(moving[0][0] < 301.0 && moving[moving.len() - 1][1] > 319.0, "{moving:?}");
    let [[first, last]] = spans(SeriesRole::Measured)[..] else { panic!("one band") };
    assert!(first < 1e-9 && last > 819.0, "{first} {last}");
    assert!(spans(SeriesRole::Bound).is_empty());
}

/// The records of a condition and of sines are drawn with their still parts, also if they are refused.
#[test]
fn records_under_vibration_are_drawn_with_their_still_parts() {
    let found = upright();
    let figures = calibration_figures(&found);
    let drawn = figures.iter().find(|figure| figure.id == "parts-room").unwrap();
    // Twelve records of three axes, none of them still.
    assert_eq!(drawn.panels[0].series.len(), 36);
    let folder = tempfile::tempdir().unwrap();
    let mut noise = Noise::new(38);
    let (mut shown, mut reference) = ("record,x\n".to_owned(), "record,rx\n".to_owned());
    for k in 0..6000 {
        // At rest for three seconds before the sine.
        let rate = if k < 3000 { 0.0 } else { (TAU * 50.0 * f64::from(k) / 1000.0).sin() };
        writeln!(shown, "a,{:.7}", rate + 1e-3 * noise.normal()).unwrap();
        writeln!(reference, "a,{:.7}", rate + 1e-3 * noise.normal()).unwrap();
    }
    fs::write(folder.path().join("g.csv"), shown).unwrap();
    fs::write(folder.path().join("r.csv"), reference).unwrap();
    let text = "name = \"c\"\n[sensor]\nrate = \"1 kHz\"\nclock_tolerance = \"1 %\"\nchannels = { x = { column = \"x\", unit = \"rad/s\" } }\n\
        [[condition]]\nname = \"room\"\nfile = \"g.csv\"\nsegments = { column = \"record\" }\n\
        [[condition.reference]]\nname = \"table\"\nfile = \"r.csv\"\nsegments = { column = \"other\" }\n\
        clock = { rate = \"1 kHz\" }\nchannels = { x = { column = \"rx\", unit = \"rad/s\" } }\n";
    let file = GyroscopeCalibration::parse(text, &folder.path().join("file.toml")).unwrap();
    let mut parts = Vec::new();
    assert!(calibrate_with_parts(&file, &Silent, &mut parts).is_err());
    let still = lines_of_estimates(&parts[0].panels[0]);
    let [[from, to]] = still[..] else { panic!("{still:?}") };
    assert!(from < 0.1 && (2.9..3.001).contains(&to), "{from} {to}");
    // The example's sweep rests at its beginning and its end.
    let text = fs::read_to_string(inertial_unit().join("motion.toml")).unwrap();
    let figures = calibration_figures(&calibrated(&text, &inertial_unit()).unwrap());
    let still = lines_of_estimates(&figures.iter().find(|figure| figure.id == "sine-x").unwrap().panels[0]);
    let [[first, start], [end, last]] = still[..] else { panic!("{still:?}") };
    assert!(first < 0.1 && start < 0.6 && end > 11.5 && last > 12.8, "{still:?}");
}

/// From where to where the lines of the parts that were taken go.
fn lines_of_estimates(panel: &Panel) -> Vec<[f64; 2]> {
    let of_role = panel.series.iter().filter(|series| series.role() == SeriesRole::Estimate);
    let lines =
        of_role.filter_map(|series| if let Shape::Line(line) = series.shape() { Some(line) } else { None });
    lines.flatten().map(|points| [points[0][0], points[points.len() - 1][0]]).collect()
}

/// Several files of one unit are pooled; a name that is not there is named with those that are.
#[test]
fn records_at_rest_in_several_files_are_pooled() {
    let folder = tempfile::tempdir().unwrap();
    let mut noise = Noise::new(13);
    for (name, bias) in [("a", 0.01), ("b", 0.012), ("c", 0.011)] {
        let mut rows = "g_rad_per_s\n".to_owned();
        for _ in 0..4096 {
            writeln!(rows, "{:.8}", bias + 1e-3 * noise.normal()).unwrap();
        }
        fs::write(folder.path().join(format!("rest_{name}.csv")), rows).unwrap();
    }
    let text = "name = \"r\"\n[sensor]\nrate = \"10 Hz\"\nchannels = { z = \"g_rad_per_s\" }\n\
                [rest]\nfile = \"rest_{record}.csv\"\nrecords = [\"a\", \"b\", \"c\"]\n";
    let found = calibrated(text, folder.path()).unwrap();
    let rest = &found.rest[0];
    assert_eq!((rest.records, rest.samples, rest.bias_freedom), (3, 3 * 4096, 2.0));
    assert!((rest.bias - 0.011).abs() < 5e-5 && (rest.bias_uncertainty - 1e-3 / 3.0_f64.sqrt()).abs() < 5e-5);
    let [low, high] = rest.angle_random_walk_interval.unwrap();
    let walk = 1e-3 / 10.0_f64.sqrt();
    assert!(low < walk && walk < high && (high - low) / walk < 0.1, "{low} {high} {walk}");
    let unnamed = text.replace("records = [\"a\", \"b\", \"c\"]\n", "");
    let refused = GyroscopeCalibration::parse(&unnamed, &folder.path().join("file.toml")).unwrap_err();
    assert!(refused.to_string().contains("needs their names"), "{refused}");
}

/// White noise that is averaged over eight samples, which is no low pass of first order: the fit begins beyond, and that is said.
#[test]
fn a_fit_that_holds_at_long_averaging_times_only_says_from_when() {
    const WALK: f64 = 1e-3;
    let folder = tempfile::tempdir().unwrap();
    let text = "name = \"r\"\n[sensor]\nrate = \"10 Hz\"\nchannels = { z = \"g_rad_per_s\" }\n[rest]\nfile = \"rest.csv\"\n";
    let mut held = 0;
    for seed in 0..8 {
        let mut noise = Noise::new(seed);
        let white: Vec<f64> = (0..8200).map(|_| WALK * 10.0_f64.sqrt() * noise.normal()).collect();
        let mut rows = "g_rad_per_s\n".to_owned();
        for part in white.windows(8) {
            writeln!(rows, "{:.8}", 0.02 + part.iter().sum::<f64>() / 8.0).unwrap();
        }
        fs::write(folder.path().join("rest.csv"), rows).unwrap();
        let found = calibrated(text, folder.path()).unwrap();
        let fit = found.rest[0].noise_fit.unwrap();
        assert!(fit.left_out > 0 && fit.from_s >= 0.2, "{fit:?}");
        let said = found.findings.join("; ");
        assert!(said.contains(&format!("begins at an averaging time of {:.4} s", fit.from_s)), "{said}");
        let [low, high] = found.rest[0].angle_random_walk_interval.unwrap();
        held += usize::from(low < WALK && WALK < high);
    }
    // Four or fewer of eight come once in 2700 times.
    assert!(held >= 5, "{held}");
}

/// Three parts of a record with a line, of which samples are missing in one place.
#[test]
fn a_line_in_a_record_at_rest_is_subtracted_where_that_is_asked_for() {
    const WALK: f64 = 1e-3;
    let folder = tempfile::tempdir().unwrap();
    let write = |wander: f64| {
        let mut noise = Noise::new(14);
        let (mut rows, mut phase) = ("g_rad_per_s\n".to_owned(), 0.0);
        for k in 0..150_000 {
            phase += TAU * (0.0317 + wander * (TAU * f64::from(k) / 30_000.0).sin());
            let value = 0.01 + 2e-3 * phase.cos() + WALK * 10.0_f64.sqrt() * noise.normal();
            if (70_000..70_400).contains(&k) {
                writeln!(rows, "nan").unwrap();
            } else {
                writeln!(rows, "{value:.8}").unwrap();
            }
        }
        fs::write(folder.path().join("rest.csv"), rows).unwrap();
    };
    let text = "name = \"r\"\n[sensor]\nrate = \"10 Hz\"\nchannels = { z = \"g_rad_per_s\" }\n[rest]\nfile = \"rest.csv\"\n";
    let asked = format!("{text}subtract_lines = true\n");
    write(0.0);
    let without = calibrated(text, folder.path()).unwrap();
    assert!(
        without.rest_motions.join("; ").contains("Hz stands out") && without.rest[0].subtracted.is_empty()
    );
    let found = calibrated(&asked, folder.path()).unwrap();
    assert_eq!(found.rest_motions, [""; 0]);
    let rest = &found.rest[0];
    let [[frequency, amplitude]] = rest.subtracted[..] else { panic!("{:?}", rest.subtracted) };
    assert!(
        (frequency - 0.317).abs() < 1e-4 && (amplitude / 2e-3 - 1.0).abs() < 0.2,
        "{frequency} {amplitude}"
    );
    let [low, high] = rest.angle_random_walk_interval.unwrap();
    assert!(low < WALK && WALK < high && (high - low) < 0.02 * WALK, "{low} {high}");
    assert!(found.findings.join("; ").contains("one line of its spectrum"), "{:?}", found.findings);
    assert!(Certificate::of(&found).method.contains("were fitted by sines"));
    assert!((rest.noise / (WALK * 10.0_f64.sqrt()) - 1.0).abs() < 0.01, "{}", rest.noise);
    // Each difference at half a cycle has the noise alone.
    let at = rest.deviations.iter().find(|d| d.averaged.factor == 16).unwrap();
    assert!((at.averaged.deviation / (WALK / 1.6_f64.sqrt()) - 1.0).abs() < 0.02, "{at:?}");
    // A line whose frequency wanders is none that a sine takes off.
    write(2e-4);
    let wandering = calibrated(&asked, folder.path()).unwrap();
    assert!(wandering.rest_motions.join("; ").contains("Hz stands out"), "{:?}", wandering.rest_motions);
}

/// The unit is shaken about x and y, beside a reference whose second axis is turned towards the first by this angle, and lies in positions.
pub fn shaken_and_in_positions(angle: f64) -> Calibration {
    let folder = tempfile::tempdir().unwrap();
    let mut noise = Noise::new(15);
    UNIT.write_positions(&folder.path().join("positions.csv"), &TURNS, 15);
    let mut shown =
        "record,gx_rad_per_s,gy_rad_per_s,gz_rad_per_s,ax_m_per_s2,ay_m_per_s2,az_m_per_s2\n".to_owned();
    let mut reference = "record,x_rad_per_s,y_rad_per_s\n".to_owned();
    for record in 0..8 {
        let [a, b, apart] = [TAU * noise.uniform(), TAU * noise.uniform(), 0.8 * f64::from(record)];
        let sizes = [1.0, 0.4 + 0.15 * f64::from(record)];
        for k in 0..1500 {
            let rate = |start: f64| {
                let turn = TAU * 20.0 * f64::from(k) / 1000.0 + start;
                [sizes[0] * turn.cos(), sizes[1] * (turn + apart).cos(), 0.0]
            };
            let true_rate = rate(a);
            let [x, y, z] = UNIT
                .gyroscopes
                .map(|row| row[0] * true_rate[0] + row[1] * true_rate[1] + 1e-3 * noise.normal());
            let [ax, ay, az] = [0.0, 0.0, 9.8].map(|mean| mean + 1e-2 * noise.normal());
            writeln!(shown, "r{record},{x:.8},{y:.8},{z:.8},{ax:.6},{ay:.6},{az:.6}").unwrap();
            let [along, across, _] = rate(b);
            let [x, y] =
                [along, across * angle.cos() + along * angle.sin()].map(|rate| rate + 1e-4 * noise.normal());
            writeln!(reference, "r{record},{x:.8},{y:.8}").unwrap();
        }
    }
    fs::write(folder.path().join("g.csv"), shown).unwrap();
    fs::write(folder.path().join("r.csv"), reference).unwrap();
    let text = "name = \"c\"\n[sensor]\nrate = \"1 kHz\"\nclock_tolerance = \"1 %\"\n\
        channels = { x = \"gx_rad_per_s\", y = \"gy_rad_per_s\", z = \"gz_rad_per_s\" }\n\
        accelerometers = { x = \"ax_m_per_s2\", y = \"ay_m_per_s2\", z = \"az_m_per_s2\" }\n\
        [[condition]]\nname = \"room\"\nfile = \"g.csv\"\nsegments = { column = \"record\" }\n\
        [[condition.reference]]\nname = \"table\"\nfile = \"r.csv\"\nsegments = { column = \"record\" }\n\
        clock = { rate = \"1 kHz\" }\nchannels = { x = \"x_rad_per_s\", y = \"y_rad_per_s\" }\n\
        [positions]\nfile = \"positions.csv\"\ngravity = \"9.80665 m/s^2\"\nclock = { rate = \"100 Hz\" }\n";
    calibrated(text, folder.path()).unwrap()
}

#[test]
fn a_reference_whose_axes_are_not_square_is_named_where_positions_tell_the_angles() {
    for (angle, is_square) in [(0.0, true), (0.02, false)] {
        let found = shaken_and_in_positions(angle);
        let certificate = Certificate::of(&found);
        let checks = certificate.validity.iter().filter(|check| check.what.contains("that by the positions"));
        let checks: Vec<_> = checks.collect();
        let [check] = &checks[..] else { panic!("{:?}", certificate.validity) };
        assert_eq!(check.passes, is_square, "{angle}: {check:?}");
        let said = found.results[0].warnings.join("; ");
        assert_eq!(said.contains("the axes of the reference are not square"), !is_square, "{angle}: {said}");
    }
}

/// Amplitudes about x, y and z of one record in rad/s, its frequency in Hz, and what all axes show times the rate of the case.
pub struct Shaken {
    pub rates: [f64; 3],
    pub frequency: f64,
    pub gain: f64,
    /// The second harmonic of the motion by its amplitude.
    pub harmonic: f64,
}

/// Writes what a unit with this matrix and a table show in each of these records.
fn write_shaken(folder: &Path, matrix: [[f64; 3]; 3], records: &[Shaken], seed: u64) {
    let mut noise = Noise::new(seed);
    let mut shown = "record,x,y,z\n".to_owned();
    let mut reference = "record,rx,ry,rz\n".to_owned();
    for (record, Shaken { rates, frequency, gain, harmonic }) in records.iter().enumerate() {
        let [a, b] = [0, 1].map(|_| TAU * noise.uniform());
        for k in 0..1000 {
            let at = |rate: f64, start: f64| {
                let turn = TAU * frequency * f64::from(k) / rate + start;
                turn.cos() + harmonic * (2.0 * turn).cos()
            };
            let axes = matrix.map(|row| {
                let rate: f64 = row.iter().zip(rates).map(|(entry, rate)| entry * rate).sum();
                gain * rate * at(1000.0, a) + 1e-4 * noise.normal()
            });
            let known = rates.map(|rate| rate * at(2000.0, b) + 1e-4 * noise.normal());
            writeln!(shown, "r{record},{:.7},{:.7},{:.7}", axes[0], axes[1], axes[2]).unwrap();
            writeln!(reference, "r{record},{:.7},{:.7},{:.7}", known[0], known[1], known[2]).unwrap();
        }
    }
    fs::write(folder.join("g.csv"), shown).unwrap();
    fs::write(folder.join("r.csv"), reference).unwrap();
}

/// Three columns in rad/s, those of a reference times a factor.
fn channels(names: [&str; 3], factor: f64) -> String {
    let each = ["x", "y", "z"].into_iter().zip(names).map(|(axis, name)| {
        format!("{axis} = {{ column = \"{name}\", unit = \"rad/s\", scale = {factor} }}")
    });
    format!("{{ {} }}", each.collect::<Vec<_>>().join(", "))
}

/// The table as a reference with this name, whose column is multiplied by a factor.
fn table(name: &str, factor: f64, uncertainty: &str) -> String {
    format!(
        "[[condition.reference]]\nname = \"{name}\"\nfile = \"r.csv\"\nsegments = {{ column = \"record\" }}\n\
         clock = {{ rate = \"2 kHz\" }}\nchannels = {}\nuncertainty = {{ {uncertainty} }}\n",
        channels(["rx", "ry", "rz"], factor)
    )
}

/// A condition with these references, and further tables of the calibration file.
fn shaken_by(folder: &Path, references: &str, more: &str) -> Calibration {
    let text = format!(
        "name = \"c\"\n[sensor]\nrate = \"1 kHz\"\nclock_tolerance = \"1 %\"\nchannels = {}\n\
         [[condition]]\nname = \"room\"\nfile = \"g.csv\"\nsegments = {{ column = \"record\" }}\n{references}{more}",
        channels(["x", "y", "z"], 1.0),
    );
    calibrated(&text, folder).unwrap()
}

/// A unit that shows `matrix` times the rates of a table in each of these records.
pub fn shaken(matrix: [[f64; 3]; 3], records: &[Shaken], uncertainty: &str, seed: u64) -> Calibration {
    let folder = tempfile::tempdir().unwrap();
    write_shaken(folder.path(), matrix, records, seed);
    shaken_by(folder.path(), &table("table", 1.0, uncertainty), "")
}

/// Turns about directions between the axes, each three times.
pub fn oblique() -> Vec<Shaken> {
    let directions = [[1.0, 0.5, 0.2], [-0.4, 1.0, 0.3], [0.3, -0.2, 1.0], [0.7, 0.7, -0.5]];
    let records = (0..12).map(|k| Shaken { rates: directions[k % 4], ..SHAKEN });
    records.collect()
}

/// A record about y.
pub const SHAKEN: Shaken = Shaken { rates: [0.0, 1.0, 0.0], frequency: 50.0, gain: 1.0, harmonic: 0.0 };

/// A unit whose axes are as they are named.
pub fn upright() -> Calibration {
    shaken(UPRIGHT, &oblique(), "", 36)
}

pub fn with_turned_axis() -> Calibration {
    let [x, y, z] = UPRIGHT;
    shaken([x, y.map(|entry| -entry), z], &oblique(), "", 36)
}

/// A motion with a second harmonic of this part.
pub fn with_harmonic(harmonic: f64) -> Calibration {
    let records: Vec<Shaken> = oblique().into_iter().map(|own| Shaken { harmonic, ..own }).collect();
    shaken(UPRIGHT, &records, "", 36)
}

/// The same table as two references, the second one larger by a factor.
pub fn by_two_references(factor: f64) -> Calibration {
    let folder = tempfile::tempdir().unwrap();
    write_shaken(folder.path(), UPRIGHT, &oblique(), 36);
    let references = [("first", 1.0), ("second", factor)].map(|(name, factor)| table(name, factor, ""));
    shaken_by(folder.path(), &references.concat(), "")
}

/// A unit that has this bias at rest, and none under vibration.
pub fn shaken_and_at_rest(bias: f64) -> Calibration {
    let folder = tempfile::tempdir().unwrap();
    write_shaken(folder.path(), UPRIGHT, &oblique(), 36);
    let mut noise = Noise::new(37);
    let mut rows = "x,y,z\n".to_owned();
    for _ in 0..4096 {
        let [x, y, z] = [0, 1, 2].map(|_| bias + 1e-4 * noise.normal());
        writeln!(rows, "{x:.7},{y:.7},{z:.7}").unwrap();
    }
    fs::write(folder.path().join("rest.csv"), rows).unwrap();
    shaken_by(folder.path(), &table("table", 1.0, ""), "[rest]\nfile = \"rest.csv\"\n")
}

/// One record at each frequency, of a factor that falls with the frequency.
pub fn by_frequency(uncertainty: &str) -> Calibration {
    shaken(UPRIGHT, &falling_with_frequency(1), uncertainty, 35)
}

/// So many records at each of five frequencies.
pub fn falling_with_frequency(each: u32) -> Vec<Shaken> {
    let at = |k: u32| Shaken {
        frequency: 30.0 + 20.0 * f64::from(k / each),
        gain: 1.0 - 0.02 * f64::from(k / each),
        ..SHAKEN
    };
    (0..5 * each).map(at).collect()
}

pub const UPRIGHT: [[f64; 3]; 3] = [[1.01, 0.002, -0.001], [0.003, 0.99, 0.002], [-0.002, 0.001, 1.02]];

fn refused_checks(found: &Calibration) -> Vec<String> {
    let checks = Certificate::of(found).validity;
    checks.into_iter().filter(|check| !check.passes).map(|check| check.what).collect()
}

#[test]
fn exchanged_and_turned_axes_under_vibration_have_no_scale_factor() {
    let found = shaken(UPRIGHT, &oblique(), "", 31);
    let [result] = &found.results[..] else { panic!("one result") };
    assert_eq!(result.withheld, None, "{:?}", result.withheld);
    assert!((result.scale_factor.value - UPRIGHT[result.main][result.main]).abs() < 1e-3);
    let [x, y, z] = UPRIGHT;
    let turned = |row: [f64; 3]| row.map(|entry| -entry);
    let wrong = [
        ([y, x, z], "exchanged"),
        ([x, z, y], "exchanged"),
        ([x, turned(y), z], "sign is turned"),
        ([turned(x), y, z], "sign is turned"),
        ([x, y, turned(z)], "sign is turned"),
    ];
    for (matrix, why) in wrong {
        let found = shaken(matrix, &oblique(), "", 32);
        let [result] = &found.results[..] else { panic!("one result") };
        assert!(
            result.withheld.as_ref().is_some_and(|text| text.contains(why)),
            "{why}: {:?}",
            result.withheld
        );
        let refused = refused_checks(&found);
        assert!(refused.iter().any(|what| what.contains("one scale factor describes")), "{refused:?}");
    }
}

/// Four of the twelve show 1.3 times what the others do.
#[test]
fn records_that_no_matrix_describes_have_no_scale_factor() {
    let mut records = oblique();
    for record in &mut records[..4] {
        record.gain = 1.3;
    }
    let found = shaken(UPRIGHT, &records, "", 33);
    let [result] = &found.results[..] else { panic!("one result") };
    assert!(
        result.withheld.as_ref().is_some_and(|why| why.contains("no matrix of scale factors")),
        "{:?}",
        result.withheld
    );
}

/// Twelve rates about y, and what is shown falls by 1 % from the lowest to the highest.
#[test]
fn a_scale_factor_that_changes_with_the_amplitude_is_withheld() {
    let falling = |k: u32| Shaken {
        rates: [0.0, 0.5 + 0.1 * f64::from(k), 0.0],
        gain: 1.0 - 1e-2 * f64::from(k) / 11.0,
        ..SHAKEN
    };
    let records: Vec<Shaken> = (0..12).map(falling).collect();
    let found = shaken(UPRIGHT, &records, "", 34);
    let [result] = &found.results[..] else { panic!("one result") };
    assert!(result.withheld.as_ref().is_some_and(|why| why.contains("changes with the rate")), "{result:#?}");
}

/// A factor that falls with the frequency, which the records of one frequency share or not.
#[test]
fn a_scale_factor_by_frequency_says_where_nothing_tells_what_changes_from_record_to_record() {
    let scatter = "the interval has what changes from record to record";
    for (each, stated, is_known) in [(1, "", false), (1, "reproducibility = \"0.01 %\"", true), (3, "", true)]
    {
        let found = shaken(UPRIGHT, &falling_with_frequency(each), stated, 35);
        let [result] = &found.results[..] else { panic!("one result") };
        assert_eq!(result.by_frequency.len(), 5, "{:?}", result.withheld);
        let refused = refused_checks(&found);
        assert_eq!(
            !refused.iter().any(|what| what.contains(scatter)),
            is_known,
            "{each} {stated}: {refused:?}"
        );
        let is_said = result.warnings.iter().any(|text| text.contains("5 of 5 frequencies lack"));
        assert_eq!(is_said, !is_known, "{:?}", result.warnings);
    }
}
