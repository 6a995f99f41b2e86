//! The texts of the published devices against the laws of `kalmems-models`: rates, measurements and their derivatives, by
//! states and by parameters, at random points. The derivatives of the laws come from dual numbers.

use crate::common;
use crate::common::{Chance, device, example};
use kalmems_core::{
    Dual, Dynamics, Etdrk4, Mat, Measurement, Nodes, NoiseDensity, Parameters, ParametricDynamics, Process,
    Rk4,
};
use kalmems_equations::{Device, Motion, NoiseKind, ProgramNumbers, StepTables};
use kalmems_models::capacitance::{
    CombCurve, CurveShape, DifferentialPlates, DistanceSeries, GaussianComb, TiltingPlate,
};
use kalmems_models::dynamics::{
    Accelerometer, CombDrivenMirror, DriftingPhasor, DriveGain, GaussMarkov, MirrorResonator,
    ParametricScanner, PiezoStage, ProofMass, SensedAcceleration, TorsionalResonator, TwoAxisScanner,
};
use kalmems_models::readout::{
    AngleBefore, CurrentReadout, DemodulatedComb, DifferentialReadout, DriftingPhasorCapacitance,
    LowPassedComb, PlateCurrent, TwoAxisComb,
};
use std::f64::consts::TAU;

/// What is asked for: relative to the number itself, or to what it is the sum of where that cancels.
const RELATIVE: f64 = 1e-13;

/// The largest error of each number relative to `terms`, the size of what it is the sum of.
fn hold(what: &str, found: &[f64], expected: &[f64], terms: &[f64]) {
    assert_eq!(found.len(), expected.len(), "{what}");
    for (i, ((found, expected), terms)) in found.iter().zip(expected).zip(terms).enumerate() {
        let error = (found - expected).abs() / terms.abs().max(expected.abs());
        assert!(
            error <= RELATIVE || found == expected,
            "{what}, number {i}: {found:e} against {expected:e}, relative {error:e}"
        );
    }
}

/// Rates and their Jacobian at random points against a model. `terms` gives the size of the terms of each rate.
fn hold_motion<D: Dynamics<f64, N>, const N: usize>(
    device: &Device,
    model: &D,
    chance: &mut Chance,
    sizes: [f64; N],
    input: impl Fn(&mut Chance) -> (Vec<f64>, D::Input),
) {
    let motion = device.motion(&[]).unwrap();
    let mut work = motion.work(&device.values());
    let points: Vec<_> =
        (0..2000).map(|_| (sizes.map(|size| size * chance.between(-1.0, 1.0)), input(chance))).collect();
    let expected: Vec<_> = points.iter().map(|(x, (_, native))| model.jacobian(x, native)).collect();
    // An entry that is nearly zero at a point by chance has the digits of what cancels there.
    let mut floor = vec![0.0; N * N];
    for (entry, floor) in floor.iter_mut().enumerate() {
        let square: f64 = expected.iter().map(|j| j.0.as_flattened()[entry].powi(2)).sum();
        *floor = 0.01 * (square / points.len() as f64).sqrt();
    }
    for ((x, (inputs, native)), expected) in points.iter().zip(&expected) {
        let (mut rates, mut jacobian) = ([0.0; N], vec![0.0; N * N]);
        assert!(motion.linearize(&mut work, x, inputs, &mut rates, &mut jacobian));
        hold("jacobian", &jacobian, expected.0.as_flattened(), &floor);
        // |∂f/∂x|·|x| is the size of the terms that a rate is the sum of.
        let mut terms = [0.0; N];
        for (row, term) in terms.iter_mut().enumerate() {
            *term = (0..N).map(|column| (expected.0[row][column] * x[column]).abs()).sum();
        }
        hold("rates", &rates, &model.derivative(x, native), &terms);
    }
}

/// A measurement with its derivatives at random points against a model.
fn hold_readout<H: Measurement<f64, N, 1>, const N: usize>(
    device: &Device,
    measure: usize,
    model: &H,
    chance: &mut Chance,
    point: impl Fn(&mut Chance) -> [f64; N],
) {
    let readout = device.readout(measure, &[]).unwrap();
    let mut work = readout.work(&device.values());
    for _ in 0..2000 {
        let x = point(chance);
        let mut slopes = [0.0; N];
        let value = readout.linearize(&mut work, &x, &vec![0.0; device.inputs().len()], &mut slopes);
        let ([expected], by_model) = model.linearize(&x);
        let terms: f64 = by_model.0[0].iter().zip(&x).map(|(slope, x)| (slope * x).abs()).sum();
        hold("value", &[value], &[expected], &[terms]);
        hold("slopes", &slopes, &by_model.0[0], &by_model.0[0]);
    }
}

