//! The filter run over its vectors as the source runs, in numbers of 32 and of 64 bits: how many digits it needs.

mod steps;

use super::filter::FilterProgram;
use super::interface::{Interface, POINTS};
use super::request::{EmitDigits, EmitRequest, InputCourse, TestSample};
use super::routine::{Routine, StorageArray};
use super::tape::{CalledFunction, TapeId, TapeOp};
use super::watch::{InnovationWatch, KeptRecord, WatchRules};
use crate::device::Device;
use crate::laws::{LawId, MOST_ARGUMENTS, partial};
use kalmems_models::capacitance::VACUUM_PERMITTIVITY;
use std::collections::HashMap;

/// The functions of the source in Rust; those in C differ by units of the last digit.
#[allow(clippy::all, clippy::pedantic)] // written for any compiler
mod functions {
    include!("rust/functions.rs");
}

/// The largest difference of a filter without a claim, relative to the largest value of each state: 10⁻⁵, less what compilers and their functions differ by.
const ENOUGH: f64 = 6e-6;

/// How far a state may be from that of the library's filter by the standard deviation that is claimed of it: 0.02, less the same.
const OF_CLAIM: f64 = 0.015;

/// Samples that show which digits are too few. What they show to be enough is tried over all samples: what rounding adds up to may show there alone.
const BEGINNING: usize = 3000;

/// The digits in the order of what they cost.
const LADDER: [EmitDigits; 3] = [EmitDigits::Single, EmitDigits::DoubleMean, EmitDigits::Double];

/// The largest difference from what is expected, relative to the largest value of each state; and that by the claimed standard deviation, with the
/// place of the state, where one is claimed.
type RehearsedDifference = (f64, Option<(usize, f64)>);

/// Puts the digits that a request asks for into the program, and says which they are.
pub(super) fn choose(
    device: &Device,
    request: &EmitRequest,
    program: &mut FilterProgram,
) -> (EmitDigits, Option<(usize, f64)>) {
    let samples = &request.rehearsal;
    if samples.is_empty() {
        program.widen(request.digits);
        return (request.digits, None);
    }
    let tried: &[EmitDigits] = match &request.digits {
        EmitDigits::AsNeeded => &LADDER,
        stated => std::slice::from_ref(stated),
    };
    let mut chosen = (EmitDigits::Single, None);
    for digits in tried {
        program.widen(*digits);
        let rehearsal = Rehearsal::of(device, request, program);
        let is_enough = |(found, of_claim): &RehearsedDifference| match of_claim {
            Some((_, share)) => *share <= OF_CLAIM,
            None => *found <= ENOUGH,
        };
        let beginning = samples.get(..BEGINNING).unwrap_or(samples);
        let mut apart = rehearsal.farthest(beginning);
        // The last ones are those that there are, however far they are off.
        if samples.len() > beginning.len() && (is_enough(&apart) || tried.last() == Some(digits)) {
            apart = rehearsal.farthest(samples);
        }
        program.rehearsed.push(apart.0);
        chosen = (*digits, apart.1);
        if is_enough(&apart) {
            break;
        }
    }
    chosen
}

/// A number of 32 bits.
#[allow(clippy::cast_possible_truncation)] // rounding to f32 is what is wanted
fn narrow(value: f64) -> f64 {
    f64::from(value as f32)
}

fn rounded(value: f64, wide: bool) -> f64 {
    if wide { value } else { narrow(value) }
}

/// Mean and covariance as the source has them.
#[derive(Clone)]
struct RehearsedEstimate {
    mean: Vec<f64>,
    covariance: Vec<f64>,
}

/// The filter as the source has it.
struct RehearsedState {
    estimate: RehearsedEstimate,
    /// What is kept through a loss of the signal, and what is known of that.
    kept: RehearsedEstimate,
    record: KeptRecord,
    /// What its corrections saw.
    watches: Vec<InnovationWatch>,
    /// Samples until the next correction.
    left: u32,
}

struct Rehearsal<'a> {
    device: &'a Device,
    request: &'a EmitRequest,
    program: &'a FilterProgram,
    constants: Vec<f64>,
    periods: Vec<(usize, f64)>,
    rules: WatchRules,
}

impl<'a> Rehearsal<'a> {
    fn of(device: &'a Device, request: &'a EmitRequest, program: &'a FilterProgram) -> Self {
        let rules = request.watch_rules();
        let mut rehearsal =
            Self { device, request, program, constants: Vec::new(), periods: Vec::new(), rules };
        rehearsal.periods = device.periods(&request.parameters).unwrap_or_default();
        if let Some(configure) = &program.configure {
            let given = Interface::parameters(device, request, program);
            let given: HashMap<String, f64> =
                given.into_iter().map(|(name, _, value)| (name, value)).collect();
            rehearsal.constants =
                rehearsal.outputs(configure, &given).0.into_iter().map(|(_, _, c)| c).collect();
        }
        rehearsal
    }

