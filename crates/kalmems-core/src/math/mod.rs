//! Elementary functions, each written once for both precisions.
//!
//! `core` has none, and the platform's differ between machines. Here every machine goes through the very same operations in the same order,
//! without fused multiplications, and a branch for what is rare gives the same bits as the way without: results agree to the last bit. `tests/math.rs` measures the errors against arbitrary precision.

mod atanh;
mod constants;
mod exp;
mod fused;
mod ln;
mod polynomial;
mod portable;
mod register;
mod sqrt;
mod trig;

pub(crate) use atanh::atanh;
pub(crate) use exp::exp;
pub(crate) use ln::ln;
pub use portable::Portable;
pub(crate) use register::Register;
pub(crate) use trig::{cos, sin};
