//! What the functions of a filter take and give, the same in both languages.

use super::filter::FilterProgram;
use super::names::SourceNames;
use super::request::{EmitRequest, StepMethod};
use super::routine::{Routine, StorageArray, Widths};
use crate::device::Device;
use std::fmt::Write as _;

/// Arguments and texts.
pub(super) struct Interface {
    /// Lines at the head of each file.
    pub(super) heading: Vec<String>,
    /// The inputs of the prediction, and of a whole step.
    pub(super) predict: Vec<String>,
    pub(super) step: Vec<String>,
    /// The measurements of a step.
    pub(super) measured: Vec<String>,
    /// A line for each state.
    states: Vec<String>,
    /// Names and units of the inputs.
    inputs: Vec<String>,
    units: Vec<String>,
}

impl Interface {
    pub(super) fn of(device: &Device, request: &EmitRequest, program: &FilterProgram) -> Self {
        let predict = Self::inputs_of(device, program, &program.predict);
        let mut step = predict.clone();
        for update in program.updates.iter().take(request.measures.len()) {
            for input in Self::inputs_of(device, program, update) {
                if !step.contains(&input) {
                    step.push(input);
                }
            }
        }
        let free = request.free.iter().filter_map(|f| device.parameters.get(f.parameter)).map(|p| &p.named);
        let states = device.states.iter().chain(free).enumerate().map(|(k, named)| {
            let (scale, origin) = (program.units.scale(k), program.units.origin(k));
            let from = if origin == 0.0 { String::new() } else { format!(", counted from {origin:?} in SI") };
            format!("{k}: {}, in units of {scale:?} in SI ({}){from}", named.name, named.unit_text)
        });
        let inputs = device.inputs.iter().map(|input| format!("{} in SI ({})", input.name, input.unit_text));
        let units = request.measures.iter().filter_map(|m| device.measures.get(m.measure));
        let method = match request.method {
            StepMethod::Euler => "Euler's method",
            StepMethod::RungeKutta if request.linear.is_empty() => "Runge and Kutta's method",
            StepMethod::RungeKutta => "exponential time differencing of fourth order",
        };
        let mut heading = vec![format!(
            "An extended Kalman filter, made by kalmems-equations {} from a device's equations; not to be edited.",
            env!("CARGO_PKG_VERSION")
        )];
        heading.extend(request.heading.iter().cloned());
        heading.push(if request.parts > 1 {
            format!("Each prediction over {:?} s, by {method}.", request.interval_s)
        } else {
            format!("Sampling interval {:?} s, steps by {method}.", request.interval_s)
        });
        heading.push(
            match program.widths {
                Widths { mean: false, .. } => "Numbers have 32 bits.",
                Widths { covariance: false, .. } => {
                    "The means and what is expected of measurements are computed in 64 bits, covariance and gain in 32."
                }
                _ => "Means and covariance have 64 bits.",
            }
            .to_owned(),
        );
        if let [first, others @ ..] = program.rehearsed.as_slice() {
            let least = others.iter().copied().fold(f64::INFINITY, f64::min);
            let by_more =
                if program.widths.mean { format!(", and with these {least:.1e}") } else { String::new() };
            heading.push(format!(
                "In a rehearsal with numbers of 32 bits the largest difference from the filter of the library was {first:.1e} of the largest \
                 value of a state{by_more}."
            ));
        }
        Self {
            heading,
            predict,
            step,
            measured: (0..request.measures.len()).map(|k| program.names.measured(k)).collect(),
            states: states.collect(),
            inputs: inputs.collect(),
            units: units.map(|named| format!("SI ({})", named.unit_text)).collect(),
        }
    }

    /// The inputs that a routine takes, in the order of the device and of time.
    pub(super) fn inputs_of(device: &Device, program: &FilterProgram, routine: &Routine) -> Vec<String> {
        let names = routine.names();
        let points = ["start", "middle", "end"];
        let all = (0..device.inputs.len()).flat_map(|k| points.map(|point| program.names.input(k, point)));
        let mut inputs: Vec<String> = all.filter(|name| names.contains(name)).collect();
        inputs.dedup();
        inputs
    }

    /// What is loaded from the filter into names, with where it is.
    pub(super) fn loads(
        &self,
        routine: &Routine,
        program: &FilterProgram,
    ) -> Vec<(String, StorageArray, usize)> {
        let names = routine.names();
        let size = self.states.len();
        let mut loads = Vec::new();
        let means = (0..size).map(|k| (program.names.state(k), StorageArray::Mean, k));
        let entries = (0..size).flat_map(|i| (0..=i).map(move |j| (i, j)));
        let covariances = entries
            .map(|(i, j)| (SourceNames::covariance(i, j), StorageArray::Covariance, i * (i + 1) / 2 + j));
        let count = program.configure.as_ref().map_or(0, |configure| configure.outputs.len());
        let constants = (0..count).map(|k| (format!("c{k}"), StorageArray::Constants, k));
        loads.extend(means.chain(covariances).chain(constants).filter(|(name, ..)| names.contains(name)));
        loads
    }

