//! The regulator on the true state: that it starts, holds, keeps its limits and comes back.

use kalmems_core::{NoiseDensity, Over, Process, Rk4, Scalar};
use kalmems_models::capacitance::GaussianComb;
use kalmems_models::control::{
    Limits, PiController, Regulator, RegulatorSettings, RegulatorStage, StartUp, Tolerance,
};
use kalmems_models::dynamics::{ParametricScanner, TorsionalResonator};

const INTERVAL: f64 = 1e-6;
const TARGET: f64 = 0.19;

fn settings<P: Scalar>() -> RegulatorSettings<P> {
    let p = |x: f64| P::of(x);
    let rate = |drive_hz: f64| RegulatorSettings::rate_of(p(drive_hz));
    RegulatorSettings {
        interval: p(INTERVAL),
        amplitude: p(TARGET),
        phase: p(0.0),
        phase_loop: PiController { proportional: p(960.0), integral: p(4e5) },
        amplitude_loop: PiController { proportional: p(370.0), integral: p(1.3e5) },
        smoothing_rate: p(2e4),
        offset: p(90.0),
        rate: Limits { lowest: rate(31_000.0), highest: rate(31_600.0) },
        voltage: Limits { lowest: p(20.0), highest: p(100.0) },
        start: StartUp {
            from: rate(31_500.0),
            to: rate(31_150.0),
            slope: rate(4000.0),
            voltage: p(90.0),
            caught: p(0.06),
            climb: p(5.0),
        },
        tolerance: Tolerance { amplitude: p(0.005), phase: p(0.0017), lasting: p(2e-3) },
    }
}

fn scanner<P: Scalar>(stiffness: f64, damping: f64) -> ParametricScanner<P> {
    let p = |x: f64| P::of(x);
    ParametricScanner {
        resonator: TorsionalResonator {
            inertia: p(1.15e-14),
            damping: p(5.95e-12 * damping),
            stiffness: p(1.10e-4 * stiffness),
        },
        comb: GaussianComb { nominal: p(5.71e-12), angular_width: p(0.2), bias: p(9.79e-12) },
        carrier_mean_square: p(18.0),
    }
}

/// A scanner in the loop of a regulator that sees its state.
struct Bench<P> {
    regulator: Regulator<P>,
    state: [P; 2],
    largest_voltage: P,
    rates: [P; 2],
}

impl<P: Scalar + Over<P>> Bench<P> {
    fn new(settings: RegulatorSettings<P>) -> Self {
        let regulator = Regulator::new(settings);
        let rate = regulator.drive().rate;
        Self { regulator, state: [P::of(1e-4), P::of(0.0)], largest_voltage: P::of(0.0), rates: [rate; 2] }
    }

    /// So many samples of this scanner. The fundamental of the angle over them, projected on the oscillator's phase under
    /// a Hann window: amplitude, and phase against the drive in rad.
    fn run(&mut self, scanner: &ParametricScanner<P>, samples: u32) -> [P; 2] {
        let (mut cosine, mut sine, mut weight) = (P::of(0.0), P::of(0.0), P::of(0.0));
        for k in 0..samples {
            let nodes = self.regulator.drive().nodes(P::of(INTERVAL));
            let process =
                Rk4::new(*scanner, P::of(INTERVAL), &NoiseDensity::none(), (&self.state, &nodes.start));
            let command = self.regulator.step(Some(self.state));
            self.state = process.step(&self.state, &nodes);
            let phase = self.regulator.drive().phase;
            let window = P::of((std::f64::consts::PI * f64::from(k) / f64::from(samples)).sin().powi(2));
            cosine = cosine + (window * self.state[0] * phase.cos()).twice();
            sine = sine + (window * self.state[0] * phase.sin()).twice();
            weight = weight + window;
            let larger = command.voltage.gt(self.largest_voltage);
            self.largest_voltage = P::select(larger, command.voltage, self.largest_voltage);
            let [low, high] = self.rates;
            self.rates = [
                P::select(command.rate.lt(low), command.rate, low),
                P::select(command.rate.gt(high), command.rate, high),
            ];
        }
        let (cosine, sine) = (cosine / weight, sine / weight);
        [(cosine.sq() + sine.sq()).sqrt(), sine / cosine]
    }
}

/// From rest onto the upper branch, at the frequency and voltage that harmonic balance has for this amplitude and phase:
/// 10.89° at phase 0 is between 70 V (10.96°, 31 244.5 Hz) and 60 V (8.68°, 31 264.4 Hz), computed apart from this program.
#[test]
fn it_starts_onto_the_upper_branch_and_holds() {
    let mut bench = Bench::<f64>::new(settings());
    bench.run(&scanner(1.0, 1.0), 120_000);
    assert_eq!((bench.regulator.stage(), bench.regulator.sweeps_again()), (RegulatorStage::Regulated, 0));
    let [amplitude, phase] = bench.run(&scanner(1.0, 1.0), 5_000);
    assert!((amplitude / TARGET - 1.0).abs() < 1e-3, "{amplitude}");
    assert!(phase.abs() < 2e-4, "{phase}");
    let drive = bench.regulator.drive();
    assert!((drive.amplitude - 69.7).abs() < 0.3, "{}", drive.amplitude);
    assert!((drive.rate / std::f64::consts::PI - 31_245.0).abs() < 1.5, "{}", drive.rate);
    assert!((bench.regulator.amplitude() - amplitude).abs() < 1e-3 * amplitude);
}