/// ∂f/∂p of one parameter at random points, by dual numbers through the model with that parameter as the variable.
fn hold_parameter<D, const N: usize>(
    device: &Device,
    (name, place): (&str, &str),
    model: &D,
    chance: &mut Chance,
    (sizes, volts): ([f64; N], f64),
) where
    D: ParametricDynamics<f64, N, Input = f64> + Parameters<f64>,
{
    let index = device.parameter(name).unwrap_or_else(|| panic!("{name}"));
    let motion = device.motion(&[index]).unwrap();
    let values = device.values();
    let mut work = motion.work(&values);
    for _ in 0..300 {
        let x = sizes.map(|size| size * chance.between(-1.0, 1.0));
        let input = volts * chance.between(-1.0, 1.0);
        let mut extended = x.to_vec();
        extended.push(values[index]);
        let (mut rates, mut jacobian) = (vec![0.0; N + 1], vec![0.0; (N + 1) * (N + 1)]);
        assert!(motion.linearize(&mut work, &extended, &[input], &mut rates, &mut jacobian));
        let varied = common::varied(model, place);
        let expected = D::derivative_of(&varied, &std::array::from_fn(|i| Dual::constant(x[i])), &input);
        for (row, expected) in expected.iter().enumerate() {
            let found = jacobian[row * (N + 1) + N];
            hold(name, &[found], &expected.gradient(), &expected.gradient());
        }
    }
}

fn resonator() -> TorsionalResonator<f64> {
    TorsionalResonator { inertia: 1.15e-14, damping: 5.95e-12, stiffness: 1.10e-4 }
}

fn comb() -> GaussianComb<f64> {
    GaussianComb { nominal: 5.71e-12, angular_width: 0.2, bias: 9.79e-12 }
}

fn scanner() -> ParametricScanner<f64> {
    ParametricScanner { resonator: resonator(), comb: comb(), carrier_mean_square: 18.0 }
}

fn volts(chance: &mut Chance) -> (Vec<f64>, f64) {
    let volts = chance.between(-180.0, 180.0);
    (vec![volts], volts)
}

#[test]
fn the_shared_scanner_is_its_law() {
    let device = example("shared_scanner");
    let mut chance = Chance::new(1);
    hold_motion(&device, &scanner(), &mut chance, [0.3, 3e4], volts);
    let readout = DemodulatedComb { comb: comb(), gain: -0.3574e12, offset: 6.3945 };
    hold_readout::<_, 2>(&device, 0, &readout, &mut chance, |c| [c.between(-0.3, 0.3), c.between(-3e4, 3e4)]);
    for pair in [
        ("J", "resonator.inertia"),
        ("b", "resonator.damping"),
        ("k", "resonator.stiffness"),
        ("C0", "comb.nominal"),
        ("width", "comb.angular_width"),
        ("Cb", "comb.bias"),
        ("carrier_square", "carrier_mean_square"),
    ] {
        hold_parameter(&device, pair, &scanner(), &mut chance, ([0.3, 3e4], 180.0));
    }
    let noise = device.noise(&device.values(), &vec![0.0; device.states().len()]).unwrap();
    let expected = [(NoiseKind::Rate { state: 1 }, 1e8), (NoiseKind::Variance { measure: 0 }, 1.92e-4)];
    assert_eq!(noise, expected);
}

#[test]
fn the_low_passed_scanner_is_its_law() {
    let device = example("shared_scanner_low_passed");
    let model = LowPassedComb {
        device: DriveGain { scanner: scanner(), drive_gain: 1.02 },
        before: AngleBefore::none(),
        gain: -0.3574e12,
        offset: 6.3945,
        poles: [2.58e5, 2.56e5],
    };
    hold_motion(&device, &model, &mut Chance::new(2), [0.3, 3e4, 5.0, 5.0], volts);
    let readout = device.readout(0, &[]).unwrap();
    assert_eq!(readout.sparsity().collect::<Vec<_>>(), [3]);
}

