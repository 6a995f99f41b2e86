//! How a steady motion of a parametric scanner answers to its drive, and the loops that hold it.

use super::{Balance, Drive};
use kalmems_core::Portable;
use kalmems_core::Scalar;
use kalmems_models::control::{Complex, PiController};
use kalmems_models::dynamics::ParametricScanner;
use std::f64::consts::{PI, TAU};

/// A steady motion of wanted amplitude and phase under V = V_o + V_1·sin 2α, and its equations of slow change
/// linearised there.
///
/// With θ = A·cos(α − φ) and the torques C and S of [`Balance`], averaging over a cycle gives (Nayfeh and Mook,
/// Nonlinear Oscillations, 1979, section 5.7)
///
/// A′ = A·(κ·S − b·ω)/(2Jω),  φ′ = ω − ω_m with J·ω_m² = k + κ·C:
///
/// the amplitude answers to V_1 and the phase to ω, whose integral it is but for what it does to ω_m itself. For small
/// changes x = [δA/A, δφ], x′ = F·x + g·δV_1 + [0, 1]·δω.
///
/// ```
/// use kalmems_engines::simulate::RegulatedMotion;
/// use kalmems_models::{capacitance::GaussianComb, dynamics::{ParametricScanner, TorsionalResonator}};
/// let scanner = ParametricScanner {
///     resonator: TorsionalResonator { inertia: 1.15e-14, damping: 5.95e-12, stiffness: 1.10e-4 },
///     comb: GaussianComb { nominal: 5.71e-12, angular_width: 0.2, bias: 9.79e-12 },
///     carrier_mean_square: 18.0,
/// };
/// let motion = RegulatedMotion::of(&scanner, 90.0, (0.19, 0.0), [20.0, 120.0]).unwrap();
/// assert!((motion.voltage - 69.6).abs() < 0.1 && (motion.drive_hz - 31_245.0).abs() < 0.5);
/// // Where the drive acts best, a little phase does nothing to the amplitude.
/// let [[_, by_phase], _] = motion.flow;
/// assert!(by_phase.abs() < 60.0);
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct RegulatedMotion {
    /// A in rad.
    pub amplitude: f64,
    /// φ in rad.
    pub phase: f64,
    /// V_1 in V that keeps it up.
    pub voltage: f64,
    /// The frequency of the drive.
    pub drive_hz: f64,
    /// F in 1/s.
    pub flow: [[f64; 2]; 2],
    /// g in 1/(s·V).
    pub by_voltage: [f64; 2],
    /// The phase at which the branch of large motions ends, at this V_1, in rad; `None` where it does not within a quarter
    /// turn.
    pub fold: Option<Fold>,
}

/// Where the branch of large motions turns back.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fold {
    /// φ there in rad.
    pub phase: f64,
    /// The drive's frequency there: with this V_1, a lower one leaves no large motion.
    pub drive_hz: f64,
}

/// How far a loop is from oscillating, with the other one closed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LoopMargins {
    /// The highest frequency in Hz at which the loop's gain is 1.
    pub crossover_hz: f64,
    /// What its phase lacks there to −180°, in rad.
    pub phase: f64,
    /// By how much its gain may grow before it oscillates; infinite where no growth in the band does it.
    pub gain: f64,
}

/// Halvings of an interval of voltages or phases.
const HALVINGS: u32 = 50;
/// Phases that are looked at for the fold, per turn.
const PHASES: u32 = 720;
/// Frequencies of the loops, per decade, and the first of them in Hz.
const PER_DECADE: u32 = 400;
const LOWEST_HZ: f64 = 0.1;
const DECADES: u32 = 5;

impl RegulatedMotion {
    /// The motion of this amplitude and phase, in rad, kept up by a voltage between these two; `None` where none of them
    /// does.
    pub fn of(
        scanner: &ParametricScanner<f64>,
        offset: f64,
        (amplitude, phase): (f64, f64),
        voltages: [f64; 2],
    ) -> Option<Self> {
        let reached = |volts: f64| {
            let motion = balance(scanner, offset, volts)?.motion_of(phase)?;
            Some(motion.amplitude)
        };
        let [mut low, mut high] = voltages;
        if reached(low).is_some_and(|at| at > amplitude) || reached(high)? < amplitude {
            return None;
        }
        for _ in 0..HALVINGS {
            let middle = low.midpoint(high);
            if reached(middle).is_none_or(|at| at < amplitude) { low = middle } else { high = middle }
        }
        let voltage = low.midpoint(high);
        let here = balance(scanner, offset, voltage)?;
        let rate = motion_rate(&here, amplitude, phase);
        let (small, turn) = (1e-4, 1e-4);
        let at = |amplitude: f64, phase: f64| slow(&here, rate, (amplitude, phase));
        let by = |ahead: [f64; 2], behind: [f64; 2], step: f64| {
            [0, 1].map(|i| (ahead[i] - behind[i]) / (2.0 * step))
        };
        let by_amplitude =
            by(at(amplitude * (1.0 + small), phase), at(amplitude * (1.0 - small), phase), small);
        let by_phase = by(at(amplitude, phase + turn), at(amplitude, phase - turn), turn);
        let volts = small * voltage;
        let of_volts = |volts: f64| Some(slow(&balance(scanner, offset, volts)?, rate, (amplitude, phase)));
        let by_voltage = by(of_volts(voltage + volts)?, of_volts(voltage - volts)?, volts);
        Some(Self {
            amplitude,
            phase,
            voltage,
            drive_hz: rate / PI,
            flow: [[by_amplitude[0], by_phase[0]], [by_amplitude[1], by_phase[1]]],
            by_voltage,
            fold: fold(&here, phase),
        })
    }

