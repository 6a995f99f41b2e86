//! The scanner's parameters as states: their Jacobians, and what tracking them does for the angle.

#![allow(clippy::cast_possible_truncation)] // to f32, on purpose

use kalmems_core::{
    AddedState, Augmented, AugmentedMeasurement, Covariance, Drift, Ekf, Euler, Filter, Measurement, Nodes,
    NoiseDensity, Parameters, Process, Rk4, SigmaPoints, Ukf,
};
use kalmems_models::capacitance::GaussianComb;
use kalmems_models::dynamics::{ParametricScanner, TorsionalResonator};
use kalmems_models::readout::DemodulatedComb;
use proptest::prelude::*;
use std::f64::consts::TAU;

const COMB: GaussianComb<f64> = GaussianComb { nominal: 5.71e-12, angular_width: 0.2, bias: 9.79e-12 };
const SCANNER: ParametricScanner<f64> = ParametricScanner {
    resonator: TorsionalResonator { inertia: 1.15e-14, damping: 5.95e-12, stiffness: 1.10e-4 },
    comb: COMB,
    carrier_mean_square: 18.0,
};
const READOUT: DemodulatedComb<f64> = DemodulatedComb { comb: COMB, gain: -0.3574e12, offset: 6.3945 };

const SCANNER_NAMES: [&str; 7] = [
    "resonator.inertia",
    "resonator.damping",
    "resonator.stiffness",
    "comb.nominal",
    "comb.angular_width",
    "comb.bias",
    "carrier_mean_square",
];
const READOUT_NAMES: [&str; 5] = ["comb.nominal", "comb.angular_width", "comb.bias", "gain", "offset"];

/// Sizes that make each entry of a step's Jacobian of order 1, of states and of parameters relative to their own.
const SIZES: [f64; 3] = [0.1, 1e4, 1.0];

fn constant(scale: f64) -> AddedState<f64> {
    AddedState { scale, drift: Drift::RandomWalk { density: 0.0 } }
}

/// The model with one parameter moved.
fn moved<M: Parameters<f64>>(model: &M, index: usize, by: f64) -> M::Of<f64> {
    model.map(|i, value| if i == index { value + by } else { value })
}

fn rk4(scanner: ParametricScanner<f64>) -> Rk4<ParametricScanner<f64>, f64, 2> {
    Rk4::new(scanner, 1e-6, &NoiseDensity::none(), (&[0.0, 0.0], &0.0))
}

