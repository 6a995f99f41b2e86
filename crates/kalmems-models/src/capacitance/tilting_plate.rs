//! Parallel plates, one of which tilts about an axis outside them.

use super::gauss_legendre::integral;
use kalmems_core::{Over, Scalar};
use kalmems_macros::{Parameters, model};

/// C(θ_X, θ_Y) = ε·∫∫ dw_X·dw_Y/(D_n − w_X·tan θ_Y + w_Y·tan θ_X) over [w₁, w₂] × [w₃, w₄].
///
/// The stator lies below a rotor that tilts about axes through the origin (Chen, dissertation, 2018, equations 36 to 40;
/// positive tilt brings positive w_X closer). The closed forms that are printed, (41) and (46), lose all digits near
/// θ = 0, and (46) has a minus too many; what is computed here is exact there and up to contact. Beyond contact the
/// results are not numbers; [`TiltingPlate::checked`] says so.
///
/// ```
/// use kalmems_models::capacitance::TiltingPlate;
/// // Stator 2A of the micro-stage: 0.4 mm squared, its middle 1.19 mm from the axis, 19 µm away.
/// let plate =
///     TiltingPlate { w1: 0.99e-3, w2: 1.39e-3, w3: -0.2e-3, w4: 0.2e-3, gap: 19e-6, permittivity: 8.8542e-12 };
/// let at_rest = 8.8542e-12 * 0.4e-3 * 0.4e-3 / 19e-6;
/// assert!((plate.capacitance(0.0_f64) / at_rest - 1.0).abs() < 1e-15);
/// assert!((plate.slope(0.0_f64) / (at_rest * 1.19e-3 / 19e-6) - 1.0).abs() < 1e-14);
/// assert!(plate.checked(0.0, 13.6e-3).is_ok());
/// assert!(plate.checked(0.0, 13.7e-3).is_err());
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Parameters)]
pub struct TiltingPlate<P> {
    /// w₁ in m: the near edge across the axis Y.
    pub w1: P,
    /// w₂ in m: the far edge; above w₁.
    pub w2: P,
    /// w₃ in m: the near edge across the axis X.
    pub w3: P,
    /// w₄ in m: the far edge; above w₃.
    pub w4: P,
    /// D_n in m: the distance without tilt.
    pub gap: P,
    /// ε = ε_r·ε_0 in F/m.
    pub permittivity: P,
}

/// The plates touch: there is no capacitance at this tilt.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Contact<P> {
    /// θ_X in rad.
    pub about_x: P,
    /// θ_Y in rad.
    pub about_y: P,
    /// The distance of the nearest corner in m, 0 or below.
    pub clearance: P,
}

/// Below this z² the series of [`ratio`] are used: their nine terms hold to the last digit there.
const SMALL: f64 = 0.0225;

/// The nearest singularity of an integrand that sixteen points can do, in half lengths from the middle.
const FAR: f64 = 1.5;

#[model]
impl<P: Scalar> TiltingPlate<P> {
    /// C(0, θ) in F, θ in rad, about the axis Y alone.
    ///
    /// With t = tan θ, m and δ the middle and the length of [w₁, w₂], b = w₄ − w₃, U = D_n − m·t and z = δ·t/(2·U):
    /// C = ε·b·δ·Φ(z)/U, Φ = atanh(z)/z.
    pub fn capacitance<S: Over<P>>(&self, angle: S) -> S {
        let (_, distance, z) = self.tilted(angle);
        ratio(z) * distance.recip() * (self.permittivity * self.area())
    }

    /// dC/dθ = (1 + t²)·ε·b·δ/U²·(m·Φ + Φ′(z)·δ·D_n/(2·U)) in F/rad.
    pub fn slope<S: Over<P>>(&self, angle: S) -> S {
        let (tangent, distance, z) = self.tilted(angle);
        let near = distance.recip();
        let half = (self.w2 - self.w1).half();
        let bracket = ratio(z) * self.middle() + ratio_slope(z) * near * (half * self.gap);
        (tangent.sq() + P::of(1.0)) * near.sq() * bracket * (self.permittivity * self.area())
    }

    /// ∂C/∂D_n = −ε·b·δ/((D_n − w₁·t)·(D_n − w₂·t)) in F/m, θ in rad, about the axis Y alone.
    pub fn by_gap<S: Over<P>>(&self, angle: S) -> S {
        let tangent = tangent(angle);
        let (near, far) = (tangent * -self.w1 + self.gap, tangent * -self.w2 + self.gap);
        (near * far).recip() * -(self.permittivity * self.area())
    }