    /// How far it is from what is expected of these samples.
    fn farthest(&self, samples: &[TestSample]) -> RehearsedDifference {
        let mut of_claim: Option<(usize, f64)> = None;
        let mut state = self.first();
        let size = self.request.size();
        let (mut apart, mut largest) = (vec![0.0_f64; size], vec![0.0_f64; size]);
        for sample in samples {
            self.step(&mut state, sample);
            for (k, expected) in sample.expected.iter().enumerate() {
                let units = &self.program.units;
                // The source returns numbers of 32 bits.
                let kept =
                    units.origin(k) + units.scale(k) * state.estimate.mean.get(k).copied().unwrap_or(0.0);
                let apart_by = |value: f64| {
                    let difference = value - expected;
                    match self.periods.iter().find(|(place, _)| *place == k) {
                        Some((_, period)) => difference - period * (difference / period).round(),
                        None => difference,
                    }
                };
                let difference = apart_by(narrow(kept));
                if let Some(sd) = sample.expected_sd.get(k).filter(|sd| **sd > 0.0) {
                    // What the filter goes on with, which is not rounded as it is returned.
                    let share = apart_by(kept).abs() / sd;
                    let share = if share.is_nan() { f64::INFINITY } else { share };
                    if of_claim.is_none_or(|(_, most)| share > most) {
                        of_claim = Some((k, share));
                    }
                }
                if let Some((apart, largest)) = apart.get_mut(k).zip(largest.get_mut(k)) {
                    *apart = if difference.is_nan() { f64::INFINITY } else { apart.max(difference.abs()) };
                    *largest = largest.max(expected.abs());
                }
            }
        }
        let relative = apart.iter().zip(&largest).map(|(apart, largest)| match largest {
            0.0 => *apart,
            _ => apart / largest,
        });
        (relative.fold(0.0, f64::max), of_claim)
    }

    /// The inputs of one of the steps of an interval, as the source has them between those that it is given.
    fn inputs_of_part(&self, sample: &TestSample, part: usize) -> [Vec<f64>; 3] {
        if self.request.parts == 1 {
            return sample.inputs.clone();
        }
        let parts = self.request.parts as f64;
        POINTS.map(|(point, at)| {
            let place = (part as f64 + at) / parts;
            let of = |input: usize| {
                let [start, middle, end] =
                    [0, 1, 2].map(|point| sample.inputs[point].get(input).copied().map_or(f64::NAN, narrow));
                match self.program.names.course(input) {
                    InputCourse::Between => narrow(
                        start
                            + place
                                * (4.0 * middle - 3.0 * start - end
                                    + 2.0 * place * (start - 2.0 * middle + end)),
                    ),
                    _ if point == "start" => start,
                    _ if point == "middle" => middle,
                    _ => end,
                }
            };
            (0..self.device.inputs.len()).map(of).collect()
        })
    }

    /// What a routine computes from named numbers, and the innovation of a measurement with its variance.
    fn outputs(&self, routine: &Routine, given: &HashMap<String, f64>) -> (RoutineOutputs, Option<[f64; 2]>) {
        let mut run = RoutineRun {
            rehearsal: self,
            routine,
            given,
            stages: HashMap::new(),
            values: vec![None; routine.tape.len()],
        };
        for call in &routine.calls {
            run.below(&call.arguments);
            let Some(stage) = &self.program.stage else { continue };
            let arguments = call.arguments.iter().map(|id| run.operand(*id, routine.widths.stage));
            let handed = stage.parameters.iter().cloned().zip(arguments).collect();
            for (_, place, value) in self.outputs(stage, &handed).0 {
                run.stages.insert(format!("{}[{place}]", call.output), value);
            }
        }
        let ids = routine.outputs.iter().map(|(_, _, id)| *id);
        let ids: Vec<TapeId> = ids.chain(routine.residual).chain(routine.variance).collect();
        run.below(&ids);
        let of = |(array, place, id): &(StorageArray, usize, TapeId)| {
            (*array, *place, run.operand(*id, routine.widths.of(*array)))
        };
        let innovation = routine.residual.zip(routine.variance);
        (
            routine.outputs.iter().map(of).collect(),
            innovation.map(|(residual, variance)| [residual, variance].map(|id| run.operand(id, false))),
        )
    }
}

/// Where each result of a routine goes, and the result.
type RoutineOutputs = Vec<(StorageArray, usize, f64)>;

/// A routine on its way.
struct RoutineRun<'a> {
    rehearsal: &'a Rehearsal<'a>,
    routine: &'a Routine,
    given: &'a HashMap<String, f64>,
    stages: HashMap<String, f64>,
    values: Vec<Option<f64>>,
}

