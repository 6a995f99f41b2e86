//! What happens within a step where an expression passes zero: a bounce, a switch with hysteresis, backlash, and forces that begin, end or jump.

use crate::device::Device;
use crate::emit::rewrite::{copied, same_law};
use crate::error::EquationError;
use crate::graph::{Graph, Node, NodeId, Variable};
use crate::motion::{MOST_STATES, Motion, StepTables, padded};
use crate::program::ProgramNumbers;
use crate::readout::Reading;
use crate::reset_path::{MOST_KEPT, ResetPath};
use kalmems_core::Nodes;
use std::collections::HashMap;

/// Which way an expression passes zero where a reset happens.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CrossingDirection {
    /// From below.
    Rising,
    /// From above.
    Falling,
    /// From either side.
    Either,
}

impl CrossingDirection {
    /// Whether it has passed from one value to another; one that begins at zero has passed it before.
    fn is_between(self, before: f64, after: f64) -> bool {
        let rises = before < 0.0 && after >= 0.0;
        let falls = before > 0.0 && after <= 0.0;
        match self {
            Self::Rising => rises,
            Self::Falling => falls,
            Self::Either => rises || falls,
        }
    }

    /// Whether it can pass from this side.
    const fn is_from(self, is_below: bool) -> bool {
        match self {
            Self::Rising => is_below,
            Self::Falling => !is_below,
            Self::Either => true,
        }
    }
}

/// A reset of a device, in its graph.
#[derive(Clone, Debug)]
pub(crate) struct DeviceReset {
    pub(crate) passing: CrossingDirection,
    pub(crate) crossing: NodeId,
    /// The states that are set, and what to.
    pub(crate) set: Vec<(usize, NodeId)>,
}

/// One of them, ready to run.
#[derive(Clone, Debug)]
struct Reset {
    passing: CrossingDirection,
    crossing: Reading,
    set: Vec<(usize, Reading)>,
}

/// The resets of a device, or the places at which its rates have a kink or jump, and a step of its motion with all that happen within it.
#[derive(Clone, Debug)]
pub struct Resets {
    all: Vec<Reset>,
    /// The rates on either side of each of these places.
    sides: Option<Sides>,
    tables: StepTables,
    /// What is known of the path that is followed.
    path: Option<ResetPath>,
    room: ResetRoom,
}

/// Square matrices that a step with resets works on.
#[derive(Clone, Debug, Default)]
struct ResetRoom {
    /// The derivatives at a reset by the state where the step began, and of the part of the step before it.
    before: Vec<f64>,
    slopes: Vec<f64>,
    saltation: Vec<f64>,
    product: Vec<f64>,
}

/// The motion by rates whose choices by a state stay as they are until the state has passed from one side to the other.
#[derive(Clone, Debug)]
struct Sides {
    motion: Motion,
    work: ProgramNumbers,
    /// The place of the first of these numbers among the parameters, and each: −1 where what is compared is smaller, 1 elsewhere.
    first: usize,
    held: Vec<f64>,
}

/// A step that resets may interrupt: the motion with what it works on, the inputs over the step, its length in s with its tables, and what makes
/// tables of a part of it.
pub struct ResetStep<'a, 'b> {
    /// The motion.
    pub motion: &'a Motion,
    /// What it works on.
    pub work: &'a mut ProgramNumbers,
    /// The inputs at its start, middle and end.
    pub inputs: &'a Nodes<&'b [f64]>,
    /// The tables of the whole step.
    pub tables: &'a StepTables,
    /// The length of the step in s.
    pub length_s: f64,
    /// Makes tables those of a step of a length in s.
    pub set_tables: &'a mut dyn FnMut(&mut StepTables, f64),
}

/// Resets in one step at most: what happens more often has come to rest against what resets it.
const MOST_RESETS: usize = 16;
/// Places of kinks at most; a device with more is followed without them.
const MOST_SIDES: usize = 32;
/// How closely the time of a reset is found, as a part of the step, and in how many trials at most: by halves alone to the last digit of a number.
const CLOSELY: f64 = f64::EPSILON;
const TRIALS: usize = 80;

/// A number for each state.
type States = [f64; MOST_STATES];