#[test]
fn every_parameter_has_the_name_of_its_field() {
    let named: Vec<_> =
        (0..).map_while(ParametricScanner::<f64>::name).map(|name| name.to_string()).collect();
    assert_eq!(named, SCANNER_NAMES);
    let named: Vec<_> = (0..).map_while(DemodulatedComb::<f64>::name).map(|name| name.to_string()).collect();
    assert_eq!(named, READOUT_NAMES);
    assert_eq!(SCANNER.value(2), Some(1.10e-4));
    assert_eq!(READOUT.value(3), Some(-0.3574e12));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1000))]

    /// Each parameter of the scanner as the one added state, in units of half its value and away from nominal,
    /// against central differences of the plain scanner with that parameter changed.
    #[test]
    fn each_parameter_of_the_scanner_has_its_jacobian(
        index in 0..7_usize, angle in -0.3..0.3_f64, rate in -2e4..2e4_f64,
        voltage in 0.0..180.0_f64, deviation in -0.2..0.2_f64,
    ) {
        let nominal = SCANNER.value(index).unwrap();
        let (scale, drive) = (nominal / 2.0, Nodes { start: voltage, middle: voltage * 0.99, end: voltage * 0.97 });
        let (added, name) = ([constant(scale)], [Some(SCANNER_NAMES[index])]);
        let runge_kutta = Augmented::<_, _, 2, 1, 3>::new(rk4(SCANNER), &added, name).unwrap();
        let euler = Euler::new(SCANNER, 1e-6, Covariance::zero());
        let by_euler = Augmented::<_, _, 2, 1, 3>::new(euler, &added, name).unwrap();
        let x = [angle, rate, deviation];
        let both = [runge_kutta.linearize(&x, &drive), by_euler.linearize(&x, &voltage)];
        let at = |d: [f64; 3]| {
            let changed = moved(&SCANNER, index, scale * (deviation + d[2]));
            let state = [angle + d[0], rate + d[1]];
            [
                rk4(changed).step(&state, &drive),
                Euler::new(changed, 1e-6, Covariance::zero()).step(&state, &voltage),
            ]
        };
        for (which, (there, f)) in both.iter().enumerate() {
            let plain = at([0.0; 3])[which];
            prop_assert!((0..2).all(|i| (there[i] - plain[i]).abs() <= 1e-14 * SIZES[i]));
            prop_assert_eq!(there[2], deviation);
            prop_assert_eq!(f.0[2], [0.0, 0.0, 1.0]);
            for j in 0..3 {
                // Steps that leave the differences well above rounding and below the third derivative.
                let step = 1e-4 * SIZES[j];
                let mut d = [0.0; 3];
                d[j] = step;
                let (up, down) = (at(d)[which], at(d.map(|d| -d))[which]);
                for i in 0..2 {
                    let difference = (up[i] - down[i]) / (2.0 * step);
                    let error = (difference - f[(i, j)]) * SIZES[j] / SIZES[i];
                    prop_assert!(error.abs() <= 1e-8, "{} {i} {j}: {difference} {}", SCANNER_NAMES[index], f[(i, j)]);
                }
            }
        }
    }

    /// The same for the readout, in V.
    #[test]
    fn each_parameter_of_the_readout_has_its_jacobian(
        index in 0..5_usize, angle in -0.3..0.3_f64, rate in -2e4..2e4_f64, deviation in -0.2..0.2_f64,
    ) {
        let scale = READOUT.value(index).unwrap() / 2.0;
        let readout =
            AugmentedMeasurement::<_, _, 2, 1>::new(READOUT, &[constant(scale)], [Some(READOUT_NAMES[index])]).unwrap();
        let ([y], h) = readout.linearize(&[angle, rate, deviation]);
        let at = |d: [f64; 3]| {
            moved(&READOUT, index, scale * (deviation + d[2])).predict(&[angle + d[0], rate + d[1]])[0]
        };
        prop_assert!((y - at([0.0; 3])).abs() <= 1e-13);
        for j in 0..3 {
            let step = 1e-4 * SIZES[j];
            let mut d = [0.0; 3];
            d[j] = step;
            let difference = (at(d) - at(d.map(|d| -d))) / (2.0 * step);
            prop_assert!(((difference - h[(0, j)]) * SIZES[j]).abs() <= 1e-7, "{index} {j}: {difference} {}", h[(0, j)]);
        }
    }

    /// C₀ drives and senses: one state moves both, each by its own derivative.
    #[test]
    fn one_state_enters_the_process_and_the_measurement(
        angle in -0.3..0.3_f64, rate in -2e4..2e4_f64, voltage in 0.0..180.0_f64, deviation in -1.0..1.0_f64,
    ) {
        let scale = 0.1e-12;
        let (added, name) = ([constant(scale)], [Some("comb.nominal")]);
        let process = Augmented::<_, _, 2, 1, 3>::new(rk4(SCANNER), &added, name).unwrap();
        let readout = AugmentedMeasurement::<_, _, 2, 1>::new(READOUT, &added, name).unwrap();
        let (x, drive) = ([angle, rate, deviation], Nodes::held(voltage));
        let (moved_to, f) = process.linearize(&x, &drive);
        let (_, h) = readout.linearize(&moved_to);
        // y after one step as a function of C₀ alone, both places changed.
        let at = |d: f64| {
            let comb = GaussianComb { nominal: COMB.nominal + scale * (deviation + d), ..COMB };
            let state = rk4(ParametricScanner { comb, ..SCANNER }).step(&[angle, rate], &drive);
            DemodulatedComb { comb, ..READOUT }.predict(&state)[0]
        };
        let step = 1e-3;
        let joint = (at(step) - at(-step)) / (2.0 * step);
        let chain: f64 = (0..3).map(|k| h[(0, k)] * f[(k, 2)]).sum();
        prop_assert!((joint - chain).abs() <= 1e-10, "{joint} {chain}");
        prop_assert_eq!(process.model_at(&x).comb, readout.model_at(&x).comb);
    }
}

/// Numbers that look random: SplitMix64 (Steele et al. 2014), made normal by Box and Muller's method.
struct Noise(u64);
impl Noise {
    fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }
    fn normal(&mut self) -> f64 {
        (-2.0 * (1.0 - self.uniform()).ln()).sqrt() * (TAU * self.uniform()).cos()
    }
}

/// What is measured, and the truth that it was measured of.
struct Recording {
    drive: Vec<Nodes<f64>>,
    signal: Vec<f64>,
    angle: Vec<f64>,
}

const INTERVAL: f64 = 1e-6;
const SAMPLES: usize = 15_000;
/// The angular acceleration's density in the truth and in the augmented filter, in rad²/s³.
const DENSITY: f64 = 1e4;
const NOISE_VARIANCE: f64 = 1.92e-4;

