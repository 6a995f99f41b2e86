//! Whether the equations of a device keep the energy that its author states.
//!
//! With E(x, u) the stated energy and ẋ = f(x, u), Ė = ∂E/∂x·f at inputs that are held. Turn the motion around in time: a
//! state that is the rate of another changes its sign, the others do not. What a spring, a mass and a capacitance under a held
//! voltage do to E then changes its sign as well, and must cancel: E is theirs. What damping does keeps its sign, and takes
//! energy. So the odd part of Ė must vanish at every point, and the even part must not be positive. Neither needs to know
//! which parameters are damping.
//!
//! A comb that is held at a voltage pulls by ½·C′·V², and its part of E is −½·C·V²: the voltage source's energy counts too.
//! With that part in E a lost ½ in the force is found. An input that E does not contain does work of its own; it is 0 in the
//! check.

use crate::device::Device;
use crate::error::{EquationError, EquationFault};
use crate::graph::{Graph, NodeId, Variable};
use crate::motion::{MOST_STATES, padded, whole};
use crate::program::Program;
use kalmems_core::Scalar;
use std::fmt;

/// What the check of a device's energy found.
#[derive(Clone, Debug, PartialEq)]
pub struct EnergyCheck {
    /// The largest part of Ė that no damping explains, relative to the sizes of the powers that should cancel.
    pub imbalance: f64,
    /// The powers at the point where it is largest.
    pub powers: Vec<StatePower>,
    /// The states that change their sign with the direction of time: rates of other states.
    pub velocities: Vec<String>,
    /// Whether Ė was positive at some point where nothing but damping should act.
    pub gains: bool,
    /// Whether something takes energy at some point.
    pub is_damped: bool,
    /// Inputs that were 0, since the stated energy does not contain them.
    pub inputs_at_rest: Vec<String>,
}

/// What one state's motion does to the energy, in the unit of the energy per second.
#[derive(Clone, Debug, PartialEq)]
pub struct StatePower {
    /// The state.
    pub state: String,
    /// ∂E/∂x·ẋ, the part that changes its sign with the direction of time.
    pub value: f64,
}

/// What is left of powers that cancel, beyond rounding.
const CANCELLED: f64 = 1e-9;
/// ln 10⁹: how far below its unit a state of unknown size may be.
pub(crate) const DECADES: f64 = 20.723_265_836_946_414;
/// Points at which the powers are computed.
const POINTS: u32 = 200;

impl EnergyCheck {
    /// Whether the equations keep the stated energy, damping apart.
    pub fn holds(&self) -> bool {
        self.imbalance < CANCELLED && !self.gains
    }
}

impl fmt::Display for EnergyCheck {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.imbalance >= CANCELLED {
            write!(
                f,
                "energy: the equations do not keep it; without damping {:.3} of the power that is exchanged appears or is lost.",
                self.imbalance
            )?;
            for power in &self.powers {
                write!(f, "\n    by the rate of `{}`: {:+.4e}", power.state, power.value)?;
            }
            return write!(
                f,
                "\n  These should cancel. Look for a lost 1/2, a sign, or a term that stands in one of them and not in the other."
            );
        }
        if self.gains {
            return f.write_str(
                "energy: it grows by itself at some points; look for the sign of a damping, or for a coupling that stands in one equation alone.",
            );
        }
        let damping =
            if self.is_damped { "damping takes it, and nothing else" } else { "nothing changes it" };
        write!(f, "energy: kept by the equations to {:.0e}; {damping}", self.imbalance.max(1e-16))?;
        if !self.inputs_at_rest.is_empty() {
            write!(
                f,
                " (with {} at 0, since the energy does not contain it)",
                self.inputs_at_rest.join(", ")
            )?;
        }
        f.write_str(".")
    }
}

