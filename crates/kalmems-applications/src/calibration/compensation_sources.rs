//! Polynomials of the temperature as a header in C and as a module in Rust.

use super::quantities::TemperaturePolynomial;

/// The polynomial in `off`, as both languages have it.
fn expression(coefficients: &[f64]) -> String {
    let steps = coefficients.iter().rev().map(|coefficient| format!("({coefficient:e})"));
    steps
        .reduce(|value, coefficient| format!("({value} * off + {coefficient})"))
        .unwrap_or_else(|| "0e0".to_owned())
}

/// The header: for each number a function of the temperature in K, which is held within the range of the record.
pub(super) fn header(polynomials: &[&TemperaturePolynomial]) -> String {
    let functions = polynomials.iter().map(|polynomial| {
        let TemperaturePolynomial { name, unit, reference_k, range_k: [low, high], coefficients } = polynomial;
        format!(
            "\n/* {name} in {unit}. */\nstatic inline double kalmems_{name}(double temperature_K) {{\n    const double low = {low:e}, high = {high:e};\n    \
             const double within = temperature_K < low ? low : temperature_K > high ? high : temperature_K;\n    \
             const double off = within - ({reference_k:e});\n    return {};\n}}\n",
            expression(coefficients)
        )
    });
    "/* Polynomials of the temperature by kalmems calibrate. Each function takes the temperature in K and holds it within the range of the\n   record: beyond it \
     nothing was measured. */\n#ifndef KALMEMS_TEMPERATURE_H\n#define KALMEMS_TEMPERATURE_H\n"
        .to_owned()
        + &functions.collect::<String>()
        + "\n#endif\n"
}

/// The same as a module in Rust, without the standard library.
pub(super) fn rust_module(polynomials: &[&TemperaturePolynomial]) -> String {
    let functions = polynomials.iter().map(|polynomial| {
        let TemperaturePolynomial { name, unit, reference_k, range_k: [low, high], coefficients } = polynomial;
        format!(
            "\n/// {name} in {unit}.\npub fn {name}(temperature_k: f64) -> f64 {{\n    let off = temperature_k.clamp({low:e}, {high:e}) - ({reference_k:e});\n    {}\n}}\n",
            expression(coefficients)
        )
    });
    "//! Polynomials of the temperature by kalmems calibrate. Each function takes the temperature in K and holds it within the range of the\n//! record: beyond it \
     nothing was measured.\n#![allow(unused_parens)]\n"
        .to_owned()
        + &functions.collect::<String>()
}