impl RoutineRun<'_> {
    /// Computes what these need and is not there yet.
    fn below(&mut self, wanted: &[TapeId]) {
        for id in self.routine.tape.below(wanted) {
            if self.values.get(id.index()).is_some_and(Option::is_none) {
                let value = self.value(id);
                if let Some(slot) = self.values.get_mut(id.index()) {
                    *slot = Some(value);
                }
            }
        }
    }

    /// A value as an operation of this width takes it.
    fn operand(&self, id: TapeId, wide: bool) -> f64 {
        rounded(self.values.get(id.index()).copied().flatten().unwrap_or(f64::NAN), wide)
    }

    fn value(&self, id: TapeId) -> f64 {
        let wide = self.routine.is_wide(id);
        let at = |id: TapeId| self.operand(id, wide);
        let tape = &self.routine.tape;
        // A sum, a product or a quotient of numbers of 32 bits, rounded from 64, is the one of 32.
        let value = match tape.op(id) {
            TapeOp::Literal(bits) => return f64::from_bits(bits),
            TapeOp::Name(name) => {
                let name = tape.name_of(name);
                return self.given.get(name).or_else(|| self.stages.get(name)).copied().unwrap_or(f64::NAN);
            }
            TapeOp::Add(a, b) => at(a) + at(b),
            TapeOp::Subtract(a, b) => at(a) - at(b),
            TapeOp::Multiply(a, b) => at(a) * at(b),
            TapeOp::Divide(a, b) => at(a) / at(b),
            TapeOp::Negative(a) => -at(a),
            // Functions of the source have 32 bits.
            TapeOp::Call(called, a) => self.rehearsal.called(called, [at(a), 0.0]),
            TapeOp::CallOfTwo(called, [a, b]) => self.rehearsal.called(called, [at(a), at(b)]),
            TapeOp::Choice([a, b, c, d]) => {
                if at(a) < at(b) {
                    at(c)
                } else {
                    at(d)
                }
            }
        };
        rounded(value, wide)
    }
}

impl Rehearsal<'_> {
    /// A function of the source; those through tables rounded once.
    fn called(&self, called: CalledFunction, at: [f64; 2]) -> f64 {
        #[allow(clippy::cast_possible_truncation)] // rounding to f32 is what is wanted
        let [x, y] = at.map(|at| at as f32);
        let value: f64 = match called {
            CalledFunction::FallingExp => functions::falling_exp(x).into(),
            CalledFunction::Exp => functions::exp(x).into(),
            CalledFunction::Ln => functions::ln(x).into(),
            CalledFunction::Sin => functions::sin(x).into(),
            CalledFunction::Cos => functions::cos(x).into(),
            CalledFunction::Tanh => functions::tanh(x).into(),
            CalledFunction::Atanh => functions::atanh(x).into(),
            CalledFunction::Atan => functions::atan(x).into(),
            CalledFunction::Asin => functions::asin(x).into(),
            CalledFunction::Acos => functions::acos(x).into(),
            CalledFunction::Floor => functions::floor(x).into(),
            CalledFunction::Sqrt => functions::sqrt(x).into(),
            CalledFunction::Atanhc(order) => functions::atanhc(x, order.into()).into(),
            CalledFunction::LnCosh => functions::ln_cosh(x).into(),
            // Of one number: C/(ε₀·a) over the distance in radii.
            CalledFunction::Disks(order) => {
                let mut arguments = [0.0; MOST_ARGUMENTS];
                (arguments[0], arguments[1]) = (x.into(), 1.0);
                partial(LawId::Disks, &vec![0; usize::from(order)], &arguments) / VACUUM_PERMITTIVITY
            }
            CalledFunction::Curve(curve, order) => self.device.curves.get(curve).map_or(f64::NAN, |curve| {
                let ([first, second], size) = curve.extent();
                let at = [first[0] + first[1] * f64::from(x), second[0] + second[1] * f64::from(y)];
                let [i, j] = order.map(i32::from);
                curve.derivative(at, order) * first[1].powi(i) * second[1].powi(j) / size
            }),
        };
        narrow(value)
    }
}

#[cfg(test)]
mod tests {
    use super::functions;

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
        close("atan", worst(functions::atan, f64::atan, [-20.0, 20.0], 0.0));
        close("asin", worst(functions::asin, f64::asin, [-1.0, 1.0], 0.0));
        close("acos", worst(functions::acos, f64::acos, [-1.0, 1.0], 0.0));
        assert_eq!(worst(functions::floor, f64::floor, [-300.0, 300.0], 0.0), 0.0);
        assert_eq!((functions::floor(-1e9), functions::floor(-0.5)), (-1e9, -1.0));
        assert!(functions::asin(1.01).is_nan() && functions::acos(-1.01).is_nan());
        let quarter = std::f32::consts::FRAC_PI_2;
        assert_eq!((functions::atan(1e30), functions::atan(f32::NEG_INFINITY)), (quarter, -quarter));
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