impl Device {
    /// Its resets, with these values of all parameters and with some of these as states of the motion; `None` for a device without resets.
    ///
    /// # Errors
    ///
    /// Where their derivatives are too large.
    pub fn resets(
        &self,
        parameters: &[f64],
        (motion, free): (&Motion, &[usize]),
    ) -> Result<Option<Resets>, EquationError> {
        let reading = |node: NodeId| Ok(Reading::new(self.readout_of(node, free, "when")?, parameters));
        let one = |reset: &DeviceReset| {
            let set = reset.set.iter().map(|(state, node)| Ok((*state, reading(*node)?)));
            let set = set.collect::<Result<_, EquationError>>()?;
            Ok(Reset { passing: reset.passing, crossing: reading(reset.crossing)?, set })
        };
        let all: Vec<Reset> = self.resets.iter().map(one).collect::<Result<_, EquationError>>()?;
        Ok((!all.is_empty()).then(|| Resets::new(all, None, motion.tables())))
    }

    /// The places at which its rates have a kink or jump as a state passes them, with these values of all parameters and with some of these as
    /// states of the motion; `None` where there are none, and where something is set as well.
    ///
    /// # Errors
    ///
    /// Where their derivatives are too large.
    pub fn sides(&self, parameters: &[f64], free: &[usize]) -> Result<Option<Resets>, EquationError> {
        let mut graph = self.graph.clone();
        let first = self.parameters.len();
        let (rates, compared) = by_sides(&mut graph, &self.rates, first);
        if compared.is_empty() || compared.len() > MOST_SIDES || self.has_resets() {
            return Ok(None);
        }
        let crossing = |node: &NodeId| {
            let crossing =
                Reading::new(self.readout_in(graph.clone(), *node, free, "derivative")?, parameters);
            Ok(Reset { passing: CrossingDirection::Either, crossing, set: Vec::new() })
        };
        let all = compared.iter().map(crossing).collect::<Result<_, EquationError>>()?;
        let motion = self.motion_of((graph, &rates), free, compared.len())?;
        let (work, held) = (motion.work(parameters), vec![1.0; compared.len()]);
        let tables = motion.tables();
        Ok(Some(Resets::new(all, Some(Sides { motion, work, first, held }), tables)))
    }

    /// Whether something happens to its states at once.
    pub fn has_resets(&self) -> bool {
        !self.resets.is_empty()
    }
}

/// These rates with each choice by a state made by the sign of a number, and what is compared by each of them: smaller than 0 where the first
/// part of the choice counts. The numbers are parameters from `first` on.
fn by_sides(graph: &mut Graph, rates: &[NodeId], first: usize) -> (Vec<NodeId>, Vec<NodeId>) {
    let (mut made, mut compared) = (HashMap::new(), Vec::new());
    for id in graph.below(rates) {
        let node = graph.node(id).clone();
        let part = |made: &HashMap<NodeId, NodeId>, part: NodeId| made.get(&part).copied().unwrap_or(part);
        let new = match &node {
            Node::Choice { smaller, larger, then, otherwise } => {
                let difference = graph.sum(0.0, &[(*smaller, 1.0), (*larger, -1.0)]);
                let (then, otherwise) = (part(&made, *then), part(&made, *otherwise));
                if graph.depends(difference, |variable| matches!(variable, Variable::State(_))) {
                    let place = compared.iter().position(|other| *other == difference).unwrap_or_else(|| {
                        compared.push(difference);
                        compared.len() - 1
                    });
                    let side = graph.variable(Variable::Parameter(first + place));
                    graph.choice(side, Graph::ZERO, then, otherwise)
                } else {
                    graph.choice(*smaller, *larger, then, otherwise)
                }
            }
            // Laws are copied as they are, without an error.
            node => copied(graph, node, &|id| part(&made, id), &mut same_law).unwrap_or(id),
        };
        made.insert(id, new);
    }
    (rates.iter().map(|rate| made.get(rate).copied().unwrap_or(*rate)).collect(), compared)
}

impl Resets {
    fn new(all: Vec<Reset>, sides: Option<Sides>, tables: StepTables) -> Self {
        Self { all, sides, tables, path: None, room: ResetRoom::default() }
    }

    /// Whether these are the places of kinks.
    pub fn are_kinks(&self) -> bool {
        self.sides.is_some()
    }

