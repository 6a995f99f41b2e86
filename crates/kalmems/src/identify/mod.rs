//! Parameters of devices and their parts, from recordings.

mod circle;
mod free_decay;
mod frequency_response;

pub use circle::{Circle, fit_circle};
pub use free_decay::{FreeDecay, fit_free_decay};
pub use frequency_response::{ResonantResponse, ResponseModel, ResponsePoint, fit_response};
