//! Steady motions of a parametric scanner by harmonic balance: without integration, and the unstable ones too.

use super::{Drive, Stability};
use kalmems_core::Scalar;
use kalmems_models::dynamics::ParametricScanner;
use serde::Serialize;
use std::f64::consts::{PI, TAU};

/// A steady motion A·cos(ωt − φ) under a drive at phase 0.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct SteadyMotion {
    /// The frequency of the drive.
    pub drive_hz: f64,
    /// A in rad.
    pub amplitude: f64,
    /// φ in rad; φ + π is the same motion with the other sign.
    pub phase: f64,
    /// Whether the motion returns to it after a small disturbance.
    pub is_stable: bool,
}

/// The balance of the motion's fundamental.
///
/// With θ = A·cos ψ, ψ = ωt − φ, the electrodes' torque is −κ·V²(t)·F(ψ), κ = C₀/θ₀² and
/// F = A·cos ψ·exp(−(A/θ₀)²·cos²ψ) = A·Σ F_j·cos jψ over odd j. V² = M + Σ a_l·cos 2lωt + b_l·sin 2lωt, where l counts
/// the harmonics of the one that pumps; the others make no torque at ω. What F and V² make together at ω is
/// A·(C·cos ψ + S·sin ψ) with
///
/// C = M·F₁ + Σ ½·(F_{2l−1} + F_{2l+1})·(a_l·cos 2lφ + b_l·sin 2lφ),
///
/// S = Σ ½·(F_{2l−1} − F_{2l+1})·(b_l·cos 2lφ − a_l·sin 2lφ),
///
/// and a motion is steady where J·ω² = k + κ·C and b·ω = κ·S. The F_j are Bessel functions of z = A²/(2θ₀²):
/// F_{2n+1} = (−1)ⁿ·e^{−z}·(I_n(z) − I_{n+1}(z)). Harmonics of the motion itself are left out: they are smaller by about the
/// pump depth over 8 (Nayfeh and Mook, Nonlinear Oscillations, 1979, section 2.3.4, for the method).
///
/// ```
/// use kalmems_engines::simulate::{Balance, Drive};
/// use kalmems_models::{capacitance::GaussianComb, dynamics::{ParametricScanner, TorsionalResonator}};
/// let scanner = ParametricScanner {
///     resonator: TorsionalResonator { inertia: 1.15e-14, damping: 5.95e-12, stiffness: 1.10e-4 },
///     comb: GaussianComb { nominal: 5.71e-12, angular_width: 0.2, bias: 9.79e-12 },
///     carrier_mean_square: 18.0,
/// };
/// let drive = Drive::Sine { offset: 90.0, amplitude: 90.0, frequency_hz: 31_350.0, phase_rad: 0.0 };
/// let motions = Balance::of(&scanner, &drive).unwrap().motions_at(31_350.0);
/// assert!(motions.len() == 1 && motions[0].is_stable);
/// assert!((motions[0].amplitude.to_degrees() - 8.9).abs() < 0.05);
/// ```
#[derive(Clone, Debug)]
pub struct Balance {
    pub(super) scanner: ParametricScanner<f64>,
    /// κ.
    pub(super) electrodes: f64,
    /// M in V², with the carrier's share.
    mean: f64,
    /// a_l and b_l in V², from l = 1.
    harmonics: [[f64; 2]; HARMONICS],
    /// cos jψ at the points of a cycle, j = 1, 3, ….
    cosines: Vec<[f64; HARMONICS + 1]>,
    /// The harmonic of the drive that pumps.
    pumping: u32,
}

/// Harmonics of the pump that count: F_j falls as z^{(j−1)/2}/((j−1)/2)! for small motions.
const HARMONICS: usize = 6;
/// Points of a cycle over which averages are taken. They are exact up to the harmonic of this number.
const POINTS: u32 = 64;
/// Phases of a [`curve`](Balance::curve) on either side of the best.
const PHASES: u32 = 120;
/// No motion is larger than this many widths of the comb: what is left of its pull there is below 1e-7 of that at rest.
const WIDTHS: f64 = 4.0;
/// Halvings of an interval that contains a root.
const HALVINGS: u32 = 50;

fn cosines(point: u32) -> [f64; HARMONICS + 1] {
    let angle = TAU * f64::from(point) / f64::from(POINTS);
    let mut odd = 1.0;
    [(); HARMONICS + 1].map(|()| {
        let cosine = Scalar::cos(odd * angle);
        odd += 2.0;
        cosine
    })
}

impl Balance {
    /// The balance for a drive; `None` where it does not repeat, or where nothing in its square pumps.
    pub fn of(scanner: &ParametricScanner<f64>, drive: &Drive) -> Option<Self> {
        let stability = Stability::of(scanner, drive)?;
        let mut harmonics = [[0.0; 2]; HARMONICS];
        for (l, components) in (1..).zip(&mut harmonics) {
            *components = drive.square_harmonic(stability.harmonic * l)?;
        }
        (stability.pump_depth > 0.0).then_some(Self {
            scanner: *scanner,
            electrodes: -0.5 * scanner.comb.curvature_at_rest(),
            mean: drive.square(1)?.0 + scanner.carrier_mean_square,
            harmonics,
            cosines: (0..POINTS).map(cosines).collect(),
            pumping: stability.harmonic,
        })
    }