#[test]
fn two_axes_are_their_law() {
    let device = example("two_axes");
    let gimbal = ParametricScanner {
        resonator: TorsionalResonator { inertia: 6.0e-14, damping: 1.0e-11, stiffness: 1.00e-4 },
        comb: GaussianComb { nominal: 4.0e-12, angular_width: 0.2, bias: 5.0e-12 },
        carrier_mean_square: 18.0,
    };
    let model = TwoAxisScanner { x: scanner(), y: gimbal, gimbal_inertia: 1.1e-14 };
    let mut chance = Chance::new(3);
    hold_motion(&device, &model, &mut chance, [0.3, 3e4, 0.2, 8e3], volts);
    let readout = TwoAxisComb { x: comb(), y: gimbal.comb, gain: -0.3574e12, offset: 6.3945 };
    hold_readout::<_, 4>(&device, 0, &readout, &mut chance, |c| {
        [c.between(-0.3, 0.3), c.between(-3e4, 3e4), c.between(-0.2, 0.2), c.between(-8e3, 8e3)]
    });
    hold_parameter(&device, ("gimbal", "gimbal_inertia"), &model, &mut chance, ([0.3, 3e4, 0.2, 8e3], 180.0));
}

fn threshold_comb() -> CombCurve<f64> {
    CombCurve { centre: 3.7e-3, gain: 2.82e-3, steepness: 76.0, shape: CurveShape::Logistic }
}

#[test]
fn the_threshold_scanner_is_its_law() {
    let device = example("threshold_scanner");
    let model = CombDrivenMirror {
        resonator: MirrorResonator { natural_rate: TAU * 624.6, damping_ratio: 0.0066 },
        comb: threshold_comb(),
        drive_gain: 30.0,
    };
    let mut chance = Chance::new(4);
    hold_motion(&device, &model, &mut chance, [0.2, 600.0], volts);
    let point = |c: &mut Chance| [c.between(-0.2, 0.2), c.between(-600.0, 600.0)];
    let readout = CurrentReadout { comb: threshold_comb(), offset: 1e-3 };
    hold_readout::<_, 2>(&device, 0, &readout, &mut chance, point);
    hold_readout::<_, 2>(&device, 1, &ChangeOf(threshold_comb()), &mut chance, point);
    // The event is where the comb's curve has its centre.
    let event = device.event(0, &[]).unwrap();
    let mut work = event.work(&device.values());
    assert_eq!(event.read(&mut work, &[3.7e-3, 100.0], &[0.0]), 0.0);
}

/// The capacitance of the threshold comb as a measurement.
struct ChangeOf(CombCurve<f64>);

impl Measurement<f64, 2, 1> for ChangeOf {
    fn predict<S: kalmems_core::Over<f64>>(&self, x: &[S; 2]) -> [S; 1] {
        [self.0.capacitance_change(x[0], 1e8)]
    }
}

#[test]
fn the_accelerometer_is_its_law() {
    let device = example("accelerometer");
    let plates = DifferentialPlates { area: 1.86e-6, gap: 2.3e-6, permittivity: 35.4e-12 };
    let model = SensedAcceleration {
        device: Accelerometer {
            mass: ProofMass { mass: 3.8e-9, damping: 7e-4, squeezed: 0.4, spring: 3.0 },
            plates,
            carrier_mean_square: 0.18,
            bias: 0.1,
        },
        prior: GaussMarkov { rms: 9.806_65, rate: TAU * 50.0, damping_ratio: 0.72 },
    };
    let mut chance = Chance::new(5);
    let feedback = |c: &mut Chance| {
        let volts = c.between(-0.1, 0.1);
        (vec![volts], volts)
    };
    hold_motion(&device, &model, &mut chance, [1.8e-6, 1e-2, 50.0, 1e4], feedback);
    let readout = DifferentialReadout { plates, carrier_amplitude: 0.6, feedback_capacitance: 20e-12 };
    hold_readout::<_, 4>(&device, 0, &readout, &mut chance, |c| {
        [c.between(-1.8e-6, 1.8e-6), c.between(-1e-2, 1e-2), 0.0, 0.0]
    });
    let noise = device.noise(&device.values(), &vec![0.0; device.states().len()]).unwrap();
    let (kind, density) = noise[0];
    assert_eq!(kind, NoiseKind::Rate { state: 3 });
    hold("noise", &[density], &[model.prior.density()], &[0.0]);
}