    /// Takes what a step without resets has led to from x, `to` with its derivatives where there is room for them, for one with all resets
    /// within the step; of kinks the whole step is taken here. False for a number that is not finite, and for more than 16 resets in it.
    ///
    /// A reset x⁺ = r(x⁻) at the time at which g(x) = 0 moves what is near the motion by the saltation matrix
    /// ∂r/∂x + (f⁺ − ∂r/∂x·f⁻)·(∂g/∂x)/(∂g/∂x·f⁻ + ∂g/∂t), with the rates f⁻ and f⁺ before and behind it (Aizerman & Gantmakher, 1958; Kong, Payne,
    /// Zhu & Johnson, Saltation matrices, Proc. IEEE 112, 585, 2024).
    pub fn follow(
        &mut self,
        step: &mut ResetStep<'_, '_>,
        x: &[f64],
        to: &mut [f64],
        jacobian: &mut [f64],
    ) -> bool {
        let (path, mut room) = (self.path, std::mem::take(&mut self.room));
        let finite = self.through(step, (x, to), jacobian, &mut room);
        self.room = room;
        match path {
            Some(path) if path.stays => self.path = Some(path),
            Some(path) => self.keep_sides(step, &path, (x, to)),
            None => {}
        }
        finite
    }

    /// See [`follow`](Self::follow).
    fn through(
        &mut self,
        step: &mut ResetStep<'_, '_>,
        (x, to): (&[f64], &mut [f64]),
        jacobian: &mut [f64],
        ResetRoom { before, slopes, saltation, product }: &mut ResetRoom,
    ) -> bool {
        let size = x.len();
        let mut at: States = padded(x, size);
        let mut from = 0.0;
        if self.sides.is_some() {
            self.hold(step, x, 0.0);
            if !self.lead(step, x, (0.0, 1.0), to, jacobian) {
                return false;
            }
        }
        // No derivatives of `at` by x before the first reset.
        before.clear();
        for room in [&mut *slopes, &mut *product] {
            room.clear();
            room.resize(jacobian.len(), 0.0);
        }
        saltation.resize(size * size, 0.0);
        for _ in 0..=MOST_RESETS {
            let Some((reset, part)) = self.first(step, &at[..size], to, from) else { return true };
            let mut event = [0.0; MOST_STATES];
            let event = &mut event[..size];
            if !self.lead(step, &at[..size], (from, part), event, slopes) {
                return false;
            }
            from += part;
            let mut behind = [0.0; MOST_STATES];
            if !self.jump(step, (reset, from), (event, &mut behind[..size]), saltation) {
                return false;
            }
            if let Some(path) = &mut self.path {
                path.take(reset);
            }
            if !slopes.is_empty() {
                if !before.is_empty() {
                    put_product(slopes, before, product, size);
                    slopes.copy_from_slice(product);
                }
                before.resize(size * size, 0.0);
                put_product(saltation, slopes, before, size);
            }
            at = behind;
            // What is left of the step.
            let left = 1.0 - from;
            if left <= 0.0 {
                to.copy_from_slice(&at[..size]);
                if !jacobian.is_empty() {
                    jacobian.copy_from_slice(before);
                }
                return true;
            }
            if !self.lead(step, &at[..size], (from, left), to, jacobian) {
                return false;
            }
            if !jacobian.is_empty() {
                put_product(jacobian, before, product, size);
                jacobian.copy_from_slice(product);
            }
        }
        false
    }

    /// The first reset on the way from `at`, and the part of the step that leads to it; `None` without a reset on the way.
    fn first(
        &mut self,
        step: &mut ResetStep<'_, '_>,
        at: &[f64],
        to: &[f64],
        from: f64,
    ) -> Option<(usize, f64)> {
        let mut first: Option<(usize, f64)> = None;
        for place in 0..self.all.len() {
            if self.path.is_some_and(|path| path.holds_back(place)) {
                continue;
            }
            let before = self.before(step, place, (at, from));
            let mut after = self.compared(step, place, (to, 1.0));
            if !self.has_passed(place, before, after) {
                continue;
            }
            let mut lead = [0.0; MOST_STATES];
            let mut value_at = |resets: &mut Self, part: f64| {
                let lead = &mut lead[..at.len()];
                let finite = resets.lead(step, at, (from, part), lead, &mut []);
                if finite { resets.compared(step, place, (lead, from + part)) } else { f64::NAN }
            };
            // [low, high] holds the passing; where it ends the expression has passed.
            let (mut low, mut high) = (0.0, first.map_or(1.0 - from, |(_, part)| part));
            if first.is_some() {
                after = value_at(self, high);
                // One that comes behind another is looked for again from there.
                if !self.has_passed(place, before, after) {
                    continue;
                }
            }
            let (mut below, mut above) = (before, after);
            for trial in 0..TRIALS {
                if high - low <= CLOSELY {
                    break;
                }
                // By the straight line between both ends, and each third time by half; from either end at least as far as it is to be found closely.
                let line = low + (high - low) * below / (below - above);
                let middle = if trial % 3 == 2 || !line.is_finite() { 0.5 * (low + high) } else { line };
                let middle = middle.clamp(low + 0.5 * CLOSELY, high - 0.5 * CLOSELY);
                if middle <= low || middle >= high {
                    break;
                }
                let value = value_at(self, middle);
                if value.is_nan() || self.has_passed(place, before, value) {
                    (high, above) = (middle, value);
                } else {
                    (low, below) = (middle, value);
                }
            }
            first = Some((place, high));
        }
        first
    }

