//! What the functions of a filter take and give, the same in both languages.

use super::error::EmitError;
use super::filter::FilterProgram;
use super::names::SourceNames;
use super::request::{EmitDigits, EmitRequest, InputCourse, StepMethod};
use super::routine::{Routine, StorageArray, Widths};
use crate::device::{Device, Parameter};
use kalmems_units::si_text;
use std::fmt::Write as _;

/// Arguments and texts.
pub(super) struct Interface {
    /// Lines at the head of each file.
    pub(super) heading: Vec<String>,
    /// The inputs of one step of the method, of the prediction over the interval between samples, and of a whole step.
    pub(super) part: Vec<String>,
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
        let part = Self::inputs_of(device, program, &program.predict);
        let predict = if request.parts > 1 { over_interval(device, program, &part) } else { part.clone() };
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
        heading.push(match request.parts {
            1 => format!("A step goes over {:?} s, by {method}.", request.interval_s),
            parts => format!(
                "A step goes over {:?} s, in {parts} parts by {method}.",
                request.sampling_interval_s()
            ),
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
        heading.extend(parameters_in_si(device, request));
        if let [first, others @ ..] = program.rehearsed.as_slice() {
            let least = others.iter().copied().fold(f64::INFINITY, f64::min);
            let (of_32, by_more) = match request.digits {
                EmitDigits::AsNeeded if program.widths.mean => {
                    (" with numbers of 32 bits", format!(", and with these {least:.1e}"))
                }
                EmitDigits::AsNeeded => (" with numbers of 32 bits", String::new()),
                _ => ("", String::new()),
            };
            heading.push(format!(
                "In a rehearsal{of_32} over up to {} samples the largest difference from the filter of the library was {first:.1e} of the largest value of \
                 a state{by_more}.",
                request.rehearsal.len()
            ));
        }
        Self {
            heading,
            part,
            predict,
            step,
            measured: (0..request.measures.len()).map(|k| program.names.measured(k)).collect(),
            states: states.collect(),
            inputs: inputs.collect(),
            units: units.map(|named| format!("SI ({})", named.unit_text)).collect(),
        }
    }

    /// What one step of the method takes of the inputs over the interval between samples, where it begins at `from`, an expression, and has this length
    /// as parts of it: an input goes on a parabola through its three points, and one that is held stays.
    pub(super) fn part_arguments(
        &self,
        device: &Device,
        program: &FilterProgram,
        length: f64,
        digits: impl Fn(f64) -> Result<String, EmitError>,
    ) -> Result<Vec<String>, EmitError> {
        let mut arguments = Vec::new();
        for name in &self.part {
            let input = (0..device.inputs.len())
                .find(|input| POINTS.iter().any(|(point, _)| program.names.input(*input, point) == *name));
            let between = input.filter(|input| program.names.course(*input) == InputCourse::Between);
            arguments.push(match between {
                None => name.clone(),
                Some(input) => {
                    let points = POINTS.map(|(point, _)| program.names.input(input, point));
                    let place = POINTS
                        .iter()
                        .zip(&points)
                        .find(|(_, own)| *own == name)
                        .map_or(0.0, |((_, at), _)| *at);
                    let place = match place {
                        0.0 => "from".to_owned(),
                        place => format!("from + {}", digits(place * length)?),
                    };
                    format!("between({}, {place})", points.join(", "))
                }
            });
        }
        Ok(arguments)
    }

    /// Input and point of each of these names of inputs.
    pub(super) fn points_of(
        device: &Device,
        program: &FilterProgram,
        names: &[String],
    ) -> Vec<(usize, usize)> {
        let all =
            (0..device.inputs.len()).flat_map(|input| (0..POINTS.len()).map(move |point| (input, point)));
        let all: Vec<(usize, usize)> = all.collect();
        let name = |(input, point): (usize, usize)| program.names.input(input, POINTS[point].0);
        // One that is held has the same name at two points.
        names.iter().filter_map(|own| all.iter().copied().find(|place| name(*place) == *own)).collect()
    }

    /// The inputs that a routine takes, in the order of the device and of time.
    pub(super) fn inputs_of(device: &Device, program: &FilterProgram, routine: &Routine) -> Vec<String> {
        let names = routine.names();
        let all =
            (0..device.inputs.len()).flat_map(|k| POINTS.map(|(point, _)| program.names.input(k, point)));
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

    /// The statements that replace each missing input by its last number; `of` writes one for a name and its place among the inputs.
    pub(super) fn held(&self, inputs: &[String], of: impl Fn(&str, usize) -> String) -> String {
        let place = |name: &String| self.step.iter().position(|own| own == name);
        inputs.iter().filter_map(|name| Some(of(name, place(name)?))).collect()
    }

    /// The statements that make a gap of each measurement at an end of its range; `of` writes one for a name, its place and the ends.
    pub(super) fn ranged(
        &self,
        request: &EmitRequest,
        measured: &[String],
        of: impl Fn(&str, usize, [f64; 2]) -> Result<String, EmitError>,
    ) -> Result<String, EmitError> {
        let mut text = String::new();
        for (place, (name, measure)) in self.measured.iter().zip(&request.measures).enumerate() {
            if let Some(range) = measure.range.filter(|_| measured.contains(name)) {
                text += &of(name, place, range)?;
            }
        }
        Ok(text)
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

/// The parameters of which the constants are made, a line for each.
fn parameters_in_si(device: &Device, request: &EmitRequest) -> Vec<String> {
    let is_state = |place: &usize| request.free.iter().any(|free| free.parameter == *place);
    let known = device.parameters.iter().zip(&request.parameters).enumerate();
    let line = |(_, (parameter, value)): (usize, (&Parameter, &f64))| {
        let unit = si_text(&parameter.named.unit_text).replace('²', "^2").replace('³', "^3");
        format!("- {} = {value:?} {unit}", parameter.named.name).trim_end().to_owned()
    };
    let lines: Vec<String> = known.filter(|(place, _)| !is_state(place)).map(line).collect();
    if lines.is_empty() {
        return lines;
    }
    std::iter::once("Its constants are those of these parameters, in SI:".to_owned()).chain(lines).collect()
}

/// The points of an interval at which an input is asked for, in parts of it.
pub(super) const POINTS: [(&str, f64); 3] = [("start", 0.0), ("middle", 0.5), ("end", 1.0)];

/// The inputs over an interval that goes in several steps: all three points of one that does not stay.
fn over_interval(device: &Device, program: &FilterProgram, part: &[String]) -> Vec<String> {
    let mut inputs = Vec::new();
    for input in 0..device.inputs.len() {
        let points = POINTS.map(|(point, _)| program.names.input(input, point));
        if !points.iter().any(|point| part.contains(point)) {
            continue;
        }
        if program.names.course(input) == InputCourse::Between {
            inputs.extend(points);
        } else {
            inputs.extend(points.into_iter().filter(|point| part.contains(point)));
        }
    }
    inputs.dedup();
    inputs
}

/// Where a routine is called: its state, its watch and the constants.
pub(super) struct CallTargets<'a> {
    pub(super) state: &'a str,
    pub(super) watch: &'a str,
    pub(super) constants: &'a str,
}

/// A correction as a function of the source.
pub(super) struct UpdateFunction<'p> {
    pub(super) routine: &'p Routine,
    /// Its place among the measurements and the events behind them.
    pub(super) place: usize,
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
            place,
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
    /// The call of its function over a state, with a watch and constants where it needs them.
    pub(super) fn call(&self, name: &str, targets: &CallTargets<'_>, arguments: &[String]) -> String {
        let CallTargets { state, watch, constants } = targets;
        let watch = if self.residual.is_some() { format!(", {watch}") } else { String::new() };
        let constants = if self.reads_constants() { format!(", {constants}") } else { String::new() };
        format!("{name}({state}{watch}{constants}{})", further(arguments, "", ""))
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
