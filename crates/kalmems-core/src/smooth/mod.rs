//! Smoothers: what later samples say of earlier states.
//!
//! Every smoother here is the Rauch–Tung–Striebel recursion in square-root form, and works with every
//! [`Filter`](crate::Filter). [`Backward`] is its one step; [`FixedLag`] applies it while samples arrive, and
//! [`smooth_interval`] to a whole recording, which may be larger than the memory.

mod fixed_lag;
mod interval;
mod rts;

pub use fixed_lag::FixedLag;
pub use interval::{SmoothingCourse, SmoothingError, smooth_interval};
pub use rts::{Backward, Smoothed};
