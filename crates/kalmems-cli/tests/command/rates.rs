//! The rate of a recording, which all commands find alike.

use super::columns::{done, run, said};

/// Stamps of a clock that are rounded to ms, of which a mean interval is off by one part in 30 000.
#[test]
fn inspect_new_and_calibrate_find_one_rate_by_rounded_stamps() {
    const ROWS: u32 = 6000;
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    for true_hz in [400.0, 397.3, 333.0] {
        let mut state = 1_u32;
        let rows = (0..ROWS).fold("time_ms,w_rad_per_s\n".to_owned(), |text, row| {
            // White noise (D. E. Knuth and H. W. Lewis, Numerical Recipes, 7.1).
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            let noise = f64::from(state >> 8) / f64::from(1 << 24) - 0.5;
            text + &format!("{},{noise:.7}\n", (1e3 * f64::from(row) / true_hz).round())
        });
        std::fs::write(path("rest.csv"), rows).unwrap();
        let settings = format!(
            "name = \"r\"\n[sensor]\nrate = \"{true_hz} Hz\"\nclock_tolerance = \"1 %\"\nchannels = {{ z = \"w_rad_per_s\" }}\n\
             [rest]\nfile = \"rest.csv\"\nclock = {{ column = \"time_ms\" }}\n"
        );
        std::fs::write(path("rest.toml"), settings).unwrap();
        let json =
            |arguments: &[&str]| -> serde_json::Value { serde_json::from_str(&done(arguments)).unwrap() };
        let inspected = json(&["inspect", &path("rest.csv"), "--json"]);
        let inspected = inspected["segments"][0]["rate_hz"].as_f64().unwrap();
        let calibrate =
            ["calibrate", "gyro", &path("rest.toml"), "--out", &path(&format!("{true_hz}")), "--json"];
        let calibrated = json(&calibrate)["rest"][0]["rate_hz"].as_f64().unwrap();
        // A rounding has a standard deviation of 1/√12 ms, and the slope of n times that of √12/n^(3/2) times it: five of them.
        let deviation = 1e-3 * true_hz / f64::from(ROWS).powf(1.5);
        for found in [inspected, calibrated] {
            assert!((found / true_hz - 1.0).abs() < 5.0 * deviation, "{found} for {true_hz}");
        }
        assert!((inspected / calibrated - 1.0).abs() < 1e-9, "{inspected} {calibrated}");
        // `new` prints five digits.
        let described = String::from_utf8(run(&["new", &path("rest.csv")]).stdout).unwrap();
        let described = format!("{described}{}", said(&run(&["new", &path("rest.csv")])));
        assert!(described.contains(&format!("It has 6000 samples at {true_hz} Hz")), "{described}");
    }
}
