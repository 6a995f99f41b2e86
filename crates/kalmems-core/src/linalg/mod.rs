//! Small matrices of a fixed size, on the stack.

mod cholesky;
mod inverse;
mod ldl;
mod mat;
mod semidefinite;
mod stacked;
mod svd;

pub use cholesky::Cholesky;
pub(crate) use inverse::inverse;
pub use ldl::Ldl;
pub use mat::Mat;
pub(crate) use mat::sum;
pub(crate) use semidefinite::{Semidefinite, epsilon};
pub(crate) use stacked::{reduced, triangularised};
pub use svd::Svd;