    /// Whether what was one value is past zero with another; of a kink, whether it is on the other side than the one that is held.
    fn has_passed(&self, place: usize, before: f64, after: f64) -> bool {
        match self.sides.as_ref().and_then(|sides| sides.held.get(place)) {
            Some(held) => (*held < 0.0) != (after < 0.0),
            None => self.all[place].passing.is_between(before, after),
        }
    }

    /// What passes zero where a reset happens, where a part of the step begins: at the beginning of the whole step on the side of the path. A state that has
    /// been moved past zero without a reset is on the edge of it, if the motion goes the same way, and elsewhere nothing passes.
    fn before(&mut self, step: &mut ResetStep<'_, '_>, place: usize, (at, from): (&[f64], f64)) -> f64 {
        let value = self.compared(step, place, (at, from));
        let is_below = self.path.filter(|_| from == 0.0).and_then(|path| path.is_below(place));
        let Some(is_below) = is_below.filter(|is_below| value != 0.0 && *is_below != (value < 0.0)) else {
            return value;
        };
        let edge = if is_below { -f64::MIN_POSITIVE } else { f64::MIN_POSITIVE };
        if (self.growth(step, place, (at, from)) < 0.0) == is_below { 0.0 } else { edge }
    }

    /// How fast what passes zero grows per s at a state and a share of the step.
    fn growth(&mut self, step: &mut ResetStep<'_, '_>, place: usize, (at, share): (&[f64], f64)) -> f64 {
        let (mut rates, mut slopes) = ([0.0; MOST_STATES], [0.0; MOST_STATES]);
        let mut inputs = [0.0; MOST_STATES];
        let inputs = &mut inputs[..step.inputs.start.len().min(MOST_STATES)];
        inputs_at(step.inputs, share, inputs);
        self.rates(step, at, inputs, &mut rates[..at.len()]);
        let Reset { crossing, .. } = &mut self.all[place];
        crossing.linearize(at, inputs, &mut slopes[..at.len()]);
        rates.iter().zip(&slopes).map(|(rate, slope)| rate * slope).sum::<f64>()
            + growth_by_inputs(crossing, step, (at, share))
    }

    /// Leads the sides of the path from where a step began, on `before`, to where it ends.
    fn keep_sides(&mut self, step: &ResetStep<'_, '_>, before: &ResetPath, (from, to): (&[f64], &[f64])) {
        for place in 0..self.all.len().min(MOST_KEPT) {
            let (start, end) =
                (self.compared(step, place, (from, 0.0)), self.compared(step, place, (to, 1.0)));
            let Some((path, was_below)) = self.path.as_mut().zip(before.is_below(place)) else { return };
            let passing = self.all[place].passing;
            let has_happened = path.happened(place) != before.happened(place);
            let was_moved = start != 0.0 && (start < 0.0) != was_below && (start < 0.0) == (end < 0.0);
            let is_below = if end == 0.0 {
                if has_happened { !was_below } else { was_below }
            } else if has_happened || !was_moved {
                end < 0.0
            } else if passing.is_from(was_below) || end.abs() <= start.abs() {
                // It is still to pass, or on its way back to where it has passed.
                was_below
            } else {
                end < 0.0
            };
            *path = path.with_side(place, is_below);
        }
    }

    /// Goes on along a path; `None` where the signs of the expressions are the sides.
    pub const fn set_path(&mut self, path: Option<ResetPath>) {
        self.path = path;
    }

    /// The path that was set, led on by the steps since then.
    pub const fn path(&self) -> Option<ResetPath> {
        self.path
    }

    /// How many there are, of which paths keep the sides.
    pub fn kept(&self) -> usize {
        if self.are_kinks() { 0 } else { self.all.len().min(MOST_KEPT) }
    }

