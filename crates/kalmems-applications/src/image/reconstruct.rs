//! From an image file to an image.

use super::claimed::{PlaceUncertainty, across_the_field};
use super::raster::Passes;
use super::scan::{ImageScan, ScanAxis, ScanSampleCounts};
use super::search::{FoundPhase, PhaseSearchError, PhaseSearchResult, TriedPhase, search_phases};
use super::sharpness::Sharpness;
use super::track::{AxisTrack, TrackError};
use crate::config::{ConfigError, ConfigFault, Key, Quantity};
use crate::image::file::Image;
use crate::named_files::{NamedFileError, NamedFiles};
use crate::progress::Progress;
use crate::recording::{Finding, Instant, Purpose, ReadError, RecordingLayout, RecordingSource};
use crate::units::{Kind, kind};
use std::path::Path;

/// An image, and what is known of it.
#[derive(Clone, Debug)]
pub struct ImageOutcome {
    /// What it was put together from.
    pub image: Image,
    /// The samples in their pixels, apart by the direction of x.
    pub passes: Passes,
    /// The samples at the phases that a search began with, apart by the direction of x; none without a search.
    pub before: Option<Passes>,
    /// The samples apart by the direction of y, where there is one.
    pub passes_of_y: Option<Passes>,
    /// What became of the samples.
    pub counts: ScanSampleCounts,
    /// x, and y where there is one.
    pub axes: Vec<AxisOutcome>,
    /// The files that were read: the intensities, then the trajectories.
    pub sources: Vec<RecordingSource>,
    /// What was found in them that does not keep them from being used, with the file's name.
    pub findings: Vec<(String, Finding)>,
}

/// What is known of an axis.
#[derive(Clone, Debug)]
pub struct AxisOutcome {
    /// `x` or `y`.
    pub name: &'static str,
    /// Pixels along it.
    pub pixels: u32,
    /// Its frequency while intensities were recorded, in Hz.
    pub frequency_hz: f64,
    /// Its amplitude then, in rad.
    pub amplitude_rad: f64,
    /// Its amplitudes in the first and in the last tenth of that time, in rad.
    pub amplitudes_at_ends_rad: [f64; 2],
    /// The angle at the edge of the field of view, in rad.
    pub half_field_rad: f64,
    /// How far it was taken to be ahead of its trajectory, in rad.
    pub phase_rad: f64,
    /// What the search found, where one was wanted.
    pub found: Option<FoundPhase>,
    /// The phase that it began with, in rad.
    pub start_rad: f64,
    /// Where the search measured the sharpness; empty without a search.
    pub tried: Vec<TriedPhase>,
    /// How far the place of a sample is uncertain, from one edge of the field of view to the other.
    pub places: Vec<PlaceUncertainty>,
    /// What a cubic between samples of the trajectory may be off by, in pixels.
    pub interpolation_error_px: f64,
    /// Gaps in the trajectory.
    pub gaps: usize,
}

/// Why there is no image.
#[derive(Debug, thiserror::Error)]
pub enum ImageError {
    /// The image file is wrong.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// A file that it names cannot be read.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// A trajectory cannot be used.
    #[error("{place}: {fault}")]
    Track {
        /// The file and the column.
        place: String,
        /// What is wrong.
        fault: TrackError,
    },
    /// No phase was found.
    #[error(transparent)]
    Search(#[from] PhaseSearchError),
    /// No sample lies in the field of view.
    #[error(
        "no sample could be put in a pixel: of {} samples {} lie before or after a trajectory, {} in its gaps, {} outside \
         of the field of view, and {} have no intensity; the times of all files must be on one clock",
        .0.samples, .0.beyond_trajectory, .0.in_gap, .0.outside_field, .0.without_intensity
    )]
    Nothing(ScanSampleCounts),
}

impl ImageError {
    /// Whether it was stopped from outside.
    pub const fn is_interruption(&self) -> bool {
        matches!(
            self,
            Self::Read(ReadError::Interrupted { .. }) | Self::Search(PhaseSearchError::Interrupted)
        )
    }
}