/// The device in truth: softer by 0.3 %, read with 3 % more gain and 20 mV of offset.
fn recording(seed: u64) -> Recording {
    let mut noise = Noise(seed);
    let resonator = TorsionalResonator { stiffness: 1.10e-4 * 0.997, ..SCANNER.resonator };
    let truth = ParametricScanner { resonator, ..SCANNER };
    let readout = DemodulatedComb { gain: READOUT.gain * 1.03, offset: READOUT.offset + 0.02, ..READOUT };
    // Near the upper edge of the resonance, softened with the spring.
    let hz = 31_350.0 * 0.997_f64.sqrt();
    let volts = |t: f64| 90.0 + 90.0 * (TAU * hz * t).sin();
    let nodes = |t: f64, h: f64| Nodes { start: volts(t), middle: volts(t + h / 2.0), end: volts(t + h) };
    // Integrated in steps of a quarter of the filters'.
    let quarter = INTERVAL / 4.0;
    let process = Rk4::new(truth, quarter, &NoiseDensity::none(), (&[0.0, 0.0], &0.0));
    let mut x = [0.15, 0.0];
    let mut recording = Recording { drive: vec![], signal: vec![], angle: vec![] };
    for k in 0..SAMPLES {
        let t = k as f64 * INTERVAL;
        for i in 0..4 {
            x = process.step(&x, &nodes(t + f64::from(i) * quarter, quarter));
            x[1] += (DENSITY * quarter).sqrt() * noise.normal();
        }
        recording.drive.push(nodes(t, INTERVAL));
        recording.signal.push(readout.predict(&x)[0] + NOISE_VARIANCE.sqrt() * noise.normal());
        recording.angle.push(x[0]);
    }
    recording
}

/// Follows a recording; the root mean square of the angle's error over the last third, in degrees.
fn follow<const N: usize, F: Filter<f64, N>>(
    filter: &mut F,
    process: &impl Process<f64, N, Input = Nodes<f64>>,
    readout: &impl Measurement<f64, N, 1>,
    recording: &Recording,
) -> f64 {
    let r = Covariance::from_variances([NOISE_VARIANCE]);
    let mut squares = 0.0;
    for k in 0..SAMPLES {
        filter.predict(process, &recording.drive[k]).unwrap();
        filter.update(readout, &[recording.signal[k]], &r).unwrap();
        if k >= SAMPLES / 3 * 2 {
            squares += (filter.mean()[0] - recording.angle[k]).powi(2);
        }
    }
    (squares / (SAMPLES / 3) as f64).sqrt().to_degrees()
}

/// What is added: the stiffness to the process, gain and offset to the readout; each in units of what it is off by
/// at most, so that the state in truth is −1, 1 and 1.
const ADDED: [AddedState<f64>; 3] = [
    AddedState { scale: 0.003 * 1.10e-4, drift: Drift::RandomWalk { density: 0.0 } },
    AddedState { scale: -0.03 * 0.3574e12, drift: Drift::RandomWalk { density: 0.0 } },
    AddedState { scale: 0.02, drift: Drift::RandomWalk { density: 0.0 } },
];
const TRUTH: [f64; 3] = [-1.0, 1.0, 1.0];

type Scanner5 = Augmented<Rk4<ParametricScanner<f64>, f64, 2>, f64, 2, 3, 5>;
type Readout5 = AugmentedMeasurement<DemodulatedComb<f64>, f64, 2, 3>;

fn augmented() -> (Scanner5, Readout5) {
    let noise = NoiseDensity::none().on::<1>(DENSITY);
    let plain = Rk4::new(SCANNER, INTERVAL, &noise, (&[0.0, 0.0], &0.0));
    let process = Augmented::new(plain, &ADDED, [Some("resonator.stiffness"), None, None]).unwrap();
    let readout = AugmentedMeasurement::new(READOUT, &ADDED, [None, Some("gain"), Some("offset")]).unwrap();
    (process, readout)
}

const START: [f64; 5] = [0.14, 0.0, 0.0, 0.0, 0.0];
const START_SD: [f64; 5] = [0.02, 2e3, 1.0, 1.0, 1.0];
const SEEDS: u64 = 24;

