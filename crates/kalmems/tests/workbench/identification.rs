//! Identification against measured data with answers computed elsewhere.

use kalmems::identify::{ResponseModel, ResponsePoint, fit_circle, fit_free_decay, fit_response};
use serde_json::Value;
use std::path::PathBuf;

fn reference(folder: &str) -> (PathBuf, Value) {
    let data = std::env::var_os("KALMEMS_REFERENCE_DATA").expect("KALMEMS_REFERENCE_DATA names the folder");
    let folder = PathBuf::from(data).join("real").join(folder);
    let expected = std::fs::read_to_string(folder.join("expected.json")).unwrap();
    (folder, serde_json::from_str(&expected).unwrap())
}

fn columns<const N: usize>(file: PathBuf) -> Vec<[f64; N]> {
    let text = std::fs::read_to_string(file).unwrap();
    let row = |line: &str| -> Vec<f64> { line.split(',').map(|v| v.trim().parse().unwrap()).collect() };
    text.lines().skip(1).map(|line| row(line).try_into().unwrap()).collect()
}

/// Six measured decays of a seismometer: within a tenth of a standard deviation of `scipy`'s least squares on the
/// same samples, with the same standard deviations.
#[test]
#[ignore = "needs KALMEMS_REFERENCE_DATA"]
fn free_decays_of_a_seismometer() {
    let (folder, expected) = reference("seismometer_free_decay");
    let cases = expected["cases"].as_object().unwrap();
    assert_eq!(cases.len(), 6);
    for (name, case) in cases {
        let number = |key: &str| case[key].as_f64().unwrap();
        let rows: Vec<[f64; 2]> = columns(folder.join(name));
        let window = number("t_start_s")..=number("t_end_s");
        let (time, y): (Vec<f64>, Vec<f64>) =
            rows.iter().filter(|[t, _]| window.contains(t)).map(|[t, y]| (*t, *y)).unzip();
        assert_eq!(time.len() as f64, number("n"), "{name}");
        let found = fit_free_decay(&time, &y).unwrap();
        for (what, ours, key, deviation) in [
            ("decay rate", found.decay_rate(), "alpha_per_s", "alpha_sd"),
            ("frequency", found.damped_frequency_hz(), "fd_hz", "fd_sd_hz"),
            ("quality", found.quality(), "Q", "Q_sd"),
        ] {
            let (value, sd) = (number(key), number(deviation));
            println!("{name}: {what} {} ± {}, expected {value} ± {sd}", ours.value, ours.deviation);
            assert!((ours.value - value).abs() <= 0.1 * sd, "{name}: {what}");
            assert!((ours.deviation / sd - 1.0).abs() < 0.01, "{name}: deviation of the {what}");
        }
        assert!((found.fit.sum_of_squares / number("ssr") - 1.0).abs() < 1e-6, "{name}");
        assert!((found.natural_frequency_hz().value / number("f0_hz") - 1.0).abs() < 1e-6, "{name}");
        assert!((found.damping_ratio().value / number("zeta") - 1.0).abs() < 1e-5, "{name}");
    }
}

/// The measured frequency response of the Silverbox, an electronic Duffing oscillator.
#[test]
#[ignore = "needs KALMEMS_REFERENCE_DATA"]
fn frequency_response_of_the_silverbox() {
    let (folder, expected) = reference("silverbox");
    let expected = &expected["schroeder_frf_fit"];
    let number = |key: &str| expected[key].as_f64().unwrap();
    let points: Vec<ResponsePoint> = columns(folder.join("schroeder_frf.csv"))
        .into_iter()
        .map(|[frequency_hz, re, im]| ResponsePoint { frequency_hz, re, im, deviation: 1.0 })
        .collect();
    assert_eq!(points.len() as f64, number("n_bins"));
    let found = fit_response(&points, ResponseModel::SingleMode).unwrap();
    for (what, ours, key, index) in [
        ("gain", found.gain(), "g", 0),
        ("f0", found.natural_frequency_hz(), "f0_hz", 1),
        ("damping ratio", found.damping_ratio(), "zeta", 2),
        ("delay", found.delay_s(), "tau_s", 3),
    ] {
        let sd = expected["sd"][index].as_f64().unwrap();
        println!("{what} {} ± {}, expected {} ± {sd}", ours.value, ours.deviation, number(key));
        assert!((ours.value - number(key)).abs() <= 1e-3 * sd, "{what}");
        assert!((ours.deviation / sd - 1.0).abs() < 0.01, "deviation of the {what}");
    }
    assert!((found.natural_frequency_hz().value - 73.18).abs() < 0.1);
    assert!((found.damping_ratio().value - 0.0495).abs() < 2e-3);

    // The same resonance as a circle: j·f·G near it. The algebraic circle of `expected.json` is a start only; the
    // circle of least distances leaves less.
    let circle = &expected["kasa_circle_of_jfG_within_8Hz"];
    let near: Vec<[f64; 2]> = points
        .iter()
        .filter(|p| (p.frequency_hz - found.natural_frequency_hz().value).abs() <= 8.0)
        .map(|p| [-p.frequency_hz * p.im, p.frequency_hz * p.re])
        .collect();
    assert_eq!(near.len() as f64, circle["n"].as_f64().unwrap());
    let ours = fit_circle(&near).unwrap();
    let value = |key: &str| circle[key].as_f64().unwrap();
    let left = |x: f64, y: f64, r: f64| -> f64 {
        near.iter().map(|p| ((p[0] - x).hypot(p[1] - y) - r).powi(2)).sum()
    };
    println!("circle {:?}, radius {}", ours.centre(), ours.radius());
    assert!(ours.fit.sum_of_squares < left(value("xc"), value("yc"), value("radius")));
    assert!((ours.radius() / value("radius") - 1.0).abs() < 0.1);
}
