//! What a certificate states: words that follow from what was computed, rounding, and what keeps it a draft.

use super::simulated::Noise;
use kalmems_applications::ApplicationFile;
use kalmems_applications::calibration::{
    Calibration, Certificate, GyroscopeCalibration, calibrate, certificate_page,
};
use kalmems_engines::progress::Silent;
use std::f64::consts::TAU;
use std::fmt::Write as _;
use std::fs;

const FILE: &str = "name = \"rest\"\n[gyroscope]\nrate = \"10 Hz\"\nchannels = { z = \"gz_rad_per_s\" }\n[rest]\nfile = \"rest.csv\"\n";

const STATED: &str = "[certificate]\nnumber = \"17\"\nitem = \"gyroscope 4711\"\ncustomer = \"a customer\"\nlaboratory = \"a bench\"\n\
    operator = \"somebody\"\nreceived = \"2026-11-20\"\ndate = \"2026-11-25\"\nissued = \"2026-11-26\"\nas_found = \"these results\"\nas_left = \"not adjusted\"\n\
    conditions = \"23 °C\"\ntraceability = \"frequency standard 3\"\n";

/// White noise, with a slow oscillation of this amplitude.
fn at_rest(amplitude: f64, text: &str) -> Calibration {
    let folder = tempfile::tempdir().unwrap();
    let mut noise = Noise::new(7);
    let mut rows = "gz_rad_per_s\n".to_owned();
    for k in 0..8192 {
        let slow = amplitude * (TAU * 0.02 * f64::from(k) / 10.0).sin();
        writeln!(rows, "{:.8}", 0.012 + slow + 3.2e-3 * noise.normal()).unwrap();
    }
    fs::write(folder.path().join("rest.csv"), rows).unwrap();
    calibrate(&GyroscopeCalibration::parse(text, &folder.path().join("rest.toml")).unwrap(), &Silent).unwrap()
}

/// A unit that vibrates with this amplitude.
pub fn vibrating(amplitude: f64) -> Calibration {
    let folder = tempfile::tempdir().unwrap();
    let mut noise = Noise::new(8);
    let mut rows = "gz_rad_per_s\n".to_owned();
    for k in 0..8192 {
        writeln!(rows, "{:.8}", amplitude * (1.1 * f64::from(k)).sin() + 3e-3 * noise.normal()).unwrap();
    }
    fs::write(folder.path().join("rest.csv"), rows).unwrap();
    let text = format!("{FILE}{STATED}");
    calibrate(&GyroscopeCalibration::parse(&text, &folder.path().join("rest.toml")).unwrap(), &Silent)
        .unwrap()
}

#[test]
fn the_method_on_a_certificate_is_the_one_that_gave_the_number() {
    let fitted = at_rest(0.0, FILE);
    let method = Certificate::of(&fitted).method;
    assert!(method.contains("noise that was fitted") && !method.contains("eight pieces"), "{method}");
    let not_fitted = at_rest(5e-3, FILE);
    let method = Certificate::of(&not_fitted).method;
    assert!(method.contains("eight pieces") && !method.contains("noise that was fitted"), "{method}");
    // Of the mean by eight pieces; the Earth's rotation adds to the uncertainty and to the degrees of freedom (Welch and Satterthwaite).
    let rest = &not_fitted.rest[0];
    assert_eq!(rest.bias_freedom, 7.0);
    let earth = 7.292e-5 / 3.0_f64.sqrt();
    let square = rest.bias_uncertainty.powi(2) + earth.powi(2);
    let bias = Certificate::of(&not_fitted).bias[0].bias;
    assert!((bias.standard_uncertainty / square.sqrt() - 1.0).abs() < 1e-4, "{bias:?}");
    let freedom = 7.0 * (square / rest.bias_uncertainty.powi(2)).powi(2);
    assert!((bias.degrees_of_freedom.unwrap() / freedom - 1.0).abs() < 1e-3, "{bias:?}");
}

/// It is valid if all is stated and all checks pass, and only then.
#[test]
fn one_question_or_one_failed_check_keeps_a_certificate_a_draft() {
    let all = format!("{FILE}{STATED}");
    let found = at_rest(0.0, &all);
    let certificate = Certificate::of(&found);
    assert!(certificate.valid, "{:?} {:?}", certificate.not_stated, certificate.validity);
    for line in STATED.lines().skip(1) {
        let key = line.split(' ').next().unwrap();
        let found = at_rest(0.0, &all.replace(&format!("{line}\n"), ""));
        let certificate = Certificate::of(&found);
        assert_eq!(certificate.not_stated, [format!("certificate.{key}")]);
        assert!(!certificate.valid);
        let html = certificate_page(&certificate, &found, &[]).to_html().unwrap();
        assert!(html.contains("A draft, not a certificate"), "{key}");
    }
    let moving = vibrating(2e-3);
    let certificate = Certificate::of(&moving);
    assert!(!certificate.valid && certificate.not_stated.is_empty());
    let html = certificate_page(&certificate, &moving, &[]).to_html().unwrap();
    assert!(html.contains("Not to be issued") && html.contains("Hz stands out"), "{html}");
}

#[test]
fn a_certificate_has_the_words_of_its_standard_and_a_coverage_factor_of_choice() {
    let found = at_rest(0.0, &format!("{FILE}{STATED}"));
    let certificate = Certificate::of(&found);
    let html = certificate_page(&certificate, &found, &[]).to_html().unwrap();
    for part in [
        "Date of receipt",
        "Date of issue",
        "As found: results before any adjustment",
        "these results",
        "As left: results after the adjustment",
        "not adjusted",
        "The results relate only to the item that was calibrated",
        "Authorised by",
        "Metrological traceability",
        "expanded uncertainty of measurement U",
        "rounded to two digits",
    ] {
        assert!(html.contains(part), "{part}");
    }
    let by_95 = certificate.bias[0].bias;
    let chosen = at_rest(0.0, &format!("{FILE}{STATED}coverage_factor = 2\n"));
    let by_two = Certificate::of(&chosen).bias[0].bias;
    assert!((by_two.expanded_uncertainty / (2.0 * by_95.standard_uncertainty) - 1.0).abs() < 1e-12);
    // With few degrees of freedom k = 2 holds less than 95 %, and a normal distribution 95.45 %.
    assert!(by_95.coverage_factor > 2.02 && by_two.coverage_probability < 0.95, "{by_95:?} {by_two:?}");
    assert!((0.9..0.9545).contains(&by_two.coverage_probability), "{by_two:?}");
    let html = certificate_page(&Certificate::of(&chosen), &chosen, &[]).to_html().unwrap();
    assert!(html.contains("coverage factor k = 2;"), "{html}");
}

#[test]
fn a_coverage_factor_that_is_none_is_refused() {
    let text = format!("{FILE}{STATED}coverage_factor = 9\n");
    let said = GyroscopeCalibration::parse(&text, std::path::Path::new("rest.toml")).unwrap_err().to_string();
    assert!(said.contains("expected 1 to 3"), "{said}");
}