/// The mirror swings 8° and more. Of 24 independent estimates, 2.7 ‰ should miss the truth by more than 3σ: more
/// than two have a probability of 4e-5. A third should miss it by more than 1σ: none, or more than 17, have one of
/// 1e-4 and 3e-5.
#[test]
fn stiffness_gain_and_offset_are_found_and_the_angle_with_them() {
    let (process, readout) = augmented();
    let (mut beyond_3, mut beyond_1) = ([0; 3], [0; 3]);
    let (mut with, mut without) = (0.0_f64, [0.0_f64; 4]);
    for seed in 0..SEEDS {
        let recording = recording(seed);
        let swing = recording.angle[SAMPLES / 3 * 2..].iter().fold(0.0_f64, |a, b| a.max(b.abs()));
        assert!(swing.to_degrees() >= 8.0, "seed {seed} swings {}°", swing.to_degrees());
        let mut filter = Ekf::new(START, Covariance::from_standard_deviations(START_SD));
        with = with.max(follow(&mut filter, &process, &readout, &recording));
        for i in 0..3 {
            let error =
                (filter.mean()[2 + i] - TRUTH[i]).abs() / filter.covariance().standard_deviation(2 + i);
            beyond_3[i] += u32::from(error > 3.0);
            beyond_1[i] += u32::from(error > 1.0);
        }
        // Without them, however far the model is trusted.
        for (density, worst) in [1e4, 1e6, 1e8, 1e10].iter().zip(&mut without) {
            let noise = NoiseDensity::none().on::<1>(*density);
            let process = Rk4::new(SCANNER, INTERVAL, &noise, (&[0.0, 0.0], &0.0));
            let mut filter = Ekf::new([0.14, 0.0], Covariance::from_standard_deviations([0.02, 2e3]));
            *worst = worst.max(follow(&mut filter, &process, &READOUT, &recording));
        }
    }
    for i in 0..3 {
        assert!(beyond_3[i] <= 2, "{beyond_3:?}");
        assert!((1..=17).contains(&beyond_1[i]), "{beyond_1:?}");
    }
    let best = without.into_iter().fold(f64::INFINITY, f64::min);
    assert!(best > 50.0 * with, "with {with}°, without {without:?}°");
    assert!(with < 0.01, "{with}°");
}

/// Sigma points go the same way, and the model can be read off the state.
#[test]
fn the_unscented_filter_finds_them_too() {
    let (process, readout) = augmented();
    let recording = recording(1);
    let start = Covariance::from_standard_deviations(START_SD);
    let mut ekf = Ekf::new(START, start);
    let mut ukf = Ukf::new(START, start, SigmaPoints::standard());
    follow(&mut ekf, &process, &readout, &recording);
    follow(&mut ukf, &process, &readout, &recording);
    for i in 0..3 {
        let apart = (ekf.mean()[2 + i] - ukf.mean()[2 + i]).abs();
        assert!(apart < ukf.covariance().standard_deviation(2 + i), "{i}: {apart}");
    }
    let found = process.model_at(ukf.mean()).resonator.stiffness;
    assert!((found / (1.10e-4 * 0.997) - 1.0).abs() < 1e-4, "{found}");
    assert!((readout.model_at(ukf.mean()).gain / (READOUT.gain * 1.03) - 1.0).abs() < 0.01);
}

/// The same in `f32`: states of order 1 need no more digits than it has. The bound is that of twice the angle's
/// error in `f64`.
#[test]
fn f32_is_enough() {
    let added = ADDED
        .map(|state| AddedState { scale: state.scale as f32, drift: Drift::RandomWalk { density: 0.0_f32 } });
    let narrow = |_: usize, value: f64| value as f32;
    let noise = NoiseDensity::none().on::<1>(DENSITY as f32);
    let plain = Rk4::new(SCANNER.map(narrow), INTERVAL as f32, &noise, (&[0.0, 0.0], &0.0));
    let process =
        Augmented::<_, _, 2, 3, 5>::new(plain, &added, [Some("resonator.stiffness"), None, None]).unwrap();
    let readout = AugmentedMeasurement::<_, _, 2, 3>::new(
        READOUT.map(narrow),
        &added,
        [None, Some("gain"), Some("offset")],
    )
    .unwrap();
    let r = Covariance::from_variances([NOISE_VARIANCE as f32]);
    let mut worst = 0.0_f64;
    for seed in 0..4 {
        let recording = recording(seed);
        let start = Covariance::from_standard_deviations(START_SD.map(|sd| sd as f32));
        let mut filter = Ekf::new(START.map(|x| x as f32), start);
        let mut squares = 0.0;
        for k in 0..SAMPLES {
            let Nodes { start, middle, end } = recording.drive[k];
            let drive = Nodes { start: start as f32, middle: middle as f32, end: end as f32 };
            filter.predict(&process, &drive).unwrap();
            filter.update(&readout, &[recording.signal[k] as f32], &r).unwrap();
            if k >= SAMPLES / 3 * 2 {
                squares += (f64::from(filter.mean()[0]) - recording.angle[k]).powi(2);
            }
        }
        worst = worst.max((squares / (SAMPLES / 3) as f64).sqrt().to_degrees());
    }
    assert!(worst < 0.012, "{worst}°");
}
