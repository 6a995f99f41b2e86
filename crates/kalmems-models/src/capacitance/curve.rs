//! The curve of a comb that senses where it is passed.

use kalmems_core::{Over, Scalar};
use kalmems_macros::{Parameters, model};

/// The form of a [`CombCurve`], over u = N_θ·(θ − θ_c).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CurveShape {
    /// s(u) = 1/(1 + e^{−u}) − ½, which goes from −½ to ½ (Chen, dissertation, 2018, equation 74, over θ − θ_c).
    Logistic,
    /// s(u) = u·e^{−u²}, the slope of a Gaussian capacitance: fingers that leave each other altogether.
    Gaussian,
}

/// h(θ) = N_g·s(N_θ·(θ − θ_c)) in V·s/rad: what a comb under constant bias gives per angular rate, behind a
/// transimpedance stage.
///
/// The stage inverts, h = −R_s·V_bias·dC/dθ (Chen, dissertation, 2018, equation 71), so that with N_g > 0 the
/// capacitance has its peak at θ_c: the signal h(θ)·θ̇ rises whenever θ_c is passed, in either direction. From the same
/// curve follow dC/dθ = −h/(R_s·V_bias) and C(θ) = C(θ_c) − ∫h dθ/(R_s·V_bias), taken from θ_c to θ (equations 73 and
/// 75 with the limits and the sign that make them consistent).
///
/// ```
/// use kalmems_models::capacitance::{CombCurve, CurveShape};
/// let curve = CombCurve { centre: 0.0037, gain: 2.82e-3, steepness: 76.0, shape: CurveShape::Logistic };
/// // Far from the centre half of N_g, at the centre nothing.
/// assert!((curve.sensitivity(0.5) - 1.41e-3_f64).abs() < 1e-15);
/// assert_eq!(curve.sensitivity(0.0037), 0.0);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Parameters)]
pub struct CombCurve<P> {
    /// θ_c in rad: where the capacitance has its extreme. Of a comb in its frame it is the threshold angle.
    pub centre: P,
    /// N_g in V·s/rad; negative behind a stage that does not invert.
    pub gain: P,
    /// N_θ in 1/rad. Positive.
    pub steepness: P,
    /// s(u).
    #[parameters(fixed)]
    pub shape: CurveShape,
}

#[model]
impl<P: Scalar> CombCurve<P> {
    /// h(θ) in V·s/rad, θ in rad.
    pub fn sensitivity<S: Over<P>>(&self, angle: S) -> S {
        self.form(angle) * self.gain
    }

    /// s(N_θ·(θ − θ_c)), a ratio.
    pub fn form<S: Over<P>>(&self, angle: S) -> S {
        let angle_alone = angle.alone();
        let u = (angle_alone - self.centre) * self.steepness;
        angle.chained(match self.shape {
            CurveShape::Logistic => {
                // With e^{−|u|}, which cannot overflow.
                let zero = P::of(0.0);
                let left = (-u.abs()).exp();
                let one = left * zero + P::of(1.0);
                let half = ((one - left) / (one + left)).half();
                Scalar::select(u.value().lt(zero), -half, half)
            }
            CurveShape::Gaussian => u * (-u.sq()).exp(),
        })
    }

    /// dC/dθ = −h(θ)/(R_s·V_bias) in F/rad, with R_s·V_bias in Ω·V.
    pub fn slope<S: Over<P>>(&self, angle: S, transimpedance: P) -> S {
        self.sensitivity(angle) * -transimpedance.recip()
    }

    /// C(θ) − C(θ_c) = −∫h dθ/(R_s·V_bias) in F, with R_s·V_bias in Ω·V.
    ///
    /// The integral of s is ln cosh(u/2) of the logistic curve and (1 − e^{−u²})/2 of the Gaussian one, over N_θ.
    pub fn capacitance_change<S: Over<P>>(&self, angle: S, transimpedance: P) -> S {
        let angle_alone = angle.alone();
        let u = (angle_alone - self.centre) * self.steepness;
        let one = P::of(1.0);
        let integral = match self.shape {
            CurveShape::Logistic => {
                let size = u.abs();
                size.half() + (((-size).exp() + one).half()).ln()
            }
            CurveShape::Gaussian => -(((-u.sq()).exp() - one).half()),
        };
        angle.chained(integral * -(self.gain / (self.steepness * transimpedance)))
    }

    /// dh/dθ at θ_c in V·s/rad²: N_g·N_θ/4 of the logistic curve, N_g·N_θ of the Gaussian one.
    pub fn steepest(&self) -> P {
        let product = self.gain * self.steepness;
        match self.shape {
            CurveShape::Logistic => product * P::of(0.25),
            CurveShape::Gaussian => product,
        }
    }
}