#[test]
fn the_micro_stage_is_its_law() {
    let device = example("micro_stage");
    let model = PiezoStage {
        resonator: MirrorResonator { natural_rate: TAU * 1714.5, damping_ratio: 0.005 },
        drive_gain: 3782.5,
    };
    let mut chance = Chance::new(6);
    hold_motion(&device, &model, &mut chance, [0.01, 100.0], volts);
    let edges = [[-1.39e-3, -0.99e-3], [475e-6, 795e-6], [0.99e-3, 1.39e-3], [-795e-6, -475e-6]];
    for (measure, [w1, w2]) in edges.into_iter().enumerate() {
        let plate = TiltingPlate { w1, w2, w3: -0.2e-3, w4: 0.2e-3, gap: 19.2e-6, permittivity: 8.8542e-12 };
        let readout = PlateCurrent { plate, gain: -2.40752e7 };
        hold_readout::<_, 2>(&device, measure, &readout, &mut chance, |c| {
            [c.between(-0.0135, 0.0135), c.between(-100.0, 100.0)]
        });
    }
}

#[test]
fn the_piston_mirror_is_its_law() {
    let device = example("piston_mirror");
    let series = DistanceSeries { reference_distance: 1e-3, coefficients: [3e-15, 100e-15, 9.3e-15] };
    let mut chance = Chance::new(7);
    let point = |c: &mut Chance| {
        [
            c.between(-5e-4, 5e-4),
            500.0,
            c.between(-4.0, 4.0),
            c.between(0.9e-3, 1.1e-3),
            c.between(-1e-6, 1e-6),
        ]
    };
    hold_readout::<_, 5>(&device, 0, &DriftingPhasorCapacitance { series }, &mut chance, point);
    // The motion is linear, so that a step of Runge and Kutta's method is the exact one.
    let exact = DriftingPhasor::new(5e-5, &NoiseDensity::none());
    let motion = device.motion(&[]).unwrap();
    let mut work = motion.work(&device.values());
    let tables = motion.runge_kutta(5e-5);
    for _ in 0..500 {
        let x = point(&mut chance);
        let (mut next, mut jacobian) = ([0.0; 5], [0.0; 25]);
        let held = Nodes::held(&[][..]);
        assert!(motion.linearized_step(&mut work, &x, &held, &tables, &mut next, &mut jacobian));
        let (expected, by_model) = exact.linearize(&x, &0.0);
        hold("step", &next, &expected, &expected);
        hold("jacobian", &jacobian, by_model.0.as_flattened(), by_model.0.as_flattened());
    }
    assert_eq!(device.periods(&device.values()).unwrap(), [(2, TAU)]);
    let noise = device.noise(&device.values(), &vec![0.0; device.states().len()]).unwrap();
    let (kind, density) = noise[3];
    assert_eq!(kind, NoiseKind::Density { measure: 0 });
    hold("noise", &[density], &[0.151e-18 * 0.151e-18], &[0.0]);
}

/// A step and its Jacobian against the core's integrators with dual numbers, with a parameter as a state as well.
#[test]
fn steps_are_those_of_the_core() {
    let device = example("shared_scanner");
    let (plain, free) =
        (device.motion(&[]).unwrap(), device.motion(&[device.parameter("k").unwrap()]).unwrap());
    let (mut work, mut work_free) = (plain.work(&device.values()), free.work(&device.values()));
    let rest = (&[0.0, 0.0], &0.0);
    let no_noise = NoiseDensity::none();
    // Without a linear part, in a step of the recording; and with that of the mirror at rest, in one eight times as long.
    let runge_kutta = Rk4::new(scanner(), 1e-6, &no_noise, rest);
    let by_runge_kutta = |x: &[f64; 2], u: &Nodes<f64>| runge_kutta.linearize(x, u);
    hold_steps((&plain, &mut work), &plain.runge_kutta(1e-6), by_runge_kutta, 1e-6);
    let exponential = Etdrk4::new(scanner(), 8e-6, &no_noise, rest);
    let mut tables = plain.tables();
    let (mut rates, mut linear) = ([0.0; 2], [0.0; 4]);
    assert!(plain.linearize(&mut work, &[0.0; 2], &[0.0], &mut rates, &mut linear));
    plain.set_tables(&mut tables, &linear, 8e-6);
    hold_steps((&plain, &mut work), &tables, |x, u| exponential.linearize(x, u), 8e-6);

    // With the stiffness as a state: the same step, and the derivative by it against the core's.
    let tables = free.runge_kutta(1e-6);
    let varied = common::varied(&scanner(), "resonator.stiffness");
    let mut chance = Chance::new(9);
    for _ in 0..1000 {
        let (x, inputs) = drawn(&mut chance);
        let of = inputs.map(|input| [input]);
        let nodes = Nodes { start: &of[0][..], middle: &of[1][..], end: &of[2][..] };
        let native = Nodes { start: inputs[0], middle: inputs[1], end: inputs[2] };
        let (mut next, mut jacobian) = ([0.0; 3], [0.0; 9]);
        let at = [x[0], x[1], 1.10e-4];
        assert!(free.linearized_step(&mut work_free, &at, &nodes, &tables, &mut next, &mut jacobian));
        let terms = [x[0].abs() + 1e-6 * x[1].abs(), x[1].abs()];
        hold("step with a parameter", &next[..2], &runge_kutta.step(&x, &native), &terms);
        assert_eq!((next[2], &jacobian[6..]), (1.10e-4, &[0.0, 0.0, 1.0][..]));
        let by_k = common::rk4_by_parameter::<ParametricScanner<f64>, 2>(&varied, &x, &native, 1e-6);
        for (row, expected) in by_k.iter().enumerate() {
            hold("by the stiffness", &[jacobian[row * 3 + 2]], &[*expected], &[*expected]);
        }
    }
}

