//! What is fitted.

use kalmems_core::{Dual, Over};

/// Residuals as functions of `P` parameters, one after the other.
///
/// They are handed out and not stored, so that the memory of a fit does not grow with the recording. Divide each
/// by the standard deviation of its noise where that is known or differs between observations.
///
/// ```
/// use kalmems_engines::fit::{FitSettings, Regression, fit};
/// /// A mean: its derivative is 1.
/// struct Mean<'a>(&'a [f64]);
/// impl Regression<1> for Mean<'_> {
///     fn residuals(&self, [mean]: &[f64; 1], each: &mut impl FnMut(f64)) {
///         self.0.iter().for_each(|y| each(mean - y));
///     }
///     fn linearize(&self, [mean]: &[f64; 1], each: &mut impl FnMut(f64, &[f64; 1])) {
///         self.0.iter().for_each(|y| each(mean - y, &[1.0]));
///     }
/// }
/// let found = fit(&Mean(&[1.0, 2.0, 6.0]), &FitSettings::from_start([0.0]))?;
/// assert!((found.parameters[0] - 3.0).abs() < 1e-12);
/// # Ok::<(), kalmems_engines::fit::FitError>(())
/// ```
pub trait Regression<const P: usize> {
    /// Every residual at these parameters, in an order that is always the same.
    fn residuals(&self, parameters: &[f64; P], each: &mut impl FnMut(f64));

    /// The same with the derivatives by each parameter.
    fn linearize(&self, parameters: &[f64; P], each: &mut impl FnMut(f64, &[f64; P]));
}

/// Residuals written once for any number, so that their derivatives follow.
///
/// ```
/// use kalmems_engines::fit::{ByDual, FitSettings, ResidualLaw, fit};
/// use kalmems_core::Over;
/// /// y = a·exp(−b·t), seen without noise.
/// struct Decay;
/// impl ResidualLaw<2> for Decay {
///     fn residuals<S: Over<f64>>(&self, p: &[S; 2], each: &mut impl FnMut(S)) {
///         for k in 0..20 {
///             let t = 0.1 * f64::from(k);
///             each(p[0] * (-(p[1] * t)).exp() - 3.0 * (-0.7 * t).exp());
///         }
///     }
/// }
/// let found = fit(&ByDual(Decay), &FitSettings::from_start([1.0, 1.0]))?;
/// assert!((found.parameters[0] - 3.0).abs() < 1e-10 && (found.parameters[1] - 0.7).abs() < 1e-10);
/// # Ok::<(), kalmems_engines::fit::FitError>(())
/// ```
pub trait ResidualLaw<const P: usize> {
    /// Every residual at these parameters, in an order that is always the same.
    fn residuals<S: Over<f64>>(&self, parameters: &[S; P], each: &mut impl FnMut(S));
}

/// A [`ResidualLaw`] as a [`Regression`], differentiated by dual numbers.
#[derive(Clone, Copy, Debug)]
pub struct ByDual<L>(pub L);

impl<L: ResidualLaw<P>, const P: usize> Regression<P> for ByDual<L> {
    fn residuals(&self, parameters: &[f64; P], each: &mut impl FnMut(f64)) {
        self.0.residuals(parameters, each);
    }

    fn linearize(&self, parameters: &[f64; P], each: &mut impl FnMut(f64, &[f64; P])) {
        self.0.residuals(&Dual::<f64, P>::variables(parameters), &mut |r: Dual<f64, P>| {
            each(r.value(), &r.gradient());
        });
    }
}
