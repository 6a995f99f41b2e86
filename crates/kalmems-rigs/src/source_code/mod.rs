//! What the sources of exported filters of angle and rate have in common, whatever the device.

pub mod c;

use std::fmt::Display;

/// A Rust module behind its heading; `what` says what it is, `heading` where it is from.
pub fn rust_module(what: &str, heading: &[String], body: &str) -> String {
    format!("//! {what}\n\n// {}\n\n{body}", heading.join("\n// "))
}

/// A number as Rust reads it, the shortest that gives the same bits.
pub fn number(value: f64) -> String {
    format!("{value:?}")
}

/// What a filter of angle and rate in Rust tells.
pub const ANSWERS: &str = "    /// Angle and rate, in their units.
    #[inline(always)]
    pub fn mean(&self) -> [T; 2] {
        *self.filter.mean()
    }

    /// Their covariance, in their units.
    #[inline(always)]
    pub fn covariance(&self) -> Covariance<T, 2> {
        self.filter.covariance()
    }
";

/// A text with each `@name@` replaced.
pub fn fill(text: &str, values: &[(&str, &dyn Display)]) -> String {
    let one = |text: String, (name, value): &(&str, &dyn Display)| {
        text.replace(&format!("@{name}@"), &value.to_string())
    };
    values.iter().fold(text.to_owned(), one)
}
