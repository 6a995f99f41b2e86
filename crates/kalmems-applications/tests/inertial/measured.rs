//! A real unit in positions: an Xsens MTi, turned by hand, of Tedaldi, Pretto and Menegatti (`independent/README.md`).

use kalmems_applications::ApplicationFile;
use kalmems_applications::calibration::{GyroscopeCalibration, calibrate};
use kalmems_engines::progress::Silent;
use serde_json::Value;
use std::path::Path;

/// Codes by m/s² and by rad/s as the maker states them, of which the file has sums of four, and what is near to the codes at rest.
const ACCELEROMETERS: [(f64, f64); 3] = [(415.0, -79.81), (413.0, -80.57), (415.0, -77.98)];
const GYROSCOPES: [(f64, f64); 3] = [(4778.0, -6.858), (4758.0, -6.823), (4766.0, -6.816)];
const SUMMED: f64 = 4.0;

/// The columns of one sensor.
fn columns(name: &str, unit: &str, each: [(f64, f64); 3]) -> String {
    let columns = ["x", "y", "z"].into_iter().zip(each).map(|(axis, (codes, offset))| {
        let codes = SUMMED * codes;
        format!(
            "{axis} = {{ column = \"{name}{axis}\", sensitivity = \"{codes} LSB/({unit})\", offset = \"{offset} {unit}\" }}\n"
        )
    });
    columns.collect()
}

/// Fifteen numbers by SciPy within their intervals, and six sensitivities as the maker states them.
#[test]
fn positions_of_a_real_unit_agree_with_a_second_method_and_with_the_maker() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/independent");
    let scipy: Value =
        serde_json::from_str(&std::fs::read_to_string(folder.join("xsens.json")).unwrap()).unwrap();
    let text = format!(
        "name = \"xsens\"\n[sensor]\nrate = \"{} Hz\"\n[sensor.channels]\n{}[sensor.accelerometers]\n{}[positions]\nfile = \"xsens.npz\"\n\
         gravity = \"9.81744 m/s^2\"\n",
        scipy["rate_hz"],
        columns("g", "rad/s", GYROSCOPES),
        columns("a", "m/s^2", ACCELEROMETERS)
    );
    let file = GyroscopeCalibration::parse(&text, &folder.join("xsens.toml")).unwrap();
    let found = calibrate(&file, &Silent).unwrap();
    let record = &found.records[0];
    let solved = scipy["solved"].as_object().unwrap();
    assert_eq!(solved.len(), 15);
    for (name, theirs) in solved {
        let (ours, theirs) =
            (record.estimate(name).unwrap_or_else(|| panic!("{name}")), theirs.as_f64().unwrap());
        let apart = (ours.value - theirs).abs() / ours.expanded();
        println!("{name}: {} {theirs}, {apart:.2} of U", ours.value);
        assert!(apart < 0.5, "{name}: {ours:?} {theirs}");
    }
    for (sensor, each) in [("accelerometer", ACCELEROMETERS), ("gyroscope", GYROSCOPES)] {
        for (axis, (codes, _)) in ["x", "y", "z"].into_iter().zip(each) {
            let found = record.estimate(&format!("{sensor}_sensitivity_{axis}")).unwrap().value / SUMMED;
            // At another temperature, and years before.
            assert!((found / codes - 1.0).abs() < 3e-3, "{sensor} {axis}: {found} {codes}");
        }
    }
}