    /// Gains in V per rad and rad/s per rad that give each loop, taken alone, two poles at the wanted frequency in Hz:
    /// (s + ω)² = s² + (K_p·g − F_ii)·s + K_i·g. The first for the amplitude, the second for the phase.
    pub fn controllers(&self, amplitude_hz: f64, phase_hz: f64) -> [PiController<f64>; 2] {
        let of = |hz: f64, own: f64, per_output: f64| {
            let rate = TAU * hz;
            PiController {
                proportional: (2.0 * rate + own).max(0.0) / per_output,
                integral: rate * rate / per_output,
            }
        };
        [
            of(amplitude_hz, self.flow[0][0], self.by_voltage[0] * self.amplitude),
            of(phase_hz, self.flow[1][1], 1.0),
        ]
    }

    /// The margins of amplitude and phase loop, each cut with the other closed, behind a low-pass with this corner in rad/s
    /// and a delay in s.
    pub fn margins(
        &self,
        controllers: &[PiController<f64>; 2],
        smoothing_rate: f64,
        delay_s: f64,
    ) -> [LoopMargins; 2] {
        [0, 1]
            .map(|cut| margins_of(&|rate| self.open_loop(controllers, (smoothing_rate, delay_s), cut, rate)))
    }

    /// The loop of this number at ω in rad/s, the other closed.
    fn open_loop(
        &self,
        controllers: &[PiController<f64>; 2],
        (smoothing_rate, delay_s): (f64, f64),
        cut: usize,
        rate: f64,
    ) -> Complex<f64> {
        let (one, s) = (Complex::real(1.0), Complex { re: 0.0, im: rate });
        let minus = |x: f64| s + Complex::real(-x);
        let [[f00, f01], [f10, f11]] = self.flow;
        let [g0, g1] = self.by_voltage;
        let determinant = minus(f00) * minus(f11) + Complex::real(-f01 * f10);
        // What δV_1 and δω do to δA and δφ.
        let size = Complex::real(self.amplitude);
        let plant = [
            [
                size * (minus(f11) * Complex::real(g0) + Complex::real(f01 * g1)) / determinant,
                size * Complex::real(f01) / determinant,
            ],
            [
                (minus(f00) * Complex::real(g1) + Complex::real(f10 * g0)) / determinant,
                minus(f00) / determinant,
            ],
        ];
        let seen = Complex::turned(-rate * delay_s) / (one + Complex { re: 0.0, im: rate / smoothing_rate });
        let [own, other] = [cut, 1 - cut].map(|i| controllers[i].response(rate) * seen);
        let rest = 1 - cut;
        let around = plant[cut][rest] * other * plant[rest][cut] / (one + plant[rest][rest] * other);
        own * (plant[cut][cut] + Complex::real(-1.0) * around)
    }
}

/// The balance under a sine on an offset.
fn balance(scanner: &ParametricScanner<f64>, offset: f64, amplitude: f64) -> Option<Balance> {
    // The frequency says only which harmonic pumps: twice the motion.
    let resonator = &scanner.resonator;
    let stiffness = resonator.stiffness
        - 0.5 * scanner.comb.curvature_at_rest() * (offset * offset + 0.5 * amplitude * amplitude);
    let frequency_hz = Scalar::sqrt(stiffness / resonator.inertia) / PI;
    Balance::of(scanner, &Drive::Sine { offset, amplitude, frequency_hz, phase_rad: 0.0 })
}

/// ω_m in rad/s.
fn motion_rate(balance: &Balance, amplitude: f64, phase: f64) -> f64 {
    let resonator = &balance.scanner.resonator;
    let [in_phase, _] = balance.torque(&balance.shape(amplitude), phase);
    Scalar::sqrt((resonator.stiffness + balance.electrodes * in_phase) / resonator.inertia)
}

