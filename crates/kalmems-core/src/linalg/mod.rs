//! Small matrices of a fixed size, on the stack.

mod cholesky;
mod contraction;
mod decorrelation;
mod ldl;
mod lu;
mod many;
mod mat;
mod semidefinite;
mod stacked;
mod svd;
mod triangular;
mod unrolled;

pub use cholesky::Cholesky;
pub(crate) use contraction::Contraction;
pub(crate) use decorrelation::Decorrelation;
pub use ldl::Ldl;
pub use lu::Lu;
pub(crate) use many::{are_many, spread};
pub use mat::Mat;
pub(crate) use semidefinite::{Semidefinite, epsilon};
pub(crate) use stacked::reduced;
pub use svd::Svd;
pub(crate) use triangular::{inverse_times, times_inverse, triangularize};
pub(crate) use unrolled::unrolled;