    /// F₁, F₃, …, by the mean over a cycle.
    pub(super) fn shape(&self, amplitude: f64) -> [f64; HARMONICS + 1] {
        let mut shape = [0.0; HARMONICS + 1];
        for odd in &self.cosines {
            let pull = odd[0] * self.scanner.comb.overlap(amplitude * odd[0]) * (2.0 / f64::from(POINTS));
            for (of_harmonic, cosine) in shape.iter_mut().zip(odd) {
                *of_harmonic += pull * cosine;
            }
        }
        shape
    }

    /// C and S in V².
    pub(super) fn torque(&self, shape: &[f64; HARMONICS + 1], phase: f64) -> [f64; 2] {
        let (mut in_phase, mut quadrature) = (self.mean * shape[0], 0.0);
        for (l, ([a, b], pair)) in (1..).zip(self.harmonics.iter().zip(shape.windows(2))) {
            let angle = 2.0 * f64::from(l) * phase;
            let (sine, cosine) = (Scalar::sin(angle), Scalar::cos(angle));
            in_phase += 0.5 * (pair[0] + pair[1]) * (a * cosine + b * sine);
            quadrature += 0.5 * (pair[0] - pair[1]) * (b * cosine - a * sine);
        }
        [in_phase, quadrature]
    }

    /// ω at which torque and inertia balance.
    fn rate(&self, in_phase: f64) -> f64 {
        let resonator = &self.scanner.resonator;
        ((resonator.stiffness + self.electrodes * in_phase) / resonator.inertia).sqrt()
    }

    /// How much more torque in quadrature there is than the damping takes, per amplitude, in N·m/rad.
    fn surplus(&self, shape: &[f64; HARMONICS + 1], phase: f64) -> f64 {
        let [in_phase, quadrature] = self.torque(shape, phase);
        self.electrodes * quadrature - self.scanner.resonator.damping * self.rate(in_phase)
    }

    /// The steady motion of one phase, whose amplitude is that at which the pump gives what the damping takes; `None`
    /// where it gives less even to the smallest.
    ///
    /// By phase every motion is met once. By amplitude some are met twice: past its largest amplitude the curve goes
    /// on, still stable, to its lowest frequency.
    pub(super) fn motion_of(&self, phase: f64) -> Option<SteadyMotion> {
        if self.surplus(&self.shape(0.0), phase) <= 0.0 {
            return None;
        }
        let (mut below, mut above) = (0.0_f64, WIDTHS * self.scanner.comb.angular_width);
        for _ in 0..HALVINGS {
            let middle = below.midpoint(above);
            if self.surplus(&self.shape(middle), phase) > 0.0 { below = middle } else { above = middle }
        }
        let rate = self.rate(self.torque(&self.shape(below), phase)[0]);
        Some(SteadyMotion {
            drive_hz: 2.0 * rate / (TAU * f64::from(self.pumping)),
            amplitude: below,
            phase,
            is_stable: self.is_stable(below, phase),
        })
    }

    /// By the equations of slow change, A′ = A·(κ·S − b·ω)/(2Jω) and φ′ = (J·ω² − k − κ·C)/(2Jω): whether the matrix
    /// of their derivatives has both eigenvalues on the left.
    fn is_stable(&self, amplitude: f64, phase: f64) -> bool {
        let (small, turn) = (1e-4 * self.scanner.comb.angular_width, 1e-4);
        let slope =
            |ahead: [f64; 2], behind: [f64; 2], by: f64| [0, 1].map(|i| (ahead[i] - behind[i]) / (2.0 * by));
        let at = |amplitude: f64| self.torque(&self.shape(amplitude), phase);
        let [c_by_amplitude, s_by_amplitude] = slope(at(amplitude + small), at(amplitude - small), small);
        let shape = self.shape(amplitude);
        let [c_by_phase, s_by_phase] =
            slope(self.torque(&shape, phase + turn), self.torque(&shape, phase - turn), turn);
        let trace = amplitude * s_by_amplitude - c_by_phase;
        let determinant = amplitude * (s_by_phase * c_by_amplitude - s_by_amplitude * c_by_phase);
        trace < 0.0 && determinant > 0.0
    }