/// Reads all files of an image, searches phases where that is wanted, and sorts the samples into pixels.
pub fn reconstruct(image: &Image, progress: &dyn Progress) -> Result<ImageOutcome, ImageError> {
    let mut files = ScanFiles {
        image,
        origin: None,
        named: NamedFiles::new("image file", Purpose::Evaluation, progress),
    };
    let (file, column) = (&image.intensity.file, image.intensity.column.name());
    let place = || Key::from("intensity");
    let (time_s, intensity) = files.read(place(), file, &image.intensity.layout(), column, None)?;
    let scanned_s = time_s.first().copied().unwrap_or(f64::NAN)..=time_s.last().copied().unwrap_or(f64::NAN);
    let (mut axes, mut claims) = (Vec::new(), Vec::new());
    for (name, axis) in image.axes() {
        let key = Key::from(name);
        let layout = axis.layout();
        let (time_s, angle) = files.read(key, &axis.file, &layout, axis.column.name(), Some(&kind::ANGLE))?;
        let claimed = match &axis.uncertainty {
            Some(column) => {
                let (_, sd) =
                    files.read(Key::from(name), &axis.file, &layout, column.name(), Some(&kind::ANGLE))?;
                Some((angle.clone(), sd))
            }
            None => None,
        };
        claims.push(claimed);
        let track =
            AxisTrack::scanned(time_s, angle, scanned_s.clone()).map_err(|fault| ImageError::Track {
                place: format!("{}, column `{}`", image.resolve(&axis.file).display(), axis.column),
                fault,
            })?;
        let half_field_rad = axis.half_field.as_ref().map_or(track.largest_rad(), Quantity::si);
        axes.push(ScanAxis { track, half_field_rad, pixels: axis.pixels as usize });
    }
    let NamedFiles { sources, findings, .. } = files.named;
    let mut axes = axes.into_iter();
    let Some(x) = axes.next() else { return Err(ImageError::Nothing(ScanSampleCounts::default())) };
    let scan = ImageScan { time_s, intensity, x, y: axes.next() };

    let of = |f: fn(&super::ImageAxis) -> Option<f64>| [Some(&image.x), image.y.as_ref()].map(|a| f(a?));
    let start = of(|axis| axis.phase.as_ref().map(Quantity::si)).map(|phase| phase.unwrap_or(0.0));
    let ranges = of(|axis| axis.search.as_ref().map(Quantity::si));
    // What cannot become an image is said before what cannot be searched.
    let (_, counts) = scan.reconstruct(start, 0);
    if counts.used == 0 {
        return Err(ImageError::Nothing(counts));
    }
    let PhaseSearchResult { found, mut tried } =
        search_phases(&scan, start, ranges, Sharpness::WithinPixel, progress)?;
    let phases = [0, 1].map(|axis| found[axis].map_or(start[axis], |found| found.phase_rad));
    let (passes, counts) = scan.reconstruct(phases, 0);
    let before = found.iter().any(Option::is_some).then(|| scan.reconstruct(start, 0).0);
    let passes_of_y = scan.y.as_ref().map(|_| scan.reconstruct(phases, 1).0);
    let outcomes = image.axes().zip(0..).filter_map(|((name, axis), index)| {
        let ScanAxis { track, half_field_rad, .. } = scan.axis(index)?;
        let pixels_per_rad = f64::from(axis.pixels) / (2.0 * half_field_rad);
        Some(AxisOutcome {
            name,
            pixels: axis.pixels,
            frequency_hz: track.frequency_hz(),
            amplitude_rad: track.amplitude_rad(),
            amplitudes_at_ends_rad: track.amplitudes_at_ends_rad(),
            half_field_rad: *half_field_rad,
            phase_rad: phases[index],
            found: found[index],
            start_rad: start[index],
            tried: tried.get_mut(index).map(std::mem::take).unwrap_or_default(),
            places: across_the_field(
                (*half_field_rad, track.amplitude_rad()),
                found[index],
                claims
                    .get(index)
                    .and_then(Option::as_ref)
                    .map(|(angle, sd)| (angle.as_slice(), sd.as_slice())),
            ),
            interpolation_error_px: track.interpolation_error_rad() * pixels_per_rad,
            gaps: track.gaps(),
        })
    });
    Ok(ImageOutcome {
        image: image.clone(),
        axes: outcomes.collect(),
        passes,
        before,
        passes_of_y,
        counts,
        sources,
        findings,
    })
}

struct ScanFiles<'a> {
    image: &'a Image,
    /// Where the times of all files count from: the first says it.
    origin: Option<Instant>,
    named: NamedFiles<'a>,
}

impl ScanFiles<'_> {
    /// Times and values of one column.
    fn read(
        &mut self,
        key: Key,
        file: &Path,
        layout: &RecordingLayout,
        column: &str,
        kind: Option<&Kind>,
    ) -> Result<(Vec<f64>, Vec<f64>), ImageError> {
        let layout = RecordingLayout { origin: self.origin, ..layout.clone() };
        let read = self.named.read(&self.image.resolve(file), &layout);
        let recording = read.map_err(|error| match error {
            NamedFileError::Missing(why) => {
                self.image.error(key.child("file"), ConfigFault::Value { why }).into()
            }
            NamedFileError::Read(error) => ImageError::Read(error),
        })?;
        self.origin = Some(recording.origin());
        let values = match kind {
            Some(kind) => recording.column_of(column, kind)?,
            None => recording.column(column)?,
        };
        let time = recording.segments().first().map(|segment| segment.time.to_vec()).unwrap_or_default();
        Ok((time, values.values.clone()))
    }
}
