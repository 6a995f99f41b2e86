//! Numbers of a device that an experiment may leave out.

use crate::config::{Key, written};
use toml::Value;

/// A number that the device table may leave out, or have as zero; a diagnosis tries whether it is there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OmittedNumber {
    /// The key below the device's table, such as `readout.delay`.
    pub key: &'static str,
    /// The unit in which it is written; empty of a ratio.
    pub unit: &'static str,
    /// A small step of it, in this unit.
    pub step: f64,
    /// Whether it cannot be below zero.
    pub is_never_negative: bool,
    /// How it is written.
    pub form: NumberForm,
    /// A key of a filter that has to be true for it to count.
    pub filter_switch: Option<&'static str>,
}

/// How a number is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NumberForm {
    /// As it is, with its unit.
    Number,
    /// As the corner frequencies in Hz of two low-passes whose time constants in s are each half of the number.
    TwoPoles,
}

impl OmittedNumber {
    /// The whole key, below that of the device's table.
    pub fn key(&self, device: &Key) -> Key {
        self.key.split('.').fold(device.clone(), Key::child)
    }

    /// What stands at the key for a number of so many steps.
    pub fn value(&self, steps: f64) -> Value {
        let number = steps * self.step;
        match self.form {
            NumberForm::Number => written(number, self.unit),
            NumberForm::TwoPoles => {
                let corner_hz = 1.0 / (std::f64::consts::PI * number);
                Value::Array(vec![written(corner_hz, "Hz"); 2])
            }
        }
    }
}
