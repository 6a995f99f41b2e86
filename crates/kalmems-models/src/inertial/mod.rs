//! What a strapped-down unit of gyroscopes and accelerometers shows of a motion.

mod clock;
mod force;
mod triad;

pub use clock::SampleClock;
pub use force::SpecificForce;
pub use triad::{Alignment, Triad};

/// a × b.
#[inline(always)]
fn cross<S: kalmems_core::Scalar>(a: [S; 3], b: [S; 3]) -> [S; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}