impl Device {
    /// Whether the equations keep the energy that the description states; `None` where it states none.
    ///
    /// `sizes` are those of the states, and `inputs` of the inputs, over which the points are spread; the values of the
    /// parameters are varied about those of the description. A state of size 0, which nobody knows, is spread over nine decades below its
    /// unit in SI: a comb that is narrow on that scale would be met by no point else.
    ///
    /// # Errors
    ///
    /// Equations that are too large once they are differentiated, and a domain in which no point was found.
    pub fn check_energy(&self, sizes: &[f64], inputs: &[f64]) -> Result<Option<EnergyCheck>, EquationError> {
        let Some(energy) = self.energy else { return Ok(None) };
        let mut graph = self.graph.clone();
        let velocities = self.velocities();
        let mut moved = Vec::new();
        let mut roots: Vec<NodeId> = Vec::new();
        for (state, rate) in self.rates.iter().enumerate() {
            let slope = graph.derivative(energy, Variable::State(state));
            if slope != Graph::ZERO && *rate != Graph::ZERO {
                roots.push(graph.product(&[(slope, 1), (*rate, 1)]));
                moved.push(state);
            }
        }
        let contains =
            |graph: &mut Graph, input| graph.derivative(energy, Variable::Input(input)) != Graph::ZERO;
        let held: Vec<bool> = (0..self.inputs.len()).map(|input| contains(&mut graph, input)).collect();
        let program = self.program(&mut graph, &roots, &[], "energy")?;

        let mut chance = XorshiftNormal(0x9e37_79b9_7f4a_7c15);
        let mut check = EnergyCheck {
            imbalance: 0.0,
            powers: Vec::new(),
            velocities: velocities
                .iter()
                .filter_map(|s| self.states.get(*s))
                .map(|s| s.name.to_string())
                .collect(),
            gains: false,
            is_damped: false,
            inputs_at_rest: (self.inputs.iter().zip(&held))
                .filter(|(_, held)| !**held)
                .map(|(input, _)| input.name.to_string())
                .collect(),
        };
        let mut found = 0;
        for _ in 0..POINTS {
            let values: Vec<f64> =
                self.values().iter().map(|value| value * chance.between(0.7, 1.4)).collect();
            let mut work = program.work(&values);
            let mut spread = |size: &f64| {
                let size = if *size > 0.0 { *size } else { Scalar::exp(chance.between(-DECADES, 0.0)) };
                size * chance.between(-1.0, 1.0)
            };
            let mut x: Vec<f64> = sizes.iter().map(&mut spread).collect();
            x.resize(self.states.len(), 0.0);
            let u = inputs
                .iter()
                .zip(&held)
                .map(|(size, held)| if *held { size * chance.between(-1.0, 1.0) } else { 0.0 });
            let u: Vec<f64> = u.collect();
            let mut powers = |x: &[f64]| -> Vec<f64> {
                Program::set_inputs(&mut work, &u);
                program.stage(&mut work, &padded::<MOST_STATES>(x, x.len()), true);
                program.outputs().iter().map(|register| work.get(*register)).collect()
            };
            let forwards = powers(&x);
            for velocity in &velocities {
                if let Some(x) = x.get_mut(*velocity) {
                    *x = -*x;
                }
            }
            let backwards = powers(&x);
            if !forwards.iter().chain(&backwards).all(|power| power.is_finite()) {
                continue;
            }
            found += 1;
            let odd: Vec<f64> = forwards.iter().zip(&backwards).map(|(f, b)| 0.5 * (f - b)).collect();
            let even: f64 = forwards.iter().zip(&backwards).map(|(f, b)| 0.5 * (f + b)).sum();
            let size: f64 = forwards.iter().chain(&backwards).map(|power| power.abs()).sum();
            let imbalance = if size > 0.0 { odd.iter().sum::<f64>().abs() / size } else { 0.0 };
            check.gains |= even > CANCELLED * size;
            check.is_damped |= even < -CANCELLED * size;
            if imbalance > check.imbalance || check.powers.is_empty() {
                check.imbalance = imbalance.max(check.imbalance);
                let named = moved.iter().zip(&odd).filter_map(|(state, value)| {
                    Some(StatePower { state: self.states.get(*state)?.name.to_string(), value: *value })
                });
                check.powers = named.collect();
            }
        }
        if found == 0 {
            let why = "the powers are finite at no point; give smaller sizes of the states".to_owned();
            return Err(whole("energy", EquationFault::Value(why)));
        }
        Ok(Some(check))
    }

    /// The states that are the rate of another one.
    fn velocities(&self) -> Vec<usize> {
        let of = |rate: &NodeId| match self.graph.as_variable(*rate) {
            Some(Variable::State(state)) => Some(state),
            _ => None,
        };
        let mut velocities: Vec<usize> = self.rates.iter().filter_map(of).collect();
        velocities.sort_unstable();
        velocities.dedup();
        velocities
    }
}

/// Numbers that are the same wherever this runs (xorshift, Marsaglia 2003).
pub(crate) struct XorshiftNormal(pub(crate) u64);

impl XorshiftNormal {
    pub(crate) fn between(&mut self, low: f64, high: f64) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        let part = (self.0 >> 11) as f64 / (1_u64 << 53) as f64;
        low.mac(part, high - low)
    }
}