/// A′/A₀ for A/A₀ and φ′, at a drive of rate ω in rad/s.
fn slow(balance: &Balance, rate: f64, (amplitude, phase): (f64, f64)) -> [f64; 2] {
    let resonator = &balance.scanner.resonator;
    let [_, quadrature] = balance.torque(&balance.shape(amplitude), phase);
    let growth =
        (balance.electrodes * quadrature - resonator.damping * rate) / (2.0 * resonator.inertia * rate);
    [growth, rate - motion_rate(balance, amplitude, phase)]
}

/// The first phase below this one at which the branch is not stable any more at a constant frequency.
fn fold(balance: &Balance, from: f64) -> Option<Fold> {
    let step = TAU / f64::from(PHASES);
    let stable = |phase: f64| balance.motion_of(phase).is_some_and(|motion| motion.is_stable);
    let beyond = (1..PHASES / 4).map(|k| from - f64::from(k) * step).find(|phase| !stable(*phase))?;
    let (mut inside, mut outside) = (beyond + step, beyond);
    for _ in 0..HALVINGS {
        let middle = inside.midpoint(outside);
        if stable(middle) { inside = middle } else { outside = middle }
    }
    balance.motion_of(inside).map(|motion| Fold { phase: motion.phase, drive_hz: motion.drive_hz })
}

/// The margins of a loop by its response at ω in rad/s.
fn margins_of(open_loop: &dyn Fn(f64) -> Complex<f64>) -> LoopMargins {
    let count = PER_DECADE * DECADES;
    let hz = |k: u32| LOWEST_HZ * 10_f64.portable_powf(f64::from(k) / f64::from(PER_DECADE));
    let mut margins = LoopMargins { crossover_hz: f64::NAN, phase: f64::NAN, gain: f64::INFINITY };
    for k in 1..=count {
        let [before, after] = [hz(k - 1), hz(k)].map(|hz| open_loop(TAU * hz));
        if before.size() >= 1.0 && after.size() < 1.0 {
            margins.crossover_hz = hz(k);
            margins.phase = (after.angle() + PI).rem_euclid(TAU);
        }
        // Through the negative real axis from below: past −180°.
        if before.im < 0.0 && after.im >= 0.0 && after.re < 0.0 {
            margins.gain = margins.gain.min(1.0 / after.size());
        }
    }
    margins
}

#[cfg(test)]
mod tests {
    use super::super::Simulator;
    use super::*;
    use kalmems_models::capacitance::GaussianComb;
    use kalmems_models::dynamics::TorsionalResonator;

    const SCANNER: ParametricScanner<f64> = ParametricScanner {
        resonator: TorsionalResonator { inertia: 1.15e-14, damping: 5.95e-12, stiffness: 1.10e-4 },
        comb: GaussianComb { nominal: 5.71e-12, angular_width: 0.2, bias: 9.79e-12 },
        carrier_mean_square: 18.0,
    };

    /// Amplitude and phase of each cycle of the drive's phase, by projection of the integrated angle.
    fn cycles(voltage: f64, drive_hz: f64, start: [f64; 2], count: usize) -> Vec<[f64; 2]> {
        const STEPS: u32 = 128;
        let drive = Drive::Sine { offset: 90.0, amplitude: voltage, frequency_hz: drive_hz, phase_rad: 0.0 };
        let mut simulator = Simulator::new(SCANNER, drive, f64::from(STEPS) * drive_hz / 2.0, start);
        (0..count)
            .map(|_| {
                let (mut cosine, mut sine) = (0.0, 0.0);
                for k in 0..STEPS {
                    let alpha = TAU * f64::from(k) / f64::from(STEPS);
                    let [angle, _] = *simulator.state();
                    cosine += angle * alpha.cos() * 2.0 / f64::from(STEPS);
                    sine += angle * alpha.sin() * 2.0 / f64::from(STEPS);
                    simulator.step();
                }
                [cosine.hypot(sine), (sine / cosine).atan()]
            })
            .collect()
    }