    /// C(θ_X, θ_Y) in F, angles in rad.
    ///
    /// One of the two integrals is done in closed form and the other by sixteen points, the one over which the
    /// integrand is smooth; close to contact with both tilted, both are done in closed form, where its four terms
    /// do not cancel.
    pub fn capacitance_of_both<S: Over<P>>(&self, about_x: S, about_y: S) -> S {
        let (x, y) = (tangent(about_x), tangent(about_y));
        let middle_y = (self.w3 + self.w4).half();
        let (half_x, half_y) = ((self.w2 - self.w1).half(), (self.w4 - self.w3).half());
        let centre = S::lift(self.gap) - y * self.middle() + x * middle_y;
        // How far the plate's halves rise and fall.
        let (rise_y, rise_x) = (y * half_x, x * half_y);
        let (steep_y, steep_x) = (rise_y.abs(), rise_x.abs());

        // ∫dw_X/U = 2·h·Φ(h·t/U)/U for a strip of half length h, whose middle is U away.
        let strip = |distance: S, rise: S, half: P| {
            let near = distance.recip();
            ratio(rise * near) * near * half.twice()
        };
        let over_y = integral(P::of(0.0), half_y, |w: S| strip(centre + w * x, rise_y, half_x));
        let over_x = integral(P::of(0.0), half_x, |w: S| strip(centre - w * y, rise_x, half_y));
        // u·ln u in units of the gap, so that the logarithms are small.
        let per_gap = self.gap.recip();
        let term = |distance: S| {
            let u = distance * per_gap;
            u * u.ln()
        };
        let corners =
            term(centre + rise_x + rise_y) - term(centre + rise_x - rise_y) - term(centre - rise_x + rise_y)
                + term(centre - rise_x - rise_y);
        let closed = corners * (x * y).recip() * self.gap;

        let far = P::of(FAR);
        let smooth_y = (steep_x * far).lt(centre - steep_y);
        let smooth_x = (steep_y * far).lt(centre - steep_x);
        S::select(smooth_y, over_y, S::select(smooth_x, over_x, closed)) * self.permittivity
    }

    /// The distance of the nearest corner in m; at 0 and below the plates touch.
    pub fn clearance<S: Over<P>>(&self, about_x: S, about_y: S) -> S {
        let (x, y) = (tangent(about_x), tangent(about_y));
        let lower = |a: S, b: S| S::select(a.lt(b), a, b);
        let across = lower(y * -self.w1, y * -self.w2);
        let along = lower(x * self.w3, x * self.w4);
        across + along + self.gap
    }

    /// ε·b·δ without ε: the area in m².
    fn area(&self) -> P {
        (self.w2 - self.w1) * (self.w4 - self.w3)
    }

    /// m in m.
    fn middle(&self) -> P {
        (self.w1 + self.w2).half()
    }

    /// t, U and z.
    fn tilted<S: Over<P>>(&self, angle: S) -> (S, S, S) {
        let tangent = tangent(angle);
        let distance = S::lift(self.gap) - tangent * self.middle();
        (tangent, distance, tangent * distance.recip() * (self.w2 - self.w1).half())
    }
}

impl<P: Scalar> TiltingPlate<P> {
    /// [`capacitance_of_both`](Self::capacitance_of_both) where the plates are apart.
    ///
    /// # Errors
    ///
    /// [`Contact`] where a corner touches, or an angle is not a number.
    pub fn checked(&self, about_x: P, about_y: P) -> Result<P, Contact<P>> {
        let clearance = self.clearance(about_x, about_y);
        if P::of(0.0).lt(clearance) {
            Ok(self.capacitance_of_both(about_x, about_y))
        } else {
            Err(Contact { about_x, about_y, clearance })
        }
    }

    /// The angle about Y in rad at which this plate and another have the same capacitance, found by Newton's method;
    /// none where the steps do not settle between the contacts.
    ///
    /// Of a large outer stator and a small inner one on the other side of the axis that is the threshold angle: the
    /// difference of the two changes its sign there (Chen, dissertation, 2018, section 3.3.4).
    pub fn balance(&self, other: &Self) -> Option<P> {
        let mut angle = P::of(0.0);
        for _ in 0..NEWTON {
            let touches = |plate: &Self, at: P| !P::of(0.0).lt(plate.clearance(P::of(0.0), at));
            let excess = self.capacitance(angle) - other.capacitance(angle);
            let mut step = excess / (self.slope(angle) - other.slope(angle));
            // Never through a contact.
            let mut halvings = 0;
            while halvings < NEWTON && (touches(self, angle - step) || touches(other, angle - step)) {
                step = step.half();
                halvings += 1;
            }
            angle = angle - step;
            // An angle that a gap and the edges make: what small is beside.
            let small = self.gap / (self.w1.abs() + self.w2.abs() + other.w1.abs() + other.w2.abs());
            if step.abs().lt(small * P::of(1e-12)) {
                // Beyond where either would touch on its way back there is no tilt of a stage.
                return (!touches(self, -angle) && !touches(other, -angle)).then_some(angle);
            }
        }
        None
    }
}

/// Steps of Newton's method; it settles in five or six.
const NEWTON: usize = 60;

/// tan θ.
#[inline(always)]
fn tangent<S: Scalar>(angle: S) -> S {
    angle.sin() * angle.cos().recip()
}

/// Φ(z) = atanh(z)/z = 1 + z²/3 + z⁴/5 + … for |z| < 1.
#[inline(always)]
fn ratio<P: Scalar, S: Over<P>>(z: S) -> S {
    let square = z.sq();
    let mut series = S::lift(P::of(1.0 / 17.0));
    for odd in [15.0, 13.0, 11.0, 9.0, 7.0, 5.0, 3.0, 1.0] {
        series = series * square + P::of(1.0 / odd);
    }
    S::select(square.lt(S::lift(P::of(SMALL))), series, z.atanh() * z.recip())
}

/// Φ′(z) = 2·z/3 + 4·z³/5 + … = (1/(1 − z²) − Φ)/z.
#[inline(always)]
fn ratio_slope<P: Scalar, S: Over<P>>(z: S) -> S {
    let square = z.sq();
    let mut series = S::lift(P::of(18.0 / 19.0));
    for even in [16.0, 14.0, 12.0, 10.0, 8.0, 6.0, 4.0, 2.0] {
        series = series * square + P::of(even / (even + 1.0));
    }
    let closed = ((S::lift(P::of(1.0)) - square).recip() - z.atanh() * z.recip()) * z.recip();
    S::select(square.lt(S::lift(P::of(SMALL))), series * z, closed)
}
