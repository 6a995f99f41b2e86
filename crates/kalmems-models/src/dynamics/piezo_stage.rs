//! A stage on piezoelectric beams near one of its resonances.

use super::MirrorResonator;
use kalmems_core::{Dynamics, LinearProcess, Mat, NoiseDensity, Over, Scalar};
use kalmems_macros::{Parameters, model};

/// θ̈ + 2ζω_n·θ̇ + ω_n²·θ = b_c·V, states [θ, θ̇], input V in V (Chen, dissertation, 2018, equations 31 to 33).
///
/// The table of the dissertation calls b_c a DC gain; that is b_c/ω_n², and b_c is an angular acceleration per volt. The
/// same law with m in place of rad is that of the piston mode.
///
/// ```
/// use kalmems_models::dynamics::{MirrorResonator, PiezoStage};
/// let resonator = MirrorResonator { natural_rate: std::f64::consts::TAU * 1714.5, damping_ratio: 0.005 };
/// let stage = PiezoStage { resonator, drive_gain: 3782.5_f64 };
/// // At resonance the angle is a quarter of a cycle late, and 1/(2ζ) times the static one.
/// let (re, im) = stage.response(resonator.natural_rate);
/// assert!(re.abs() < 1e-16 && (im * resonator.natural_rate.powi(2) / 3782.5 + 100.0).abs() < 1e-9);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Parameters)]
pub struct PiezoStage<P> {
    /// ω_n and ζ.
    pub resonator: MirrorResonator<P>,
    /// b_c in rad/s²/V.
    pub drive_gain: P,
}

#[model]
impl<P: Scalar> PiezoStage<P> {
    /// θ per V of a steady drive at ω in rad/s, b_c/(ω_n² − ω² + 2jζω_n·ω): real and imaginary part in rad/V.
    pub fn response(&self, rate: P) -> (P, P) {
        let natural = self.resonator.natural_rate;
        let stiff = natural.sq() - rate.sq();
        let lossy = (self.resonator.damping_ratio * natural * rate).twice();
        let scale = self.drive_gain / (stiff.sq() + lossy.sq());
        (scale * stiff, -(scale * lossy))
    }

    /// B of ẋ = A·x + B·V.
    pub fn input_matrix(&self) -> Mat<P, 2, 1> {
        Mat([[P::of(0.0)], [self.drive_gain]])
    }
}

impl<P: Scalar> PiezoStage<P> {
    /// The exact step over an interval under a drive held over it, and white angular acceleration of this density in
    /// rad²/s³.
    ///
    /// Give the mean of the drive at both ends where it is a sampled sine: the later sample alone, as equation 34 has it,
    /// is half an interval late, 8.5 mrad at 1700 Hz and 625 kHz. The dissertation's process noise is a variance Q of the
    /// drive per sample (equation 49); as a density it is b_c²·Q·T.
    pub fn exact(&self, interval: P, acceleration_density: P) -> LinearProcess<P, 2, 1> {
        let noise = NoiseDensity::none().on::<1>(acceleration_density);
        LinearProcess::exact(&self.resonator.system_matrix(), &self.input_matrix(), &noise, interval)
    }
}

/// For what [`PiezoStage::exact`] does not do: parameters as states, and other integrators.
#[model(parametric)]
impl<T: Scalar> Dynamics<T, 2> for PiezoStage<T> {
    type Input = T;

    fn bends(i: usize) -> bool {
        i != 0
    }

    fn derivative<S: Over<T>>(&self, x: &[S; 2], voltage: &T) -> [S; 2] {
        [x[1], self.resonator.acceleration(x[0], x[1], S::lift(*voltage * self.drive_gain))]
    }

    /// Those of its resonator.
    fn natural_scales(&self) -> [T; 2] {
        self.resonator.natural_scales()
    }
}

/// The stage tilting, and rising and falling as a piston, under one drive: states [θ, θ̇, z, ż].
///
/// The piston mode (1002 Hz for the published stage) is a disturbance of what the tilt is read from: the gap is D_n − z.
#[derive(Clone, Copy, Debug, PartialEq, Parameters)]
pub struct TiltAndPiston<P> {
    /// θ in rad.
    pub tilt: PiezoStage<P>,
    /// z in m, with b_c in m/s²/V.
    pub piston: PiezoStage<P>,
}

impl<P: Scalar> TiltAndPiston<P> {
    /// The exact step over an interval under a drive held over it, without noise.
    pub fn exact(&self, interval: P) -> LinearProcess<P, 4, 1> {
        let (tilt, piston) = (self.tilt.resonator.system_matrix(), self.piston.resonator.system_matrix());
        let zero = P::of(0.0);
        let ([t0, t1], [p0, p1]) = (tilt.0, piston.0);
        let system = Mat([
            [t0[0], t0[1], zero, zero],
            [t1[0], t1[1], zero, zero],
            [zero, zero, p0[0], p0[1]],
            [zero, zero, p1[0], p1[1]],
        ]);
        let input = Mat([[zero], [self.tilt.drive_gain], [zero], [self.piston.drive_gain]]);
        LinearProcess::exact(&system, &input, &NoiseDensity::none(), interval)
    }
}
