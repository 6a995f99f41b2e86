//! Parameters of devices and their parts, from recordings.

mod affine;
mod circle;
mod entries;
mod error;
mod free_decay;
mod frequency_response;
mod likelihood_interval;
mod material;
mod number_status;
mod outcome;
mod rest_noise;
mod whiteness;

pub use affine::{AffineFit, fit_affine};
pub use circle::{Circle, fit_circle};
pub use entries::{Entries, exact};
pub use error::IdentifyError;
pub use free_decay::{FreeDecay, fit_free_decay};
pub use frequency_response::{ResonantResponse, ResponseModel, ResponsePoint, fit_response};
pub use likelihood_interval::{TWO_SIDED, likelihood_half_width};
pub use material::{Material, require_usable_signals};
pub use number_status::{
    CONNECTED, LikelihoodSolution, NumberStatus, joint_number_statuses, number_statuses,
};
pub use outcome::{Correlated, Identification, Identified, Undetermined};
pub use rest_noise::{STRETCH, StillNoise, StillRecord, fit_still};
pub use whiteness::Whiteness;