    /// The sides at a state under inputs, a bit for each reset.
    pub fn sides_at(&mut self, at: &[f64], inputs: &[f64]) -> ResetPath {
        let kept = self.kept();
        let below = self.all.iter_mut().take(kept).map(|reset| reset.crossing.read(at, inputs) < 0.0);
        below.enumerate().fold(ResetPath::default(), |path, (reset, below)| path.with_side(reset, below))
    }

    /// How far a state is from a reset that can happen from the side of a path: what falls to zero there, with its derivatives. `None` of one that has
    /// happened, and of what is not finite.
    pub fn margin(
        &mut self,
        (reset, path): (usize, &ResetPath),
        (at, inputs): (&[f64], &[f64]),
        slopes: &mut [f64],
    ) -> Option<f64> {
        let is_below = path.is_below(reset)?;
        let Reset { passing, crossing, .. } = self.all.get_mut(reset)?;
        if !passing.is_from(is_below) {
            return None;
        }
        let mut margin = crossing.linearize(at, inputs, slopes);
        if is_below {
            margin = -margin;
            for slope in slopes.iter_mut() {
                *slope = -*slope;
            }
        }
        (margin.is_finite() && slopes.iter().all(|slope| slope.is_finite())).then_some(margin)
    }

    /// What passes zero where a reset happens, at a state under inputs, with its derivatives.
    pub fn crossing(&mut self, reset: usize, (at, inputs): (&[f64], &[f64]), slopes: &mut [f64]) -> f64 {
        self.all.get_mut(reset).map_or(f64::NAN, |reset| reset.crossing.linearize(at, inputs, slopes))
    }

    /// What passes zero where a reset happens, at a state and a share of the step.
    fn compared(&mut self, step: &ResetStep<'_, '_>, place: usize, (at, share): (&[f64], f64)) -> f64 {
        let mut inputs = [0.0; MOST_STATES];
        let inputs = &mut inputs[..step.inputs.start.len().min(MOST_STATES)];
        inputs_at(step.inputs, share, inputs);
        self.all[place].crossing.read(at, inputs)
    }

    /// Takes the sides of kinks on which a state is at a share of the step; of one that it is on, the side to which it moves.
    fn hold(&mut self, step: &mut ResetStep<'_, '_>, at: &[f64], share: f64) {
        let Some(sides) = &mut self.sides else { return };
        let (mut inputs, mut rates) = ([0.0; MOST_STATES], [0.0; MOST_STATES]);
        let inputs = &mut inputs[..step.inputs.start.len().min(MOST_STATES)];
        inputs_at(step.inputs, share, inputs);
        for (held, reset) in sides.held.iter_mut().zip(&mut self.all) {
            let mut value = reset.crossing.read(at, inputs);
            if value == 0.0 {
                let mut slopes = [0.0; MOST_STATES];
                step.motion.rates(step.work, at, inputs, &mut rates[..at.len()]);
                reset.crossing.linearize(at, inputs, &mut slopes[..at.len()]);
                value = rates.iter().zip(&slopes).map(|(rate, slope)| rate * slope).sum::<f64>()
                    + growth_by_inputs(&mut reset.crossing, step, (at, share));
            }
            *held = if value < 0.0 { -1.0 } else { 1.0 };
        }
        sides.motion.hold(&mut sides.work, sides.first, &sides.held);
    }

    /// The rates at a state under inputs, on the sides that are held.
    fn rates(&mut self, step: &mut ResetStep<'_, '_>, at: &[f64], inputs: &[f64], to: &mut [f64]) -> bool {
        match &mut self.sides {
            Some(sides) => sides.motion.rates(&mut sides.work, at, inputs, to),
            None => step.motion.rates(step.work, at, inputs, to),
        }
    }

    /// Where a part of a step leads to.
    fn lead(
        &mut self,
        step: &mut ResetStep<'_, '_>,
        at: &[f64],
        (from, part): (f64, f64),
        to: &mut [f64],
        slopes: &mut [f64],
    ) -> bool {
        let mut nodes = [[0.0; MOST_STATES]; 3];
        let count = step.inputs.start.len().min(MOST_STATES);
        for (node, share) in nodes.iter_mut().zip([0.0, 0.5, 1.0]) {
            inputs_at(step.inputs, from + share * part, &mut node[..count]);
        }
        let [start, middle, end] = &nodes;
        let inputs = Nodes { start: &start[..count], middle: &middle[..count], end: &end[..count] };
        let tables = if part == 1.0 {
            step.tables
        } else {
            (step.set_tables)(&mut self.tables, part * step.length_s);
            &self.tables
        };
        let (motion, work) = match &mut self.sides {
            Some(sides) => (&sides.motion, &mut sides.work),
            None => (step.motion, &mut *step.work),
        };
        to[motion.moving()..].copy_from_slice(&at[motion.moving()..]);
        if slopes.is_empty() {
            motion.step(work, at, &inputs, tables, to)
        } else {
            motion.linearized_step(work, at, &inputs, tables, to, slopes)
        }
    }

