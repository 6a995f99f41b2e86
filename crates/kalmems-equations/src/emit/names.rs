//! Names of a device as both languages have them.

use super::request::{EmitRequest, InputCourse};
use crate::device::{Device, Named};
use crate::graph::Variable;

/// The names that stand in the source. Each begins with what it is of, so that none is a word of a language.
#[derive(Clone, Debug)]
pub(super) struct SourceNames {
    /// With the parameters that are states.
    states: Vec<String>,
    inputs: Vec<String>,
    /// Of all parameters; a structure has those that a program may change.
    parameters: Vec<String>,
    /// The measurements of the request, and behind them its events.
    measures: Vec<String>,
    /// How many measurements there are.
    measured: usize,
    /// How each input goes between two samples.
    courses: Vec<InputCourse>,
}

impl SourceNames {
    /// What a correction is handed: what is measured, or how long ago in s an event was. Behind the inputs of every device.
    pub(super) const MEASURED: Variable = Variable::Input(usize::MAX);

    pub(super) fn of(device: &Device, request: &EmitRequest) -> Self {
        let free = request.free.iter().filter_map(|free| device.parameters.get(free.parameter));
        let states = device.states.iter().chain(free.map(|parameter| &parameter.named));
        let measures = request.measures.iter().filter_map(|m| device.measures.get(m.measure));
        let events = request.events.iter().filter_map(|e| device.events.get(e.event));
        Self {
            states: plain_names(states),
            inputs: plain_names(device.inputs.iter()),
            parameters: plain_names(device.parameters.iter().map(|parameter| &parameter.named)),
            measures: plain_names(measures.chain(events)),
            measured: request.measures.len(),
            courses: request.courses.clone(),
        }
    }

    /// How an input goes between two samples.
    pub(super) fn course(&self, index: usize) -> InputCourse {
        self.courses.get(index).copied().unwrap_or(InputCourse::Between)
    }

    fn at(names: &[String], index: usize) -> &str {
        names.get(index).map_or("", String::as_str)
    }

    /// A state, to follow on what it is asked of.
    pub(super) fn plain_state(&self, index: usize) -> &str {
        Self::at(&self.states, index)
    }

    /// The mean of a state.
    pub(super) fn state(&self, index: usize) -> String {
        format!("x_{}", self.plain_state(index))
    }

    /// An input at a point of the interval: `start`, `middle`, `end` as measurements see it, or `last`, the end as a prediction arrives at it.
    pub(super) fn input(&self, index: usize, point: &str) -> String {
        let point = match (self.course(index), point) {
            (InputCourse::HeldAtStart, "start" | "middle" | "last") => "start",
            (InputCourse::HeldAtMiddle, "start" | "middle" | "last") => "middle",
            (_, "last") => "end",
            (_, point) => point,
        };
        format!("u_{}_{point}", Self::at(&self.inputs, index))
    }

    /// A field for a parameter.
    pub(super) fn parameter(&self, index: usize) -> String {
        format!("p_{}", Self::at(&self.parameters, index))
    }

    /// What is measured, or how long ago in s an event was.
    pub(super) fn measured(&self, index: usize) -> String {
        let of = if index < self.measured { "y" } else { "ago" };
        format!("{of}_{}", Self::at(&self.measures, index))
    }

    /// The part of a function's name that says of which measurement or event it is.
    pub(super) fn measure(&self, index: usize) -> &str {
        Self::at(&self.measures, index)
    }

    /// An entry of the covariance's lower triangle.
    pub(super) fn covariance(i: usize, j: usize) -> String {
        format!("p{i}_{j}")
    }

    pub(super) fn variable(&self, variable: Variable, point: &str) -> String {
        match variable {
            Self::MEASURED => "seen".to_owned(),
            Variable::State(index) => self.state(index),
            Variable::Input(index) => self.input(index, point),
            Variable::Parameter(index) => self.parameter(index),
        }
    }
}

/// Names of letters that every language has, each once.
pub(super) fn plain_names<'a>(named: impl Iterator<Item = &'a Named>) -> Vec<String> {
    let mut names: Vec<String> = Vec::new();
    for named in named {
        let mut name = String::new();
        for c in named.name.chars() {
            match c {
                c if c.is_ascii_alphanumeric() || c == '_' => name.push(c),
                c => name += &format!("u{:x}", u32::from(c)),
            }
        }
        while names.contains(&name) {
            name.push('_');
        }
        names.push(name);
    }
    names
}
