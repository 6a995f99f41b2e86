//! What the demodulated signal can tell of a steady motion, and what it cannot.

use kalmems_core::{Measurement, Scalar};
use kalmems_models::readout::DemodulatedComb;
use std::f64::consts::TAU;

/// Bounds on what samples of θ = A·cos(ωt − φ) tell, for white noise and no other knowledge of the motion.
///
/// Fisher's information of y = a·C(θ) + b in (A, φ, a, b), for samples spread evenly over whole cycles. φ stands alone:
/// its derivative is odd about the turning points and the others are even. A, a and b do not: C(A·cos ωt) is nearly a
/// constant and cos 2ωt, whose size A²·a alone decides, until the Gaussian's higher terms tell A from a.
///
/// The sign of A and half a turn of φ are not observable at any amplitude: y is even in θ.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CycleBound {
    /// The standard deviation of φ in rad.
    pub phase_sd: f64,
    /// That of A in rad, gain and offset known.
    pub amplitude_sd: f64,
    /// That of A in rad, gain and offset estimated beside it.
    pub amplitude_sd_free: f64,
    /// By how many rad a wrong gain moves A, per relative error of the gain, where gain and offset are held.
    pub amplitude_per_gain_error: f64,
}

/// Points of a cycle over which averages are taken.
const POINTS: u32 = 256;

