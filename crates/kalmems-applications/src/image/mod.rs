//! Registration of images from the motion of a scanner.
//!
//! A scanner sweeps a spot over an object and a detector records one intensity after the other. Where each belongs is
//! known from the motion alone: an error of its phase puts it in a wrong pixel.
//!
//! Positions run over the field of view from 0 to 1, x to the right and y downwards. A position is taken as proportional
//! to the mirror's angle, x = ½ + ½·θ/θ_field, as in Chen et al. 2020, (1), with the amplitude ½ that the field of view
//! from 0 to 1 calls for (it is printed as 1).
//!
//! ```
//! use kalmems_applications::image::{Lissajous, PhaseAccuracy, Raster, TissueScene};
//! // 300 pixels, one pixel of shift at most.
//! let target = PhaseAccuracy::of(300, 1);
//! assert!((target.one_pass_rad.to_degrees() - 0.38).abs() < 0.005);
//!
//! let scene = TissueScene::mucosa(1);
//! let mut raster = Raster::new([100, 100]);
//! for spot in Lissajous::published(2e6).frame(20e-3) {
//!     raster.add(spot.position, scene.intensity(spot.position));
//! }
//! assert!(raster.coverage() > 0.9);
//! ```

mod accuracy;
mod claimed;
mod figures;
mod file;
mod grey_png;
mod lissajous;
mod merit;
mod picture;
mod raster;
mod reconstruct;
#[cfg(feature = "report")]
mod results;
mod scan;
mod scene;
mod search;
mod sharpness;
mod track;

pub use accuracy::{PhaseAccuracy, ShiftHistogram, pixel_index};
pub use claimed::PlaceUncertainty;
pub use figures::image_figures;
pub use file::{Fill, Image, ImageAxis, Intensity};
pub use grey_png::{PictureError, preview, read_grey, write_grey};
pub use lissajous::{AxisOscillation, Lissajous, Spot};
pub use merit::{edge_width, psnr_db, structural_similarity};
pub use picture::Picture;
pub use raster::{Passes, Raster};
pub use reconstruct::{AxisOutcome, ImageError, ImageOutcome, reconstruct};
#[cfg(feature = "report")]
pub use results::{
    DevelopedImage, ImageAxisMetrics, ImageMetrics, ReferenceMetrics, image_page, write_image,
};
pub use scan::{ImageScan, ScanAxis, ScanSampleCounts};
pub use scene::TissueScene;
pub use search::{FoundPhase, PhaseSearchError, PhaseSearchResult, TriedPhase, search_phases};
pub use sharpness::Sharpness;
pub use track::{AxisTrack, TrackAngle, TrackError, TrackWalk};
