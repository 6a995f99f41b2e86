//! Elementary functions, each written once over a [`Register`] of numbers.
//!
//! `core` has none, and the platform's differ between machines. Here one number and several in a register go through
//! the very same operations in the same order, without fused multiplications, and a branch for what is rare gives the
//! same bits as the way without: results agree to the last bit. `tests/math.rs` measures the errors against arbitrary precision.

mod atanh;
mod constants;
mod exp;
mod ln;
mod polynomial;
mod portable;
mod register;
mod trig;

pub(crate) use atanh::atanh;
#[cfg(target_arch = "x86_64")]
pub(crate) use constants::Constants;
pub(crate) use exp::exp;
pub(crate) use ln::ln;
pub use portable::Portable;
pub(crate) use register::Register;
pub(crate) use trig::{cos, sin};