/// A stiffness 0.13 % and a damping 5 % off, either way, at once: the frequency follows by half of 0.13 %, the voltage by
/// about 5 %, and amplitude and phase come back. At the old frequency the stiffer device has no motion.
#[test]
fn it_follows_what_the_device_becomes() {
    for (stiffness, damping) in [(1.0013, 0.95), (0.9987, 1.05)] {
        let mut bench = Bench::<f64>::new(settings());
        bench.run(&scanner(1.0, 1.0), 120_000);
        let before = *bench.regulator.drive();
        bench.run(&scanner(stiffness, damping), 60_000);
        let [amplitude, phase] = bench.run(&scanner(stiffness, damping), 5_000);
        assert!((amplitude / TARGET - 1.0).abs() < 1e-3 && phase.abs() < 2e-4, "{amplitude} {phase}");
        let after = bench.regulator.drive();
        let shift = after.rate / before.rate - 1.0;
        assert!((shift - 0.5 * (stiffness - 1.0)).abs() < 1.2e-4, "{shift}");
        assert!((after.amplitude / before.amplitude - damping).abs() < 0.01, "{}", after.amplitude);
    }
}

/// An amplitude out of reach: the voltage stays at its limit, and comes off it at once when the device can follow again.
#[test]
fn limits_are_kept_and_nothing_winds_up() {
    let mut bench = Bench::<f64>::new(settings());
    bench.run(&scanner(1.0, 1.0), 120_000);
    // Damped by half as much again, 100 V do not reach 10.9°.
    bench.run(&scanner(1.0, 1.6), 300_000);
    assert_eq!(bench.regulator.drive().amplitude, 100.0);
    assert!(bench.largest_voltage <= 100.0);
    // Loosened, the motion overshoots by what the plant alone does, not by what 300 ms of integral would be: back within
    // 0.5 % after 20 ms.
    bench.run(&scanner(1.0, 1.0), 20_000);
    let [amplitude, _] = bench.run(&scanner(1.0, 1.0), 3_000);
    assert!((amplitude / TARGET - 1.0).abs() < 5e-3, "{amplitude}");
    let [low, high] = bench.rates.map(|rate| rate / std::f64::consts::PI);
    assert!(low >= 31_000.0 && high <= 31_600.0, "{low} {high}");
}

/// A sweep that ends without a motion begins again; a motion that is lost is started anew.
#[test]
fn it_sweeps_again() {
    let mut bench = Bench::<f64>::new(settings());
    // So much damping that nothing pumps it.
    bench.run(&scanner(1.0, 3.0), 200_000);
    assert_eq!(bench.regulator.stage(), RegulatorStage::Sweeping);
    let sweeps = bench.regulator.sweeps_again();
    assert!((2..=3).contains(&sweeps), "{sweeps}");
    bench.state = [1e-4, 0.0];
    bench.run(&scanner(1.0, 1.0), 250_000);
    assert_eq!(bench.regulator.stage(), RegulatorStage::Regulated);
    let before = bench.regulator.sweeps_again();
    // Without an estimate, and with one that says rest, and with one that is none.
    for lost in [None, Some([1e-4, 0.0]), Some([f64::NAN, 0.0])] {
        let mut regulator = bench.regulator;
        for _ in 0..2000 {
            regulator.step(lost);
        }
        assert_eq!(
            (regulator.stage(), regulator.sweeps_again()),
            (RegulatorStage::Sweeping, before + 1),
            "{lost:?}"
        );
    }
}

/// The mirror image of a motion is regulated like the motion.
#[test]
fn the_sign_of_the_motion_does_not_matter() {
    let run = |sign: f64| {
        let mut bench = Bench::<f64>::new(settings());
        bench.state = [sign * 1e-4, 0.0];
        bench.run(&scanner(1.0, 1.0), 100_000);
        (bench.state.map(|x| sign * x), *bench.regulator.drive())
    };
    assert_eq!(run(1.0), run(-1.0));
}

/// In f32 the same motion is held.
#[test]
fn single_precision_regulates_as_well() {
    let mut bench = Bench::<f32>::new(settings());
    bench.run(&scanner(1.0, 1.0), 150_000);
    assert_eq!(bench.regulator.stage(), RegulatorStage::Regulated);
    let [amplitude, phase] = bench.run(&scanner(1.0, 1.0), 5_000);
    assert!((f64::from(amplitude) / TARGET - 1.0).abs() < 1e-3 && phase.abs() < 2e-4, "{amplitude} {phase}");
}
