//! A Kalman filter of a device as source code for a microcontroller, in C99 and in Rust, in numbers of 32 bits, and of 64 where these do
//! not suffice.
//!
//! The equations of the device are brought into units in which f32 suits: states in typical sizes, the time in samples, what is
//! measured in standard deviations of its noise. Constants are multiplied into sums, a state's unit is chosen so that as many
//! constants as possible are exactly one, and equal parts are computed once. The covariance is a triangle, and products with
//! what is always zero or one are left out: a parameter that is a state, whose row of the Jacobian is its own, costs little.

mod c;
mod error;
mod filter;
mod interface;
mod laws;
mod lower;
mod model;
mod names;
mod pairs;
mod rehearsal;
mod request;
mod rewrite;
mod routine;
mod runge_kutta;
mod rust;
mod scale;
mod tables;
mod tape;
mod trial;
mod values;

pub use error::EmitError;
pub use request::{
    EmitDigits, EmitEvent, EmitGain, EmitLanguage, EmitMeasure, EmitRequest, FreeParameter, StateStart,
    StepMethod, TestSample, TestVectors,
};

use crate::device::Device;
use filter::Program;

/// A filter as source.
#[derive(Clone, Debug, PartialEq)]
pub struct EmittedFilter {
    /// Names and contents of the files: the filter, its test of itself where there are vectors, and an example `main`.
    pub files: Vec<(String, String)>,
    /// The unit of each state in SI, and what it is counted from: x = origin + unit·z.
    pub units: Vec<(f64, f64)>,
    /// How many sums, products, divisions, calls of functions and choices a prediction and the corrections of a sample take,
    /// stages of Runge and Kutta's method included.
    pub operations: [usize; 5],
    /// How many digits it computes with; never [`EmitDigits::AsNeeded`].
    pub digits: EmitDigits,
}

impl Device {
    /// A Kalman filter of the device as source code.
    ///
    /// # Errors
    ///
    /// A request that does not fit the device, equations that are too large once they are differentiated, a derivative of a law
    /// that has no form in source, and constants that numbers of 32 bits do not hold.
    ///
    /// ```
    /// use kalmems_equations::*;
    /// let text = r#"
    /// [states]
    /// x = "m"
    /// v = "m/s"
    /// [inputs]
    /// force = "N"
    /// [parameters]
    /// m = "2 g"
    /// k = "3 N/m"
    /// [derivative]
    /// x = "v"
    /// v = "(force - k*x)/m"
    /// [measure]
    /// signal = "x/1[um/V] in V"
    /// "#;
    /// let device = Device::of(&Description::read(text)?)?;
    /// let request = EmitRequest {
    ///     name: "mass".to_owned(),
    ///     heading: vec!["Experiment `mass`.".to_owned()],
    ///     interval_s: 1e-4,
    ///     method: StepMethod::RungeKutta,
    ///     parameters: device.values(),
    ///     adjustable: vec![],
    ///     states: vec![StateStart::at(0.0); 2],
    ///     start_covariance: vec![1e-12, 0.0, 0.0, 1e-6],
    ///     process_noise: vec![0.0, 0.0, 0.0, 1e-12],
    ///     free: vec![],
    ///     measures: vec![EmitMeasure { measure: 0, variance: 1e-4 }],
    ///     events: vec![],
    ///     gain: EmitGain::Covariance,
    ///     digits: EmitDigits::Single,
    ///     vectors: None,
    /// };
    /// let emitted = device.emit(&request, EmitLanguage::C)?;
    /// let names: Vec<&str> = emitted.files.iter().map(|(name, _)| name.as_str()).collect();
    /// assert_eq!(names, ["mass.h", "mass.c", "main.c"]);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn emit(&self, request: &EmitRequest, language: EmitLanguage) -> Result<EmittedFilter, EmitError> {
        let mut program = Program::of(self, request)?;
        let digits = rehearsal::choose(self, request, &mut program);
        let mut files = match language {
            EmitLanguage::C => c::files(self, request, &program)?,
            EmitLanguage::Rust => rust::files(self, request, &program)?,
        };
        files.extend(trial::files(self, request, &program, language)?);
        let units = program.units.scale.iter().copied().zip(program.units.origins.iter().copied());
        Ok(EmittedFilter { files, units: units.collect(), operations: program.operations(request), digits })
    }
}