    /// Held at the voltage and frequency that it says, the integrated device has amplitude and phase that it says; and
    /// after a small step of the voltage, or of the frequency, it moves as the linearised equations do.
    #[test]
    fn the_integrated_device_answers_as_the_linearised_one() {
        for (amplitude, phase) in [(0.19, 0.0), (0.16, 0.15), (0.21, -0.08)] {
            let motion = RegulatedMotion::of(&SCANNER, 90.0, (amplitude, phase), [20.0, 120.0]).unwrap();
            let rate = PI * motion.drive_hz;
            let start = [amplitude * phase.cos(), amplitude * rate * phase.sin()];
            let settled = cycles(motion.voltage, motion.drive_hz, start, 1500);
            let [a, p] = settled[1499];
            assert!((a / amplitude - 1.0).abs() < 4e-3, "{a} {amplitude}");
            assert!((p - phase).abs() < 6e-3, "{p} {phase}");

            for (volts, hz) in [(0.3, 0.0), (0.0, 0.3)] {
                let stepped = cycles(motion.voltage + volts, motion.drive_hz + hz, start, 160);
                let still = cycles(motion.voltage, motion.drive_hz, start, 160);
                // The linear equations by small steps.
                let [[f00, f01], [f10, f11]] = motion.flow;
                let (dt, per_cycle) = (2.0 / motion.drive_hz / 50.0, 50);
                let (mut x, mut largest) = ([0.0; 2], [0.0_f64; 2]);
                let mut off = [0.0_f64; 2];
                for cycle in 0..160 {
                    let seen = [
                        (stepped[cycle][0] - still[cycle][0]) / amplitude,
                        stepped[cycle][1] - still[cycle][1],
                    ];
                    for i in 0..2 {
                        // The projection is about the middle of the cycle.
                        largest[i] = largest[i].max(seen[i].abs());
                        off[i] = off[i].max((seen[i] - x[i]).abs());
                    }
                    for _ in 0..per_cycle {
                        let u = [motion.by_voltage[0] * volts, motion.by_voltage[1] * volts + PI * hz];
                        x = [
                            x[0] + dt * (f00 * x[0] + f01 * x[1] + u[0]),
                            x[1] + dt * (f10 * x[0] + f11 * x[1] + u[1]),
                        ];
                    }
                }
                assert!(
                    off[0] < 0.06 * largest[0].max(0.3 * largest[1]),
                    "{volts} {hz}: {off:?} {largest:?}"
                );
                assert!(
                    off[1] < 0.06 * largest[1].max(0.3 * largest[0]),
                    "{volts} {hz}: {off:?} {largest:?}"
                );
            }
        }
    }

    /// The fold is where sweeping down the integrated device falls to rest.
    #[test]
    fn below_the_fold_the_device_falls_to_rest() {
        let motion = RegulatedMotion::of(&SCANNER, 90.0, (0.19, 0.0), [20.0, 120.0]).unwrap();
        let fold = motion.fold.unwrap();
        assert!(fold.phase < -0.15 && fold.phase > -0.3, "{fold:?}");
        let hz: Vec<f64> =
            (0..1000).map(|k| motion.drive_hz - f64::from(k)).take_while(|hz| *hz > 31_215.0).collect();
        let settings = super::super::SweepSettings {
            offset: 90.0,
            amplitude: motion.voltage,
            periods: 3000,
            steps_per_period: 40,
            disturbance: 1e-5,
        };
        // From the motion itself, step by step down.
        let from_above: Vec<f64> = (0..40).rev().map(|k| motion.drive_hz + 5.0 * f64::from(k)).collect();
        let sweep = super::super::stepped_sweep(SCANNER, from_above.into_iter().chain(hz), &settings);
        let last =
            sweep.iter().filter(|point| point.amplitude > 0.1).map(|p| p.drive_hz).fold(f64::MAX, f64::min);
        assert!((last - fold.drive_hz).abs() < 2.5, "{last} {fold:?}");
    }

    /// Without coupling and delay the loop is (K_p + K_i/s)·g/(s − F): margins by hand.
    #[test]
    fn margins_of_a_loop_that_is_known() {
        let motion = RegulatedMotion {
            amplitude: 0.2,
            phase: 0.0,
            voltage: 70.0,
            drive_hz: 31e3,
            flow: [[-200.0, 0.0], [0.0, -300.0]],
            by_voltage: [4.0, 0.0],
            fold: None,
        };
        let controllers = motion.controllers(50.0, 100.0);
        let [amplitude, phase] = motion.margins(&controllers, 1e9, 0.0);
        for (margins, hz, own) in [(amplitude, 50.0, 200.0), (phase, 100.0, 300.0)] {
            let (w, p) = (TAU * hz, 2.0 * TAU * hz - own);
            // |p·jω + w²| = |jω|·|jω + own|: a quadratic in ω².
            let b = own * own - p * p;
            let square = 0.5 * (-b + (b * b + 4.0 * w.powi(4)).sqrt());
            let crossover = square.sqrt();
            let angle = (p * crossover).atan2(w * w) - PI / 2.0 - crossover.atan2(own);
            assert!((margins.crossover_hz * TAU / crossover - 1.0).abs() < 0.01);
            assert!((margins.phase - (PI + angle)).abs() < 0.01, "{margins:?} {angle}");
            assert_eq!(margins.gain, f64::INFINITY);
        }
        // A delay of τ takes τ·ω from the phase; twice the crossover's reach makes a gain margin.
        let [_, late] = motion.margins(&controllers, 1e9, 1e-4);
        assert!((phase.phase - late.phase - 1e-4 * TAU * phase.crossover_hz).abs() < 0.01);
        assert!(late.gain.is_finite() && late.gain > 1.0);
    }
}
