//! A device: its equations, checked and in the graph.

mod calls;
mod constants;
mod followers;
mod names;
mod operations;
mod plain_parameters;
mod read;
mod resets;
mod resolve;
mod turns;

pub(crate) use names::ParsedText;
pub(crate) use resolve::fault_of;

use crate::curve::Curve;
use crate::error::EquationNotice;
use crate::graph::{Graph, NodeId};
use crate::resets::DeviceReset;
use kalmems_units::Unit;
use std::sync::Arc;

/// A name with its unit.
#[derive(Clone, Debug, PartialEq)]
pub struct Named {
    /// The name.
    pub name: Arc<str>,
    /// Its unit.
    pub unit: Unit,
    /// The unit as it is written.
    pub unit_text: Arc<str>,
}

/// A parameter: a name with its unit and value.
#[derive(Clone, Debug, PartialEq)]
pub struct Parameter {
    /// Its name and unit.
    pub named: Named,
    /// Its value in SI.
    pub value: f64,
}

/// The rate of an input, which is an input too.
#[derive(Clone, Debug)]
pub(crate) struct InputRate {
    /// The input.
    pub(crate) of: usize,
    /// What the rate is called.
    pub(crate) named: Named,
}

/// What a noise is of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NoiseKind {
    /// The power density of a state's rate, in the state's unit² per s.
    Rate {
        /// The state.
        state: usize,
    },
    /// The variance of one sample of a measurement, in its unit².
    Variance {
        /// The measurement.
        measure: usize,
    },
    /// The one-sided power density of a measurement, in its unit² per Hz: a sample at the rate f has half of f times it.
    Density {
        /// The measurement.
        measure: usize,
    },
    /// The variance of the time at which an event is told to have happened, in s².
    EventTime {
        /// The event.
        event: usize,
    },
    /// The variance of an event's expression at the time at which it is told to have happened, in its unit².
    Event {
        /// The event.
        event: usize,
    },
}

/// A noise: what it is of, its size as an expression, and whether that depends on states or inputs.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Noise {
    pub(crate) kind: NoiseKind,
    pub(crate) node: NodeId,
    pub(crate) varies: bool,
}

/// A device as differential equations, with every unit checked.
///
/// ẋ = f(x, u, p) with states x, inputs u and parameters p, and measurements h(x, u, p), all in SI and in the order in which
/// they are written. States that lags and delays add stand behind the others.
///
/// ```
/// use kalmems_equations::{Description, Device};
/// let text = r#"
/// [states]
/// x = "m"
/// v = "m/s"
/// [inputs]
/// force = "N"
/// [parameters]
/// m = "2 g"
/// k = "3 N/m"
/// b = "1e-3 N s/m"
/// [derivative]
/// x = "v"
/// v = "(force - b*v - k*x)/m"
/// [measure]
/// signal = "x/1[um/V] in V"
/// "#;
/// let device = Device::of(&Description::read(text)?)?;
/// let motion = device.motion(&[])?;
/// let mut work = motion.work(&device.values());
/// let mut rates = [0.0; 2];
/// assert!(motion.rates(&mut work, &[1e-6, 0.0], &[5e-6], &mut rates));
/// assert!((rates[1] - 1e-3).abs() < 1e-15);
/// # Ok::<(), kalmems_equations::EquationError>(())
/// ```
#[derive(Clone, Debug)]
pub struct Device {
    pub(crate) states: Vec<Named>,
    pub(crate) own_states: usize,
    pub(crate) inputs: Vec<Named>,
    pub(crate) own_inputs: usize,
    /// The inputs whose rates stand behind the stated ones.
    pub(crate) rated_inputs: Vec<usize>,
    pub(crate) parameters: Vec<Parameter>,
    pub(crate) measures: Vec<Named>,
    pub(crate) quantities: Vec<Named>,
    pub(crate) events: Vec<Named>,
    pub(crate) graph: Graph,
    pub(crate) curves: Arc<[Curve]>,
    pub(crate) rates: Vec<NodeId>,
    pub(crate) readings: Vec<NodeId>,
    /// The expressions of the quantities.
    pub(crate) followed: Vec<NodeId>,
    pub(crate) crossings: Vec<NodeId>,
    pub(crate) noise: Vec<Noise>,
    pub(crate) resets: Vec<DeviceReset>,
    pub(crate) periods: Vec<(usize, NodeId)>,
    pub(crate) energy: Option<NodeId>,
    pub(crate) notices: Vec<EquationNotice>,
    /// What is on the left of each equation, and what is on its right, for typesetting.
    pub(crate) equations: Vec<(String, DeviceEquation)>,
}

/// The right side of an equation.
#[derive(Clone, Debug)]
pub(crate) enum DeviceEquation {
    Text(Arc<ParsedText>),
    /// A law, as a reader knows it.
    Law(&'static str),
}

impl Device {
    /// Its states.
    pub fn states(&self) -> &[Named] {
        &self.states
    }

    /// How many of its states, from the first one on, are stated; lags and delays add those behind them.
    pub fn own_states(&self) -> usize {
        self.own_states
    }

    /// Its inputs: those that are stated, and behind them the rates of those whose rate some expression needs.
    pub fn inputs(&self) -> &[Named] {
        &self.inputs
    }

    /// How many of its inputs, from the first one on, are stated.
    pub fn own_inputs(&self) -> usize {
        self.own_inputs
    }

    /// Of each input behind the stated ones, the input whose time derivative it is: `ddt` of what depends on an input needs that.
    pub fn rated_inputs(&self) -> &[usize] {
        &self.rated_inputs
    }

    /// Its parameters.
    pub fn parameters(&self) -> &[Parameter] {
        &self.parameters
    }

    /// What is measured of it.
    pub fn measures(&self) -> &[Named] {
        &self.measures
    }

    /// What follows from its states and inputs and is wanted as well, such as the position that an amplitude and a phase make.
    pub fn quantities(&self) -> &[Named] {
        &self.quantities
    }

    /// Where something happens: expressions that are zero there.
    pub fn events(&self) -> &[Named] {
        &self.events
    }

    /// The values of its parameters in SI, as they are written.
    pub fn values(&self) -> Vec<f64> {
        self.parameters.iter().map(|parameter| parameter.value).collect()
    }

    /// The place of a parameter.
    pub fn parameter(&self, name: &str) -> Option<usize> {
        self.parameters.iter().position(|parameter| &*parameter.named.name == name)
    }

    /// The place of a state.
    pub fn state(&self, name: &str) -> Option<usize> {
        self.states.iter().position(|state| &*state.name == name)
    }

    /// What is allowed in its equations and probably not meant.
    pub fn notices(&self) -> &[EquationNotice] {
        &self.notices
    }

    /// How many different parts its expressions have, those of derivatives that were asked for included.
    pub fn parts(&self) -> usize {
        self.graph.len()
    }
}
