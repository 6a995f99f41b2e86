//! A plate between two fixed ones.

use kalmems_core::{Over, Scalar};
use kalmems_macros::{Parameters, model};

/// C₁ = ε·A/(d₀ − x) and C₂ = ε·A/(d₀ + x): a movable plate between two fixed ones, x in m towards the first
/// (Zhang, Sensing and control of MEMS accelerometers using Kalman filter, 2010, equation 2-8).
///
/// ```
/// use kalmems_models::capacitance::DifferentialPlates;
/// let plates = DifferentialPlates { area: 1.86e-6, gap: 2.3e-6, permittivity: 8.854e-12_f64 };
/// assert_eq!(plates.difference(0.0), 0.0);
/// let [first, second] = plates.capacitances(1e-7);
/// assert!((first - second - plates.difference(1e-7)).abs() < 1e-15 * first);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Parameters)]
pub struct DifferentialPlates<P> {
    /// A in m², of each capacitor.
    pub area: P,
    /// d₀ in m, of each at rest. Positive.
    pub gap: P,
    /// ε in F/m, of what fills the gaps.
    pub permittivity: P,
}

/// One of the two fixed plates.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FixedPlate {
    /// That at x = d₀.
    First,
    /// That at x = −d₀.
    Second,
}

#[model]
impl<P: Scalar> DifferentialPlates<P> {
    /// C₁ and C₂ in F, with x in m.
    pub fn capacitances<S: Over<P>>(&self, x: S) -> [S; 2] {
        let (near, far) = self.gaps(x);
        let face = self.permittivity * self.area;
        [near.recip() * face, far.recip() * face]
    }

    /// C₁ − C₂ = 2·ε·A·x/(d₀² − x²) in F.
    pub fn difference<S: Over<P>>(&self, x: S) -> S {
        let (near, far) = self.gaps(x);
        x * (near * far).recip() * (self.permittivity * self.area).twice()
    }

    /// C₀ = ε·A/d₀ in F: each of them at x = 0.
    pub fn at_rest(&self) -> P {
        self.permittivity * self.area / self.gap
    }

    /// F = ½·ε·A·(V₁²/(d₀ − x)² − V₂²/(d₀ + x)²) in N towards the first plate, with the mean squares of the voltages
    /// between the movable plate and each fixed one in V² (equation 2-15).
    pub fn force<S: Over<P>>(&self, x: S, squares: [P; 2]) -> S {
        let (near, far) = self.gaps(x);
        let half_face = (self.permittivity * self.area).half();
        near.sq().recip() * (half_face * squares[0]) - far.sq().recip() * (half_face * squares[1])
    }

    /// dF/dx = ε·A·(V₁²/(d₀ − x)³ + V₂²/(d₀ + x)³) in N/m: what the voltages take from the stiffness of a spring.
    pub fn force_slope<S: Over<P>>(&self, x: S, squares: [P; 2]) -> S {
        let (near, far) = self.gaps(x);
        let face = self.permittivity * self.area;
        (near.sq() * near).recip() * (face * squares[0]) + (far.sq() * far).recip() * (face * squares[1])
    }

    /// d₀ − x and d₀ + x.
    fn gaps<S: Over<P>>(&self, x: S) -> (S, S) {
        (-(x - self.gap), x + self.gap)
    }
}

impl<P: Scalar> DifferentialPlates<P> {
    /// The plate that is touched at x, where stops end the motion at this share of the gap; `None` in between.
    ///
    /// ```
    /// use kalmems_models::capacitance::{DifferentialPlates, FixedPlate};
    /// let plates = DifferentialPlates { area: 1.86e-6, gap: 2.0e-6, permittivity: 8.854e-12_f64 };
    /// assert_eq!(plates.touched(1.9e-6, 0.9), Some(FixedPlate::First));
    /// assert_eq!(plates.touched(-1.9e-6, 0.9), Some(FixedPlate::Second));
    /// assert_eq!(plates.touched(1.7e-6, 0.9), None);
    /// ```
    pub fn touched(&self, x: P, stop: P) -> Option<FixedPlate> {
        let end = self.gap * stop;
        if x.lt(-end) {
            Some(FixedPlate::Second)
        } else if x.lt(end) {
            None
        } else {
            // What is not a number has left the gap too.
            Some(FixedPlate::First)
        }
    }
}
