//! A Kalman filter of a device as source code for a microcontroller, in C99 and in Rust, in numbers of 32 bits, and of 64 where these do
//! not suffice.
//!
//! The equations of the device are brought into units in which f32 suits: states in typical sizes, the time in samples, what is
//! measured in standard deviations of its noise. Constants are multiplied into sums, a state's unit is chosen so that as many
//! constants as possible are exactly one, and equal parts are computed once. The covariance is a triangle, and products with
//! what is always zero or one are left out: a parameter that is a state, whose row of the Jacobian is its own, costs little.

mod accessors;
mod c;
mod crc;
mod error;
mod example_program;
mod explanation;
mod exponential;
mod filter;
mod interface;
mod laws;
mod lower;
mod model;
mod names;
mod pairs;
mod rehearsal;
mod request;
pub(crate) mod rewrite;
mod routine;
mod runge_kutta;
mod rust;
mod scale;
mod size;
mod tables;
mod tape;
mod trial;
mod values;
mod watch;

pub use error::EmitError;
pub use request::{
    EmitDigits, EmitEvent, EmitGain, EmitLanguage, EmitMeasure, EmitRequest, EmitWatch, FreeParameter,
    InputCourse, SettledGain, StateStart, StepMethod, TestSample, TestVectors,
};

use crate::device::Device;
use accessors::state_accesses;
use filter::FilterProgram;
use interface::Interface;
use routine::Routine;

/// A filter as source.
#[derive(Clone, Debug, PartialEq)]
pub struct EmittedFilter {
    /// Names and contents of the files: the filter, its test of itself where there are vectors, and an example `main`.
    pub files: Vec<(String, String)>,
    /// The inputs that a step takes in their order, before the measurements of the request: each by its place among the device's inputs and its point of
    /// the interval before the sample, 0 at the start, 1 in the middle and 2 at the end.
    pub inputs: Vec<(usize, usize)>,
    /// The names of these inputs, then those of the measurements.
    pub columns: Vec<String>,
    /// The names of the states with their units, as the functions of the source have them.
    pub states: Vec<String>,
    /// The unit of each state in SI, and what it is counted from: x = origin + unit·z.
    pub units: Vec<(f64, f64)>,
    /// How many sums, products, divisions, calls of functions and choices a prediction and the corrections of a sample take,
    /// stages of Runge and Kutta's method included.
    pub operations: [usize; 5],
    /// How many of these are in numbers of 64 bits.
    pub wide_operations: [usize; 5],
    /// How many numbers a step reads and writes: means and the triangle of the covariance.
    pub numbers: usize,
    /// The size of the filter's structure in C in bytes, where an `unsigned` has four.
    pub bytes: usize,
    /// How many digits it computes with; never [`EmitDigits::AsNeeded`].
    pub digits: EmitDigits,
    /// The farthest that a state was, in a rehearsal with these digits, from that of the library's filter, by the standard deviation that it claims
    /// there, with the state's place; none without a rehearsal or a claim.
    pub apart: Option<(usize, f64)>,
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
    ///     linear: vec![],
    ///     name: "mass".to_owned(),
    ///     courses: vec![],
    ///     heading: vec!["Experiment `mass`.".to_owned()],
    ///     interval_s: 1e-4,
    ///     parts: 1,
    ///     method: StepMethod::RungeKutta,
    ///     parameters: device.values(),
    ///     adjustable: vec![],
    ///     experiment: 0,
    ///     states: vec![StateStart::at(0.0); 2],
    ///     start_covariance: vec![1e-12, 0.0, 0.0, 1e-6],
    ///     process_noise: vec![0.0, 0.0, 0.0, 1e-12],
    ///     free: vec![],
    ///     measures: vec![EmitMeasure { measure: 0, variance: 1e-4, range: None }],
    ///     events: vec![],
    ///     gain: EmitGain::Covariance,
    ///     digits: EmitDigits::Single,
    ///     update_every: 1,
    ///     watch: EmitWatch { largest_nis: 28.4, rejects: true, settling: 1000, memory: 100 },
    ///     mirrored: false,
    ///     rehearsal: vec![],
    ///     vectors: None,
    /// };
    /// let emitted = device.emit(&request, EmitLanguage::C)?;
    /// let names: Vec<&str> = emitted.files.iter().map(|(name, _)| name.as_str()).collect();
    /// assert_eq!(names, ["mass.h", "mass.c", "main.c"]);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn emit(&self, request: &EmitRequest, language: EmitLanguage) -> Result<EmittedFilter, EmitError> {
        let mut program = FilterProgram::of(self, request)?;
        let (digits, apart) = rehearsal::choose(self, request, &mut program);
        let mut files = match language {
            EmitLanguage::C => c::files(self, request, &program)?,
            EmitLanguage::Rust => rust::files(self, request, &program)?,
        };
        files.extend(trial::files(self, request, &program, language)?);
        let interface = Interface::of(self, request, &program);
        let units = program.units.scale.iter().copied().zip(program.units.origins.iter().copied());
        Ok(EmittedFilter {
            files,
            inputs: Interface::points_of(self, &program, &interface.step),
            columns: interface.step.into_iter().chain(interface.measured).collect(),
            states: state_accesses(self, request, &program).into_iter().map(|state| state.function).collect(),
            units: units.collect(),
            operations: program.operations(request, Routine::counts),
            wide_operations: program.operations(request, Routine::wide_counts),
            numbers: program.start.0.len() + program.start.1.len(),
            bytes: size::bytes(self, request, &program),
            digits,
            apart,
        })
    }
}

impl FilterProgram {
    /// How many operations of each kind a sample takes.
    fn operations(&self, request: &EmitRequest, counted: impl Fn(&Routine) -> [usize; 5]) -> [usize; 5] {
        let mut sum = [0; 5];
        let mut add = |counts: [usize; 5], times: usize| {
            sum.iter_mut().zip(counts).for_each(|(sum, count)| *sum += times * count);
        };
        add(counted(&self.predict), request.parts);
        if let Some(stage) = &self.stage {
            add(counted(stage), request.parts * self.predict.calls.len());
        }
        self.updates.iter().take(request.measures.len()).for_each(|update| add(counted(update), 1));
        sum
    }
}
