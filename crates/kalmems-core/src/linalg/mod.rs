//! Small matrices of a fixed size, on the stack.

mod cholesky;
mod ldl;
mod mat;
mod svd;

pub use cholesky::Cholesky;
pub use ldl::Ldl;
pub use mat::Mat;
pub(crate) use mat::sum;
pub use svd::Svd;
