//! Curves over the temperature as a header in C and as a module in Rust.

use crate::config::{CurvePiece, TemperatureCurve};

/// The polynomial in the temperature less its reference, as both languages have it.
fn polynomial(piece: &CurvePiece, temperature: &str) -> String {
    let CurvePiece { reference_k, coefficients } = piece;
    let off = format!("({temperature} - ({reference_k:e}))");
    let steps = coefficients.iter().rev().map(|coefficient| format!("({coefficient:e})"));
    steps
        .reduce(|value, coefficient| format!("({value} * {off} + {coefficient})"))
        .unwrap_or_else(|| "0e0".to_owned())
}

/// The pieces, each of which stands for the temperatures from its reference on; `choice` writes a condition with both values.
fn expression(
    pieces: &[CurvePiece],
    temperature: &str,
    choice: impl Fn(&str, &str, &str) -> String,
) -> String {
    let pieces = pieces.iter().map(|piece| (piece.reference_k, polynomial(piece, temperature)));
    let all = pieces.reduce(|(_, before), (from, piece)| {
        (from, choice(&format!("{temperature} < {from:e}"), &before, &piece))
    });
    all.map_or_else(|| "0e0".to_owned(), |(_, expression)| expression)
}

/// A function of the temperature in a source: what it gives, its name, and its pieces.
struct CurveFunction<'a> {
    what: String,
    name: String,
    range_k: [f64; 2],
    pieces: &'a [CurvePiece],
}

/// The functions of a number: its value, and the square of its expanded uncertainty, as a root takes a library.
fn functions(curve: &TemperatureCurve) -> impl Iterator<Item = CurveFunction<'_>> {
    let TemperatureCurve { name, unit, range_k, pieces, expanded_square } = curve;
    let square = format!("The square of the expanded uncertainty (95 %) of {name} in ({unit})^2");
    let each = [
        (format!("{name} in {unit}"), name.clone(), pieces),
        (square, format!("{name}_expanded_square"), expanded_square),
    ];
    let known = each.into_iter().filter(|(.., pieces)| !pieces.is_empty());
    known.map(|(what, name, pieces)| CurveFunction { what, name, range_k: *range_k, pieces })
}

/// The header: for each number functions of the temperature in K, which is held within the range of the record.
pub(super) fn header(curves: &[&TemperatureCurve]) -> String {
    let functions = curves.iter().flat_map(|curve| functions(curve)).map(|function| {
        let CurveFunction { what, name, range_k: [low, high], pieces } = function;
        format!(
            "\n/* {what}. */\nstatic inline double kalmems_{name}(double temperature_K) {{\n    const double low = {low:e}, high = {high:e};\n    \
             const double within = temperature_K < low ? low : temperature_K > high ? high : temperature_K;\n    return {};\n}}\n",
            expression(pieces, "within", |condition, before, piece| format!("({condition} ? {before} : {piece})"))
        )
    });
    "/* Numbers over the temperature by kalmems calibrate. Each function takes the temperature in K and holds it within the range of the\n   record: beyond it \
     nothing was measured. */\n#ifndef KALMEMS_TEMPERATURE_H\n#define KALMEMS_TEMPERATURE_H\n"
        .to_owned()
        + &functions.collect::<String>()
        + "\n#endif\n"
}

/// The same as a module in Rust, without the standard library.
pub(super) fn rust_module(curves: &[&TemperatureCurve]) -> String {
    let functions = curves.iter().flat_map(|curve| functions(curve)).map(|function| {
        let CurveFunction { what, name, range_k: [low, high], pieces } = function;
        format!(
            "\n/// {what}.\npub fn {name}(temperature_k: f64) -> f64 {{\n    let within = temperature_k.clamp({low:e}, {high:e});\n    {}\n}}\n",
            expression(pieces, "within", |condition, before, piece| format!(
                "if {condition} {{ {before} }} else {{ {piece} }}"
            ))
        )
    });
    "//! Numbers over the temperature by kalmems calibrate. Each function takes the temperature in K and holds it within the range of the\n//! record: beyond it \
     nothing was measured.\n#![allow(unused_parens)]\n"
        .to_owned()
        + &functions.collect::<String>()
}
