//! What an identification puts into the device's table.

use super::IdentifyError;
use crate::config::kinds::KindOf;
use crate::config::{ConfigFault, Experiment, Key, Quantity, SignOf};
use crate::fit::DerivedNumber;

/// Numbers of the device's table that were identified, and how their errors hang together.
#[derive(Clone, Debug, Default)]
pub struct Entries {
    /// Whether standard errors are written with all digits.
    is_exact: bool,
    names: Vec<String>,
    correlation: Vec<Vec<f64>>,
}

impl Entries {
    /// None yet, of numbers whose errors cancel in what is made of them, as those of the coefficients of a series: with three digits of each standard
    /// error nothing would be left of that.
    pub fn with_all_digits() -> Self {
        Self { is_exact: true, ..Self::default() }
    }

    /// Puts a number with its standard error into its place; its name is its key below the device's table. A number that the recordings do
    /// not determine, whose error is not finite, leaves what stands there.
    pub fn set<K: KindOf, S: SignOf>(
        &mut self,
        experiment: &Experiment,
        (name, place): (&str, &mut Quantity<K, S>),
        found: DerivedNumber,
        unit: &str,
    ) -> Result<(), IdentifyError> {
        if !found.deviation.is_finite() {
            return Ok(());
        }
        let key = || Key::from("device").child(experiment.device_name()).child(name);
        *place = Quantity::of_uncertain(found.value, found.deviation, unit, self.is_exact)
            .map_err(|why| experiment.error(key(), ConfigFault::Value { why }))?;
        if found.deviation > 0.0 && !self.names.iter().any(|own| own == name) {
            self.correlation.iter_mut().for_each(|row| row.push(0.0));
            self.names.push(name.to_owned());
            self.correlation.push(
                (0..self.names.len()).map(|i| f64::from(u8::from(i + 1 == self.names.len()))).collect(),
            );
        }
        Ok(())
    }

    /// Says how the errors of two numbers hang together; of a number that was not put into its place nothing is said.
    pub fn correlate(&mut self, first: &str, second: &str, correlation: f64) {
        let place = |name: &str| self.names.iter().position(|own| own == name);
        if let (Some(i), Some(j)) = (place(first), place(second))
            && correlation.is_finite()
        {
            (self.correlation[i][j], self.correlation[j][i]) = (correlation, correlation);
        }
    }

    /// Says it of all pairs, by the covariances of their errors.
    pub fn correlate_all(&mut self, names: &[&str], covariance: &dyn Fn(usize, usize) -> f64) {
        for (i, first) in names.iter().enumerate() {
            for (j, second) in names.iter().enumerate().take(i) {
                let scale = (covariance(i, i) * covariance(j, j)).sqrt();
                self.correlate(first, second, covariance(i, j) / scale);
            }
        }
    }

    /// Writes the correlations into the experiment that has the numbers.
    pub fn write(&self, experiment: &mut Experiment) {
        experiment.set_correlations(&self.names, &self.correlation);
    }
}

/// A number that is put into its place without an error of its own: a variance of noise, or what belongs to another number.
pub const fn exact(value: f64) -> DerivedNumber {
    DerivedNumber { value, deviation: 0.0 }
}
