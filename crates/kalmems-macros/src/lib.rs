//! What is written for a model by machine: the inlining of its functions, and the map over its parameters.

mod model;
mod parameters;

use proc_macro::TokenStream;

/// Puts `#[inline(always)]` on a function, or on every function of an `impl` or `trait`.
///
/// A filter is fast because its model dissolves into it. One model function that the compiler decides to call
/// instead can cost more than the rest of the step, and nothing warns of it; so models carry this attribute, and
/// none of their functions can be forgotten.
///
/// ```
/// struct Spring(f64);
/// #[kalmems_macros::model]
/// impl Spring {
///     fn force(&self, x: f64) -> f64 {
///         -self.0 * x
///     }
/// }
/// assert_eq!(Spring(2.0).force(3.0), -6.0);
/// ```
///
/// `#[model(parametric)]` on an `impl` of `Dynamics` or `Measurement` says besides that the same law holds with
/// parameters of another number: it adds the `impl` of `ParametricDynamics` or `ParametricMeasurement`, so that
/// any parameter can become a state. The type needs `#[derive(Parameters)]`.
///
/// ```
/// use kalmems_core::{Dual, Dynamics, Over, ParametricDynamics, Scalar};
/// use kalmems_macros::{Parameters, model};
/// #[derive(Parameters)]
/// struct Decay<P> {
///     rate: P,
/// }
/// #[model(parametric)]
/// impl<T: Scalar> Dynamics<T, 1> for Decay<T> {
///     type Input = T;
///     fn derivative<S: Over<T>>(&self, x: &[S; 1], inflow: &T) -> [S; 1] {
///         [S::lift(*inflow) - x[0] * self.rate]
///     }
/// }
/// let varied = Decay { rate: Dual::<f64, 1>::variable(0.5, 0) };
/// let [rate_of_change] = Decay::<f64>::derivative_of(&varied, &[Dual::constant(2.0)], &3.0);
/// assert_eq!((rate_of_change.value(), rate_of_change.gradient()), (2.0, [-2.0]));
/// ```
#[proc_macro_attribute]
pub fn model(arguments: TokenStream, item: TokenStream) -> TokenStream {
    model::expand(arguments.into(), item.into()).unwrap_or_else(syn::Error::into_compile_error).into()
}

/// Derives `kalmems_core::Parameters` for a structure that is generic over the number it holds.
///
/// The structure has one type parameter, the number. A field of that type is a parameter; a field whose type
/// mentions it, such as `Resonator<P>` or `[P; 3]`, holds parameters of its own; any other field is carried over
/// unchanged and must say so with `#[parameters(fixed)]`.
///
/// ```
/// use kalmems_core::Parameters;
/// use kalmems_macros::Parameters;
/// #[derive(Parameters)]
/// struct Series<P> {
///     #[parameters(fixed)]
///     is_even: bool,
///     centre: P,
///     coefficients: [P; 3],
/// }
/// assert_eq!(Series::<f32>::COUNT, 4);
/// assert_eq!(Series::<f32>::index_of("coefficients.1"), Some(2));
/// assert_eq!(Series::<f32>::index_of("is_even"), None);
/// ```
///
/// A field that holds no number and does not say so is refused:
///
/// ```compile_fail
/// #[derive(kalmems_macros::Parameters)]
/// struct Law<P> {
///     gain: P,
///     degree: u32,
/// }
/// ```
#[proc_macro_derive(Parameters, attributes(parameters))]
pub fn parameters(item: TokenStream) -> TokenStream {
    let item = syn::parse_macro_input!(item as syn::DeriveInput);
    parameters::expand(&item).unwrap_or_else(syn::Error::into_compile_error).into()
}