impl CycleBound {
    /// From a number of samples, each with this variance in V².
    ///
    /// ```
    /// use kalmems_rigs::shared_scanner::CycleBound;
    /// use kalmems_models::{capacitance::GaussianComb, readout::DemodulatedComb};
    /// let comb = GaussianComb { nominal: 5.71e-12, angular_width: 0.2, bias: 9.79e-12 };
    /// let readout = DemodulatedComb { comb, gain: -0.3574e12, offset: 6.3945 };
    /// // A millisecond at 1 MHz and 9 degrees: the phase to 0.037 degrees.
    /// let bound = CycleBound::of(&readout, 1.92e-4, 9_f64.to_radians(), 1000.0);
    /// assert!((bound.phase_sd.to_degrees() - 0.037).abs() < 1e-3);
    /// ```
    pub fn of(readout: &DemodulatedComb<f64>, variance: f64, amplitude: f64, samples: f64) -> Self {
        // Means over a cycle: of g = dy/dA, C, their squares and product, and (dy/dφ)².
        let (mut g, mut c, mut gg, mut cc, mut gc, mut pp) = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0);
        for k in 0..POINTS {
            let angle = TAU * f64::from(k) / f64::from(POINTS);
            let (sine, cosine) = (Scalar::sin(angle), Scalar::cos(angle));
            let theta = amplitude * cosine;
            let (_, jacobian) = readout.linearize(&[theta]);
            let slope = jacobian.0[0][0];
            // In units of the capacitance at rest, so that nothing under- or overflows.
            let capacitance = readout.comb.capacitance(theta) / readout.comb.capacitance(0.0);
            let (by_amplitude, by_phase) = (slope * cosine, slope * amplitude * sine);
            let share = 1.0 / f64::from(POINTS);
            g += share * by_amplitude;
            c += share * capacitance;
            gg += share * by_amplitude * by_amplitude;
            cc += share * capacitance * capacitance;
            gc += share * by_amplitude * capacitance;
            pp += share * by_phase * by_phase;
        }
        // What is left of g beside a constant and C.
        let left = (gg - g * g) - (gc - g * c).powi(2) / (cc - c * c);
        let sd = |information: f64| (variance / (samples * information)).sqrt();
        let full_scale = readout.gain * readout.comb.capacitance(0.0);
        Self {
            phase_sd: sd(pp),
            amplitude_sd: sd(gg),
            amplitude_sd_free: sd(left),
            amplitude_per_gain_error: full_scale * gc / gg,
        }
    }

    /// How many times as large the amplitude's standard deviation becomes where gain and offset are freed.
    pub fn cost_of_freeing(&self) -> f64 {
        self.amplitude_sd_free / self.amplitude_sd
    }

    /// The relative error of the gain above which freeing gain and offset makes A better than holding them.
    pub fn worthwhile_gain_error(&self) -> f64 {
        let more = self.amplitude_sd_free.powi(2) - self.amplitude_sd.powi(2);
        more.max(0.0).sqrt() / self.amplitude_per_gain_error.abs()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;
    use kalmems_core::Mat;
    use kalmems_models::capacitance::GaussianComb;

    const READOUT: DemodulatedComb<f64> = DemodulatedComb {
        comb: GaussianComb { nominal: 5.71e-12, angular_width: 0.2, bias: 9.79e-12 },
        gain: -0.3574e12,
        offset: 6.3945,
    };

    /// Found before for this device, by others: at 9° 0.148° per cycle and 0.037° per ms; freed gain and offset cost 46, 18 and
    /// 5 at 6°, 9° and 15°, which are whole numbers without what follows the point.
    #[test]
    fn the_bounds_are_the_known_ones() {
        let at =
            |degrees: f64, samples: f64| CycleBound::of(&READOUT, 1.92e-4, degrees.to_radians(), samples);
        let per_cycle = at(9.0, 1e6 / 15_675.0).phase_sd.to_degrees();
        assert!((per_cycle - 0.148).abs() < 0.0015, "{per_cycle}");
        assert!((at(9.0, 1000.0).phase_sd.to_degrees() - 0.037).abs() < 0.0005);
        for (degrees, cost) in [(6.0, 46.0), (9.0, 18.0), (15.0, 5.0)] {
            let ours = at(degrees, 1.0).cost_of_freeing();
            println!("{degrees} deg: {ours:.2} times");
            assert!(ours.floor() == cost, "{degrees}: {ours}");
        }
    }

    /// The whole information matrix of (A, φ, a, b) from differences of the signal at the samples of 4 ms, inverted.
    #[test]
    fn the_bounds_are_those_of_the_whole_matrix() {
        let (variance, samples) = (1.92e-4, 4000);
        for degrees in [4.0_f64, 9.0, 14.0] {
            let amplitude = degrees.to_radians();
            let signal = |p: [f64; 4], t: f64| {
                let theta = p[0] * (TAU * 15_675.0 * t - p[1]).cos();
                p[2] * READOUT.gain * READOUT.comb.capacitance(theta) + p[3]
            };
            let here = [amplitude, 0.4, 1.0, READOUT.offset];
            let mut information = Mat::<f64, 4, 4>::zero();
            for k in 0..samples {
                let t = f64::from(k) * 1e-6;
                let by = [0, 1, 2, 3].map(|i| {
                    let (mut up, mut down) = (here, here);
                    up[i] += 1e-5;
                    down[i] -= 1e-5;
                    (signal(up, t) - signal(down, t)) / 2e-5
                });
                for i in 0..4 {
                    for j in 0..4 {
                        information.0[i][j] += by[i] * by[j] / variance;
                    }
                }
            }
            let inverse = inverse(information);
            let bound = CycleBound::of(&READOUT, variance, amplitude, f64::from(samples));
            assert_relative_eq!(bound.amplitude_sd_free, inverse[0][0].sqrt(), max_relative = 0.01);
            assert_relative_eq!(bound.phase_sd, inverse[1][1].sqrt(), max_relative = 0.01);
            assert_relative_eq!(bound.amplitude_sd, information.0[0][0].powf(-0.5), max_relative = 0.01);
            // A gain of 1 % too much, gain and offset held: the least-squares step in A.
            let step = 0.01 * information.0[0][2] / information.0[0][0];
            assert_relative_eq!(0.01 * bound.amplitude_per_gain_error, step, max_relative = 0.01);
        }
    }

    /// By Gauss and Jordan's elimination.
    fn inverse(Mat(mut a): Mat<f64, 4, 4>) -> [[f64; 4]; 4] {
        let mut b = Mat::<f64, 4, 4>::identity().0;
        for k in 0..4 {
            let pivot = a[k][k];
            for j in 0..4 {
                a[k][j] /= pivot;
                b[k][j] /= pivot;
            }
            for i in (0..4).filter(|i| *i != k) {
                let factor = a[i][k];
                for j in 0..4 {
                    a[i][j] -= factor * a[k][j];
                    b[i][j] -= factor * b[k][j];
                }
            }
        }
        b
    }
}
