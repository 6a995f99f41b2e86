//! Polynomials of the temperature as a header in C.

use super::quantities::TemperaturePolynomial;
use std::fmt::Write as _;

/// The header: for each number its coefficients and a function of the temperature in K, which is held within the range of the record.
pub(super) fn header(polynomials: &[&TemperaturePolynomial]) -> String {
    let mut text = "/* Polynomials of the temperature by kalmems calibrate. Each function takes the temperature in K and holds it within the range of the\n \
                    record: beyond it nothing was measured. */\n#ifndef KALMEMS_TEMPERATURE_H\n#define KALMEMS_TEMPERATURE_H\n"
        .to_owned();
    for polynomial in polynomials {
        let TemperaturePolynomial { name, unit, reference_k, range_k: [low, high], coefficients } =
            polynomial;
        let steps: String =
            coefficients.iter().rev().skip(1).fold(String::new(), |mut steps, coefficient| {
                // Writing to a string does not fail.
                let _ = writeln!(steps, "    value = value * off + ({coefficient:e});");
                steps
            });
        let highest = coefficients.last().copied().unwrap_or(0.0);
        let _ = write!(
            text,
            "\n/* {name} in {unit}. */\nstatic inline double kalmems_{name}(double temperature_K) {{\n    const double low = {low:e}, high = {high:e};\n    \
             const double within = temperature_K < low ? low : temperature_K > high ? high : temperature_K;\n    \
             const double off = within - ({reference_k:e});\n    double value = {highest:e};\n{steps}    return value;\n}}\n"
        );
    }
    text + "\n#endif\n"
}