/// A state of the scanner, and a drive at the start, the middle and the end of a step.
fn drawn(chance: &mut Chance) -> ([f64; 2], [f64; 3]) {
    let x = [chance.between(-0.3, 0.3), chance.between(-3e4, 3e4)];
    (x, [0; 3].map(|_| chance.between(-180.0, 180.0)))
}

/// Holds the steps of a motion of two states against others over the same interval in s.
fn hold_steps(
    (motion, work): (&Motion, &mut ProgramNumbers),
    tables: &StepTables,
    expected: impl Fn(&[f64; 2], &Nodes<f64>) -> ([f64; 2], Mat<f64, 2, 2>),
    interval: f64,
) {
    let mut chance = Chance::new(8);
    for _ in 0..1000 {
        let (x, inputs) = drawn(&mut chance);
        let of = inputs.map(|input| [input]);
        let nodes = Nodes { start: &of[0][..], middle: &of[1][..], end: &of[2][..] };
        let native = Nodes { start: inputs[0], middle: inputs[1], end: inputs[2] };
        let (mut next, mut jacobian, mut alone) = ([0.0; 2], [0.0; 4], [0.0; 2]);
        assert!(motion.linearized_step(work, &x, &nodes, tables, &mut next, &mut jacobian));
        let (expected, by_model) = expected(&x, &native);
        // The rate changes by its own size over a quarter of a radian of the motion.
        let rate = x[1].abs() + 1e5 * x[0].abs();
        hold("step", &next, &expected, &[x[0].abs() + interval * rate, rate]);
        let scale: Vec<f64> = by_model.0.as_flattened().to_vec();
        hold("jacobian", &jacobian, by_model.0.as_flattened(), &scale);
        assert!(motion.step(work, &x, &nodes, tables, &mut alone));
        assert_eq!(alone, next);
    }
}

/// A new value of a parameter needs no new program.
#[test]
fn a_new_value_of_a_parameter_is_taken_by_the_same_program() {
    let device = example("shared_scanner");
    let motion = device.motion(&[]).unwrap();
    let mut values = device.values();
    values[device.parameter("k").unwrap()] *= 1.5;
    let stiffer = ParametricScanner {
        resonator: TorsionalResonator { stiffness: 1.10e-4 * 1.5, ..resonator() },
        ..scanner()
    };
    let mut rates = [0.0; 2];
    assert!(motion.rates(&mut motion.work(&values), &[0.1, 5.0], &[60.0], &mut rates));
    hold("rates", &rates, &stiffer.derivative(&[0.1, 5.0], &60.0), &[0.0; 2]);
}

#[test]
fn a_flag_marks_arguments_outside_of_the_domain() {
    let text = "[states]\nx = '1'\n[derivative]\nx = '-1[1/s]*sqrt(x)'\n[measure]\ny = 'ln(x) in 1'\n";
    let device = device(text);
    let motion = device.motion(&[]).unwrap();
    let mut work = motion.work(&[]);
    let mut rates = [0.0];
    assert!(motion.rates(&mut work, &[4.0], &[], &mut rates));
    assert!(!motion.rates(&mut work, &[-1.0], &[], &mut rates));
    let (mut next, mut jacobian) = ([0.0], [0.0]);
    assert!(!motion.linearized_step(
        &mut work,
        &[-1.0],
        &Nodes::held(&[][..]),
        &motion.runge_kutta(1e-3),
        &mut next,
        &mut jacobian
    ));
    // At the edge the rate is finite and its slope is not.
    assert!(!motion.linearize(&mut work, &[0.0], &[], &mut rates, &mut jacobian));
    let readout = device.readout(0, &[]).unwrap();
    assert!(readout.read(&mut readout.work(&[]), &[-1.0], &[]).is_nan());
}
