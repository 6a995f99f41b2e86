//! Parameters of devices and their parts, from recordings.

mod affine;
mod circle;
mod entries;
mod error;
mod free_decay;
mod frequency_response;
mod material;
mod outcome;
mod reach;
mod standing;
mod still;
mod whiteness;

pub use affine::{AffineFit, fit_affine};
pub use circle::{Circle, fit_circle};
pub use entries::{Entries, exact};
pub use error::IdentifyError;
pub use free_decay::{FreeDecay, fit_free_decay};
pub use frequency_response::{ResonantResponse, ResponseModel, ResponsePoint, fit_response};
pub use material::{Material, require_sound};
pub use outcome::{Correlated, Identification, Identified, Undetermined};
pub use reach::{TWO_SIDED, reach};
pub use standing::{CONNECTED, LikelihoodSolution, NumberStatus, standings, standings_beside};
pub use still::{STRETCH, StillNoise, StillRecord, fit_still};
pub use whiteness::Whiteness;