    /// The states behind a reset and its saltation matrix; false where a number is not finite.
    fn jump(
        &mut self,
        step: &mut ResetStep<'_, '_>,
        (reset, when): (usize, f64),
        (event, behind): (&[f64], &mut [f64]),
        saltation: &mut [f64],
    ) -> bool {
        let size = event.len();
        let mut inputs = [0.0; MOST_STATES];
        let count = step.inputs.start.len().min(MOST_STATES);
        let inputs = &mut inputs[..count];
        inputs_at(step.inputs, when, inputs);
        behind.copy_from_slice(event);
        saltation.fill(0.0);
        (0..size).for_each(|k| saltation[k * (size + 1)] = 1.0);
        let mut normal = [0.0; MOST_STATES];
        let normal = &mut normal[..size];
        let Reset { crossing, set, .. } = &mut self.all[reset];
        for (state, reading) in set {
            behind[*state] =
                reading.linearize(event, inputs, &mut saltation[*state * size..(*state + 1) * size]);
        }
        let value = crossing.linearize(event, inputs, normal);
        let (mut before, mut after) = ([0.0; MOST_STATES], [0.0; MOST_STATES]);
        let mut finite = self.rates(step, event, inputs, &mut before[..size]);
        self.hold(step, behind, when);
        finite &= self.rates(step, behind, inputs, &mut after[..size]);
        let by_inputs = growth_by_inputs(&mut self.all[reset].crossing, step, (event, when));
        let speed = normal.iter().zip(&before).map(|(n, f)| n * f).sum::<f64>() + by_inputs;
        // One that a correction has moved past zero passed it some time before.
        let ago_s = self.path.map_or(0.0, |_| (value / speed).clamp(0.0, step.length_s));
        for ((row, after), behind) in saltation.chunks_exact_mut(size).zip(&after).zip(behind.iter_mut()) {
            let moved: f64 = row.iter().zip(&before).map(|(slope, f)| slope * f).sum();
            *behind += (after - moved) * ago_s;
            for (entry, n) in row.iter_mut().zip(&*normal) {
                *entry += (after - moved) * n / speed;
            }
        }
        finite && saltation.iter().chain(behind.iter()).all(|value| value.is_finite())
    }
}

/// How fast an expression grows per s by the inputs alone, at a state and a share of the step: of the parabola that these follow, by what lies 10⁻⁴ of the
/// step to either side, which a cubic changes by 10⁻⁸ of itself.
fn growth_by_inputs(expression: &mut Reading, step: &ResetStep<'_, '_>, (at, share): (&[f64], f64)) -> f64 {
    const ASIDE: f64 = 1e-4;
    let mut inputs = [0.0; MOST_STATES];
    let inputs = &mut inputs[..step.inputs.start.len().min(MOST_STATES)];
    let [later, earlier] = [ASIDE, -ASIDE].map(|aside| {
        inputs_at(step.inputs, share + aside, inputs);
        expression.read(at, inputs)
    });
    (later - earlier) / (2.0 * ASIDE * step.length_s)
}

/// The inputs at a share of a step, on the parabola through its start, middle and end.
fn inputs_at(Nodes { start, middle, end }: &Nodes<&[f64]>, share: f64, to: &mut [f64]) {
    let [a, b, c] =
        [(2.0 * share - 1.0) * (share - 1.0), 4.0 * share * (1.0 - share), share * (2.0 * share - 1.0)];
    for (k, to) in to.iter_mut().enumerate() {
        *to = a * start[k] + b * middle[k] + c * end[k];
    }
}

/// Writes the product of two square matrices, row by row.
fn put_product(a: &[f64], b: &[f64], to: &mut [f64], size: usize) {
    for i in 0..size {
        for j in 0..size {
            to[i * size + j] = (0..size).map(|k| a[i * size + k] * b[k * size + j]).sum();
        }
    }
}