impl Program {
    /// How many operations of each kind a sample takes.
    fn operations(&self, request: &EmitRequest) -> [usize; 5] {
        let mut sum = [0; 5];
        let mut add = |counts: [usize; 5], times: usize| {
            sum.iter_mut().zip(counts).for_each(|(sum, count)| *sum += times * count);
        };
        add(self.predict.counts(), 1);
        if let Some(stage) = &self.stage {
            add(stage.counts(), self.predict.calls.len());
        }
        self.updates.iter().take(request.measures.len()).for_each(|update| add(update.counts(), 1));
        sum
    }
}

#[cfg(test)]
mod tests {
    use super::rehearsal::functions;

    /// The largest error in units of the last digit of a number of 32 bits, or of what is there near 0.
    fn worst(
        ours: impl Fn(f32) -> f32,
        exact: impl Fn(f64) -> f64,
        [low, high]: [f64; 2],
        floor: f64,
    ) -> f64 {
        let mut worst = 0.0_f64;
        for k in 0..=20_000 {
            #[allow(clippy::cast_possible_truncation)] // rounding to f32 is what is wanted
            let x = (low + (high - low) * f64::from(k) / 20_000.0) as f32;
            let expected = exact(f64::from(x));
            let error = (f64::from(ours(x)) - expected).abs() / expected.abs().max(floor);
            worst = worst.max(error / f64::from(f32::EPSILON));
        }
        worst
    }

    #[test]
    fn functions_of_the_source_have_the_digits_of_f32() {
        let close = |what: &str, found: f64| {
            println!("{what}: {found:.2} units of the last digit");
            assert!(found < 2.5, "{what}: {found}");
        };
        close("exp", worst(functions::exp, f64::exp, [-85.0, 88.0], 0.0));
        close("falling exp", worst(functions::falling_exp, f64::exp, [-60.0, 0.0], 0.0));
        close("ln", worst(functions::ln, f64::ln, [1e-3, 20.0], 1.0));
        close("sin", worst(functions::sin, f64::sin, [-50.0, 50.0], 0.1));
        close("cos", worst(functions::cos, f64::cos, [-50.0, 50.0], 0.1));
        close("tanh", worst(functions::tanh, f64::tanh, [-9.0, 9.0], 0.0));
        close("atanh", worst(functions::atanh, f64::atanh, [-0.99, 0.99], 0.0));
        close("sqrt", worst(functions::sqrt, f64::sqrt, [0.0, 1e4], 0.0));
        let ln_cosh = |x: f64| x.cosh().ln();
        close("ln cosh near 0", worst(functions::ln_cosh, ln_cosh, [-0.499, 0.499], 1e-4));
        // Elsewhere it is a difference of numbers up to ln 2.
        close("ln cosh", worst(functions::ln_cosh, ln_cosh, [-20.0, 20.0], 0.5));
        let ratio = |z: f64| if z.abs() < 1e-4 { 1.0 + z * z / 3.0 } else { z.atanh() / z };
        close("atanh(z)/z", worst(|z| functions::atanhc(z, 0), ratio, [-0.98, 0.98], 0.0));
        let slope =
            |z: f64| if z.abs() < 1e-3 { 2.0 * z / 3.0 } else { (1.0 / (1.0 - z * z) - ratio(z)) / z };
        let bend = |z: f64| match z.abs() {
            0.0..0.03 => 2.0 / 3.0 + 12.0 * z * z / 5.0 + 30.0 * z.powi(4) / 7.0,
            _ => 2.0 * ((1.0 - z * z).powi(-2) - slope(z) / z),
        };
        for (what, order, exact) in [("slope", 1, &slope as &dyn Fn(f64) -> f64), ("bend", 2, &bend)] {
            let found = worst(|z| functions::atanhc(z, order), exact, [-0.95, 0.95], 0.1);
            println!("{what} of atanh(z)/z: {found:.2} units of the last digit");
            // Differences of numbers that are larger, from |z| = 1/2 on.
            assert!(found < 40.0, "{what}: {found}");
        }
        assert_eq!((functions::exp(f32::NEG_INFINITY), functions::exp(100.0)), (0.0, f32::INFINITY));
        assert_eq!((functions::ln(0.0), functions::sqrt(0.0)), (f32::NEG_INFINITY, 0.0));
        assert!(
            functions::ln(-1.0).is_nan()
                && functions::sqrt(-1.0).is_nan()
                && functions::exp(f32::NAN).is_nan()
        );
    }
}
