//! What would be large stays small: long sums, nested literals, repeated derivatives, equal parts.

use crate::common::device;
use kalmems_equations::{Description, Device};

fn one_state(rate: &str) -> String {
    format!("[states]\nx = '1'\ny = '1'\n[parameters]\np = '2'\n[derivative]\nx = '{rate}'\ny = '0'\n")
}

fn read(text: &str) -> Result<Device, String> {
    Description::read(text).and_then(|read| Device::of(&read)).map_err(|error| error.to_string())
}

/// The rate of x at a point.
fn rate(text: &str, x: [f64; 2]) -> f64 {
    let device = device(text);
    let motion = device.motion(&[]).unwrap();
    let mut rates = [0.0; 2];
    motion.rates(&mut motion.work(&device.values()), &x, &[], &mut rates);
    rates[0]
}

#[test]
fn a_long_sum_is_not_deep() {
    let terms: Vec<String> = (0..9000).map(|k| format!("x*{k}")).collect();
    // 40 495 500 = 0 + 1 + … + 8999.
    assert_eq!(rate(&one_state(&format!("1[1/s]*({})", terms.join("+"))), [2.0, 0.0]), 80_991_000.0);
}

#[test]
fn a_long_product_and_nested_definitions_are_read() {
    let product = vec!["x"; 900].join("*");
    assert_eq!(rate(&one_state(&format!("1[1/s]*{product}")), [1.0, 0.0]), 1.0);
    let mut lets = String::from("[let]\nz0 = 'x'\n");
    for k in 1..40 {
        lets.push_str(&format!("z{k} = 'z{0}*z{0} + z{0}/(1 + z{0}^2)'\n", k - 1));
    }
    // Written out it would be 2^39 terms and more.
    let device = device(&format!("{}{lets}", one_state("1[1/s]*z39")));
    assert!(device.parts() < 1000, "{}", device.parts());
}

#[test]
fn definitions_that_wait_for_too_many_others_are_refused() {
    let mut lets = String::from("[let]\n");
    for k in 0..100 {
        lets.push_str(&format!("z{k} = 'z{} + 1'\n", k + 1));
    }
    let text = format!("{}{lets}z100 = 'x'\n", one_state("1[1/s]*z0"));
    let error = read(&text).unwrap_err();
    assert!(error.contains("more than 48 definitions that wait for one another"), "{error}");
}

#[test]
fn nested_literals_end() {
    let nested = (0..50).fold("x".to_owned(), |inner, k| format!("2*(1 + {inner})^2/{}", k + 1));
    let text = one_state(&format!("1[1/s]*({nested})"));
    assert!(read(&text).is_ok() || read(&text).unwrap_err().contains("nested deeper"));
}

/// Each is the same expression, and takes no more room than the first.
#[test]
fn equal_parts_are_one() {
    let parts = |rate: &str| device(&one_state(rate)).parts();
    let plain = parts("1[1/s]*(x + y)*p");
    for same in [
        "1[1/s]*p*(y + x)",
        "(x + y)*p*1[1/s]",
        "1[1/s]*p*(1 + (y + (x - 1)))",
        "2[1/s]*p*(x + y)/2",
        "-1[1/s]*p*(0 - x - y)",
        "1[1/s]*p*(x + y)*sqrt(x)*sqrt(x)/x",
    ] {
        let at = |text: &str| rate(&one_state(text), [0.7, -0.2]);
        assert!((at(same) - at("1[1/s]*(x + y)*p")).abs() < 1e-15, "{same}");
    }
    assert_eq!(parts("1[1/s]*p*(y + x)"), plain);
    assert_eq!(rate(&one_state("1[1/s]*(x - x + 0*y)"), [0.5, f64::NAN]), 0.0);
}

#[test]
fn ten_derivatives_stay_small() {
    let mut e = "x*exp(-x^2)*sin(y*x)".to_owned();
    for _ in 0..10 {
        e = format!("d({e}, x)");
    }
    let device = device(&one_state(&format!("1[1/s]*({e})")));
    assert!(device.parts() < 20_000, "{}", device.parts());
}

#[test]
fn a_text_that_is_too_long_is_refused() {
    let text = one_state(&"x + ".repeat(20_000));
    let error = read(&text).unwrap_err();
    assert!(error.starts_with("derivative.x: the text has 80000 bytes; at most 65536 are read"), "{error}");
}

/// A function of a function of a function, each of which inserts the one before twice.
#[test]
fn functions_that_double_are_stopped() {
    let mut functions = String::from("[functions]\n'f0(z)' = 'z*z + x'\n");
    for k in 1..45 {
        functions.push_str(&format!("'f{k}(z)' = 'f{0}(z) + f{0}(z + 1)'\n", k - 1));
    }
    let error = read(&format!("{}{functions}", one_state("1[1/s]*f44(x)"))).unwrap_err();
    assert!(error.contains("once everything is inserted"), "{error}");
}
