//! Where a motion has left the points of a table that has nothing beyond its ends.

use crate::description::CurveExtension;
use crate::device::Device;
use crate::error::EquationError;
use crate::graph::{Node, NodeId};
use crate::motion::{MOST_STATES, padded};
use crate::program::Program;
use std::fmt;

/// A table that was left.
#[derive(Clone, Debug, PartialEq)]
pub struct LeftTable {
    /// Its name.
    pub name: String,
    /// Where it was asked, in SI.
    pub at: f64,
    /// Its first and its last place, in SI.
    pub ends: [f64; 2],
}

impl fmt::Display for LeftTable {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { name, at, ends: [first, last] } = self;
        write!(
            f,
            "it leaves the table `{name}`, which is asked at {at:.4e} and has points from {first:.4e} to {last:.4e} (SI); add points, or say what it \
             does beyond them by `outside = \"linear\"` or `\"clamp\"`"
        )
    }
}

impl Device {
    /// The table that a step of this length in s leaves, from a state and under inputs, with these values of all parameters; `None` where
    /// none is left.
    ///
    /// The state is followed along its rate, as far as the stages of a step go.
    ///
    /// # Errors
    ///
    /// Where the expressions are too large.
    pub fn left_table(
        &self,
        values: &[f64],
        (state, inputs): (&[f64], &[f64]),
        step_s: f64,
    ) -> Result<Option<LeftTable>, EquationError> {
        let roots: Vec<NodeId> =
            self.rates.iter().chain(&self.readings).chain(&self.crossings).copied().collect();
        let asked: Vec<(usize, usize, NodeId)> = (self.graph.below(&roots).into_iter())
            .filter_map(|id| match self.graph.node(id) {
                Node::Curve { curve, at, .. } => Some((*curve, *at)),
                _ => None,
            })
            .filter(|(curve, _)| {
                self.curves.get(*curve).is_some_and(|curve| curve.outside() == CurveExtension::Error)
            })
            .flat_map(|(curve, at)| {
                let along = self.curves[curve].places().len();
                at.into_iter().take(along).enumerate().map(move |(argument, at)| (curve, argument, at))
            })
            .collect();
        if asked.is_empty() {
            return Ok(None);
        }
        let nodes: Vec<NodeId> = asked.iter().map(|(.., at)| *at).collect();
        let program = self.program(&mut self.graph.clone(), &nodes, &[], "tables")?;
        let mut work = program.work(values);
        let motion = self.motion(&[])?;
        let mut rates = vec![0.0; state.len()];
        let finite = motion.rates(&mut motion.work(values), state, inputs, &mut rates);
        for share in if finite { &[0.0, 0.5, 1.0][..] } else { &[0.0] } {
            let at: Vec<f64> = state.iter().zip(&rates).map(|(x, rate)| x + share * step_s * rate).collect();
            Program::set_inputs(&mut work, inputs);
            program.stage(&mut work, &padded::<MOST_STATES>(&at, at.len()), true);
            for ((curve, argument, _), register) in asked.iter().zip(program.outputs()) {
                let ([middle, half], found) =
                    (self.curves[*curve].extent().0[*argument], work.get(*register));
                let ends = [middle - half, middle + half];
                if !(ends[0]..=ends[1]).contains(&found) {
                    let (name, _) = self.graph.curves.get(*curve).cloned().unwrap_or_default();
                    return Ok(Some(LeftTable { name, at: found, ends }));
                }
            }
        }
        Ok(None)
    }
}