    /// All steady motions in the order of their phase: from the smallest at one edge of the tongue over the largest
    /// to the smallest at the other. Empty where the pump keeps up no motion at all.
    pub fn curve(&self) -> Vec<SteadyMotion> {
        let rest = self.shape(0.0);
        let phases = (0..PHASES).map(|k| PI * f64::from(k) / f64::from(PHASES));
        let surplus = |phase: &f64| self.surplus(&rest, *phase);
        let best = phases.max_by(|a, b| surplus(a).total_cmp(&surplus(b))).unwrap_or(0.0);
        let mut curve = Vec::new();
        if surplus(&best) <= 0.0 {
            return curve;
        }
        for side in [-1.0, 1.0] {
            // The edge of the tongue, where the amplitude is 0, lies less than a quarter of a turn from the best.
            let (mut inside, mut outside) = (best, best + side * 0.5 * PI);
            for _ in 0..HALVINGS {
                let middle = inside.midpoint(outside);
                if surplus(&middle) > 0.0 { inside = middle } else { outside = middle }
            }
            // The amplitude falls to the edge as a root: closer phases there.
            let phase =
                |k: u32| best + (inside - best) * Scalar::sin(0.5 * PI * f64::from(k) / f64::from(PHASES));
            let mut half: Vec<SteadyMotion> =
                (0..PHASES).map(phase).chain([inside]).filter_map(|phase| self.motion_of(phase)).collect();
            if side < 0.0 {
                half.reverse();
                // The best phase comes with the other side.
                half.pop();
            }
            curve.extend(half);
        }
        curve
    }

    /// The steady motions at one frequency of the drive, the largest last.
    pub fn motions_at(&self, drive_hz: f64) -> Vec<SteadyMotion> {
        let mut found = Vec::new();
        for pair in self.curve().windows(2) {
            let [a, b] = pair else { continue };
            let is_below = |motion: &SteadyMotion| motion.drive_hz < drive_hz;
            if is_below(a) == is_below(b) {
                continue;
            }
            let (mut start, mut end) = (*a, *b);
            for _ in 0..HALVINGS {
                let Some(middle) = self.motion_of(start.phase.midpoint(end.phase)) else { break };
                if is_below(&middle) == is_below(&start) { start = middle } else { end = middle }
            }
            found.push(start);
        }
        found.sort_by(|a, b| a.amplitude.total_cmp(&b.amplitude));
        found
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;
    use kalmems_models::capacitance::GaussianComb;
    use kalmems_models::dynamics::TorsionalResonator;

    const SCANNER: ParametricScanner<f64> = ParametricScanner {
        resonator: TorsionalResonator { inertia: 1.15e-14, damping: 5.95e-12, stiffness: 1.10e-4 },
        comb: GaussianComb { nominal: 5.71e-12, angular_width: 0.2, bias: 9.79e-12 },
        carrier_mean_square: 18.0,
    };

    /// I_n(z) by its series, (z/2)ⁿ/n!·(1 + (z²/4)/(1·(n+1)) + …).
    fn bessel(n: i32, z: f64) -> f64 {
        let mut term = (1..=n).fold(1.0, |p, k| p * 0.5 * z / f64::from(k));
        let mut sum = term;
        for k in 1..60 {
            term *= 0.25 * z * z / f64::from(k * (k + n));
            sum += term;
        }
        sum
    }

    #[test]
    fn averages_over_the_comb_are_bessel_functions() {
        let drive = Drive::Sine { offset: 90.0, amplitude: 90.0, frequency_hz: 31e3, phase_rad: 0.0 };
        let balance = Balance::of(&SCANNER, &drive).unwrap();
        // A tabulated one first: I_1(1).
        assert_relative_eq!(bessel(1, 1.0), 0.565_159_103_992_485, max_relative = 1e-14);
        for amplitude in [0.01, 0.1, 0.25, 0.5] {
            let z = 0.5 * (amplitude / 0.2_f64).powi(2);
            for (n, ours) in (0..).zip(balance.shape(amplitude)) {
                let sign = if n % 2 == 0 { 1.0 } else { -1.0 };
                let exact = sign * (-z).exp() * (bessel(n, z) - bessel(n + 1, z));
                assert_relative_eq!(ours, exact, epsilon = 1e-14);
            }
        }
    }

    /// In-phase and quadrature parts by projecting the torque itself over a cycle.
    #[test]
    fn the_torque_is_what_the_fundamental_of_the_product_is() {
        for drive in [
            Drive::Sine { offset: 70.0, amplitude: 90.0, frequency_hz: 31_350.0, phase_rad: 0.0 },
            Drive::Sine { offset: 0.0, amplitude: 150.0, frequency_hz: 15_700.0, phase_rad: 0.0 },
        ] {
            let balance = Balance::of(&SCANNER, &drive).unwrap();
            let (amplitude, phase) = (0.2, 0.7);
            let omega =
                0.5 * TAU * f64::from(balance.pumping) * drive.held_at(1.0).unwrap().period_s().unwrap();
            let (mut c, mut s) = (0.0, 0.0);
            let points = 4096;
            // Two periods of the drive hold at least one of the motion.
            for k in 0..points {
                let t = 2.0 * f64::from(k) / f64::from(points);
                let psi = omega * t - phase;
                let volts = drive.held_at(1.0).unwrap().at(t);
                let f = psi.cos() * SCANNER.comb.overlap(amplitude * psi.cos()) * (volts * volts + 18.0);
                c += 2.0 * f * psi.cos() / f64::from(points);
                s += 2.0 * f * psi.sin() / f64::from(points);
            }
            let [in_phase, quadrature] = balance.torque(&balance.shape(amplitude), phase);
            assert_relative_eq!(in_phase, c, max_relative = 1e-9);
            assert_relative_eq!(quadrature, s, max_relative = 1e-9);
        }
    }
}