    /// Parameters that may change: fields, units, and values in SI.
    pub(super) fn parameters(
        device: &Device,
        request: &EmitRequest,
        program: &FilterProgram,
    ) -> Vec<(String, String, f64)> {
        let of = |place: &usize| {
            let parameter = device.parameters.get(*place)?;
            let value = request.parameters.get(*place).copied()?;
            let unit = format!("{} in SI ({})", parameter.named.name, parameter.named.unit_text);
            Some((program.names.parameter(*place), unit, value))
        };
        request.adjustable.iter().filter_map(of).collect()
    }

    /// The parameters of a function in C.
    pub(super) fn arguments(name: &str, inputs: &[String], measured: &[String]) -> String {
        format!("{name}_t *filter{}", further(inputs.iter().chain(measured), "float ", ""))
    }

    /// The states, a line for each.
    pub(super) fn states(&self, indent: &str) -> String {
        lines(&self.states, indent)
    }

    /// The inputs, a line for each.
    pub(super) fn inputs(&self, indent: &str) -> String {
        lines(&self.inputs, indent)
    }
}

/// A correction as a function of the source.
pub(super) struct UpdateFunction<'p> {
    pub(super) routine: &'p Routine,
    /// What it is called within the source.
    pub(super) name: String,
    pub(super) inputs: Vec<String>,
    /// What it is handed beside the inputs: a measurement, or of an event the time since then.
    pub(super) measured: [String; 1],
    pub(super) is_event: bool,
    /// The unit of the measurement.
    unit: String,
}

impl<'p> UpdateFunction<'p> {
    /// Those of a filter, the measurements first.
    pub(super) fn all(
        interface: &Interface,
        (device, request): (&Device, &EmitRequest),
        program: &'p FilterProgram,
    ) -> impl Iterator<Item = Self> {
        program.updates.iter().enumerate().map(move |(place, routine)| Self {
            routine,
            name: format!("update_{}", program.names.measure(place)),
            inputs: Interface::inputs_of(device, program, routine),
            measured: [program.names.measured(place)],
            is_event: place >= request.measures.len(),
            unit: plain(interface.units.get(place).map_or("", String::as_str)),
        })
    }

    /// What it does; `mark` stands around the names of the language.
    pub(super) fn description(&self, mark: &str) -> String {
        if self.is_event {
            let [ago_s] = &self.measured;
            format!(
                "Corrects by an event {mark}{ago_s}{mark} s before the sample, where its expression was zero."
            )
        } else {
            format!("Corrects by a measurement in {}.", self.unit)
        }
    }

    /// The inputs, and what was measured behind them.
    pub(super) fn arguments(&self) -> Vec<String> {
        self.inputs.iter().chain(&self.measured).cloned().collect()
    }
}

/// Lines behind an indent, none of which ends a comment.
fn lines(lines: &[String], indent: &str) -> String {
    let mut text = String::new();
    for line in lines {
        let _ = writeln!(text, "{indent}{}", plain(line));
    }
    text
}

/// What stands behind the first argument of a function: each one after a comma, between `before` and `after`.
pub(super) fn further<'a>(
    arguments: impl IntoIterator<Item = &'a String>,
    before: &str,
    after: &str,
) -> String {
    let mut text = String::new();
    for argument in arguments {
        let _ = write!(text, ", {before}{argument}{after}");
    }
    text
}

/// A text that cannot end a comment.
fn plain(text: &str) -> String {
    text.replace("*/", "* /").replace("/*", "/ *").replace(['\n', '\r'], " ")
}

/// What stands in a text behind a marker and before the next one.
pub(super) fn part<'a>(text: &'a str, marker: &str, next: &str) -> &'a str {
    let behind = text.split_once(marker).map_or("", |(_, behind)| behind);
    behind.split_once(next).map_or(behind, |(part, _)| part)
}

impl Routine {
    /// The call of its function over a state, with constants where it needs them.
    pub(super) fn call(&self, name: &str, (state, constants): (&str, &str), arguments: &[String]) -> String {
        let constants = if self.reads_constants() { format!(", {constants}") } else { String::new() };
        format!("{name}({state}{constants}{})", further(arguments, "", ""))
    }

    /// Whether it needs what follows from parameters.
    pub(super) fn reads_constants(&self) -> bool {
        self.names().iter().any(|name| {
            name.strip_prefix('c').is_some_and(|place| place.bytes().all(|byte| byte.is_ascii_digit()))
        })
    }
}

impl FilterProgram {
    /// All parts.
    pub(super) fn routines(&self) -> Vec<&Routine> {
        let some = self.configure.iter().chain(&self.stage).chain([&self.predict]);
        some.chain(&self.updates).collect()
    }
}
