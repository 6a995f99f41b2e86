//! A real unit in positions, whose data stand with the reference data and not here.

use kalmems_applications::ApplicationFile;
use kalmems_applications::calibration::{GyroscopeCalibration, calibrate};
use kalmems_engines::progress::Silent;
use std::fmt::Write as _;
use std::fs;
use std::path::PathBuf;

/// Codes by m/s² and by rad/s as the maker states them, rounded to one, and what is near to the codes at rest.
const ACCELEROMETERS: [(f64, f64); 3] = [(415.0, -79.81), (413.0, -80.57), (415.0, -77.98)];
const GYROSCOPES: [(f64, f64); 3] = [(4778.0, -6.858), (4758.0, -6.823), (4766.0, -6.816)];

/// By NumPy 2.3 and SciPy 1.17: rests are where the variance in a window of 1.01 s is below four times that of the first minute; Gauss–Newton steps
/// (`scipy.optimize.least_squares`) on the magnitude of the specific force of 38 means, and on its direction, which quaternions by the midpoint of two
/// samples turn through 37 motions.
const BY_SCIPY: [(&str, f64); 15] = [
    ("accelerometer_scale_factor_x", 0.998_655),
    ("accelerometer_scale_factor_y", 0.997_882),
    ("accelerometer_scale_factor_z", 0.999_083),
    ("accelerometer_bias_x", 0.006_460),
    ("accelerometer_bias_y", -0.000_627),
    ("accelerometer_bias_z", 0.006_745),
    ("accelerometer_non_orthogonality_xy", 0.003_581),
    ("accelerometer_non_orthogonality_xz", 0.009_241),
    ("accelerometer_non_orthogonality_yz", 0.021_359),
    ("gyroscope_scale_factor_x", 1.000_696),
    ("gyroscope_scale_factor_y", 1.002_645),
    ("gyroscope_scale_factor_z", 1.000_401),
    ("gyroscope_non_orthogonality_xy", -0.014_944),
    ("gyroscope_non_orthogonality_xz", -0.026_429),
    ("gyroscope_non_orthogonality_yz", 0.055_097),
];

/// The columns of one sensor.
fn columns(name: &str, unit: &str, each: [(f64, f64); 3]) -> String {
    let columns = ["x", "y", "z"].into_iter().zip(each).map(|(axis, (codes, offset))| {
        format!("{axis} = {{ column = \"{name}{axis}\", sensitivity = \"{codes} LSB/({unit})\", offset = \"{offset} {unit}\" }}\n")
    });
    columns.collect()
}

/// The record of Tedaldi, Pretto and Menegatti, ICRA 2014: an Xsens MTi, turned by hand, of IMU-TK (BSD licence).
#[test]
#[ignore = "needs KALMEMS_REFERENCE_DATA"]
fn positions_of_a_real_unit_agree_with_a_second_method_and_with_the_maker() {
    let data =
        PathBuf::from(std::env::var("KALMEMS_REFERENCE_DATA").expect("the folder of the reference data"));
    let [forces, rates] =
        ["xsens_acc.mat", "xsens_gyro.mat"].map(|name| data.join("real/imu_tk_xsens").join(name));
    if !forces.exists() {
        println!("skipped: there is no {}", forces.display());
        return;
    }
    let [forces, rates] = [forces, rates].map(|path| fs::read_to_string(path).unwrap());
    let mut rows = "time_s,ax,ay,az,gx,gy,gz\n".to_owned();
    for (force, rate) in forces.lines().zip(rates.lines()) {
        let cells: Vec<&str> = force.split_whitespace().chain(rate.split_whitespace().skip(1)).collect();
        writeln!(rows, "{}", cells.join(",")).unwrap();
    }
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("xsens.csv"), rows).unwrap();
    let text = format!(
        "name = \"xsens\"\n[sensor]\nrate = \"100 Hz\"\n[sensor.channels]\n{}[sensor.accelerometers]\n{}[positions]\nfile = \"xsens.csv\"\n\
         clock = {{ column = \"time_s\" }}\ngravity = \"9.81744 m/s^2\"\n",
        columns("g", "rad/s", GYROSCOPES),
        columns("a", "m/s^2", ACCELEROMETERS)
    );
    let file = GyroscopeCalibration::parse(&text, &folder.path().join("xsens.toml")).unwrap();
    let found = calibrate(&file, &Silent).unwrap();
    let record = &found.records[0];
    for (name, expected) in BY_SCIPY {
        let estimate = record.estimate(name).unwrap_or_else(|| panic!("{name}"));
        assert!((estimate.value - expected).abs() < estimate.expanded(), "{name}: {estimate:?} {expected}");
    }
    for (sensor, each) in [("accelerometer", ACCELEROMETERS), ("gyroscope", GYROSCOPES)] {
        for (axis, (codes, _)) in ["x", "y", "z"].into_iter().zip(each) {
            let found = record.estimate(&format!("{sensor}_sensitivity_{axis}")).unwrap().value;
            // At another temperature, and years before.
            assert!((found / codes - 1.0).abs() < 3e-3, "{sensor} {axis}: {found} {codes}");
        }
    }
}
