//! Several filters side by side.
//!
//! A [`Kernel`] is written once over a number of lanes that it does not know; [`Isa::run`] instantiates it for the
//! instructions that this machine has. All models and filters run in lanes as they are: a [`Lane`] is a
//! [`Scalar`](crate::Scalar) whose comparisons give a mask with a truth value for each lane. A lane gets the very bits
//! that a filter by itself gets, with any instructions, and a lane that is refused a step does not disturb the others.
//!
//! Here 37 levels that decay at different rates, each followed by a filter of its own. `f64` is itself a kind of lane,
//! one wide, so that the same kernel is the loop over single filters:
//!
//! ```
//! use kalmems_core::lanes::{Isa, Kernel, Lane};
//! use kalmems_core::{Covariance, Dynamics, Ekf, Euler, Filter, LinearMeasurement, Mat, Over, Scalar};
//!
//! /// ẋ = −rate·x³
//! struct Decay<T> {
//!     rate: T,
//! }
//! impl<T: Scalar> Dynamics<T, 1> for Decay<T> {
//!     type Input = ();
//!     #[inline(always)]
//!     fn derivative<S: Over<T>>(&self, x: &[S; 1], (): &()) -> [S; 1] {
//!         [-(x[0].sq() * x[0] * self.rate)]
//!     }
//! }
//!
//! struct Follow<'a> {
//!     rates: &'a [f64],
//!     /// One sample of every level after the other.
//!     samples: &'a [Vec<f64>],
//! }
//! impl Kernel<f64> for Follow<'_> {
//!     type Output = Vec<f64>;
//!     #[inline(always)]
//!     fn run<L: Lane<f64>>(self) -> Vec<f64> {
//!         let seen = LinearMeasurement { matrix: Mat([[L::of(1.0)]]) };
//!         let (q, r) = (Covariance::from_variances([L::of(1e-6)]), Covariance::from_variances([L::of(1e-2)]));
//!         // As many filters in each element as there are lanes; the last has lanes that follow nothing.
//!         let mut filters: Vec<_> = self.rates.chunks(L::WIDTH).map(|rates| {
//!             let decay = Decay { rate: L::load(rates, 1.0) };
//!             (Euler::new(decay, L::of(0.01), q), Ekf::new([L::of(1.0)], Covariance::from_variances([L::of(1.0)])))
//!         }).collect();
//!         for sample in self.samples {
//!             for ((process, filter), y) in filters.iter_mut().zip(sample.chunks(L::WIDTH)) {
//!                 // A refused lane keeps its state; which lanes took the step is in what these return.
//!                 let _ = filter.predict(process, &());
//!                 let _ = filter.update(&seen, &[L::load(y, f64::NAN)], &r);
//!             }
//!         }
//!         let mut levels = vec![0.0; self.rates.len()];
//!         for (levels, (_, filter)) in levels.chunks_mut(L::WIDTH).zip(&filters) {
//!             filter.mean()[0].store(levels);
//!         }
//!         levels
//!     }
//! }
//!
//! let rates: Vec<f64> = (0..37).map(|i| 0.5 + 0.1 * f64::from(i)).collect();
//! let level = |rate: f64, k: i32| (1.0 + 2.0 * rate * 0.01 * f64::from(k)).sqrt().recip();
//! let samples: Vec<Vec<f64>> = (1..200).map(|k| rates.iter().map(|rate| level(*rate, k)).collect()).collect();
//! let follow = || Follow { rates: &rates, samples: &samples };
//! let one_by_one: Vec<f64> = follow().run::<f64>();
//! assert!(one_by_one.iter().zip(&rates).all(|(x, rate)| (x - level(*rate, 199)).abs() < 0.01));
//! for isa in Isa::available() {
//!     assert_eq!(isa.run(follow()), Some(one_by_one.clone()));
//! }
//! ```
//!
//! # Speed
//!
//! `cargo bench -p kalmems-models --bench lanes` measures it. A filter's step is a chain of operations that wait for
//! each other, so a lane's number takes two registers, whose chains run beside each other. How filters and time are
//! nested matters little with that.
//!
//! What does matter: everything that computes with lanes must be inlined into the one function that is compiled for the
//! instructions, or each of its operations becomes a call. Mark functions with `#[inline(always)]`, models with the
//! attribute `model` of `kalmems-macros`, and compute in no closure, which cannot be marked: closures of a line or two
//! with one use are inlined, larger ones are not. `.ci/symbols` finds what is left.

mod arithmetic;
mod fused;
mod isa;
mod lane;
mod packed;
mod pair;
mod sqrt;
#[cfg(target_arch = "x86_64")]
mod x86;

pub(crate) use fused::{FUSED_F32, mac_f32, mac_f64};
pub use isa::{Isa, Kernel, Real};
pub use lane::Lane;
pub(crate) use sqrt::{sqrt_f32, sqrt_f64};
