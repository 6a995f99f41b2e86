//! The files of an image.

use super::PictureError;
use super::grey_png::{preview, preview_of, write_counts, write_grey};
use crate::WriteError;
use crate::image::figures::image_figures;
use crate::image::file::Fill;
use crate::image::{
    AxisOutcome, ImageOutcome, PhaseAccuracy, Picture, ScanSampleCounts, psnr_db, structural_similarity,
};
use crate::recording::RecordingSource;
use kalmems_core::Portable;
use kalmems_engines::inspect::quantity;
use kalmems_engines::topics::{explained, link};
use kalmems_figures::{
    ColumnHead, Figure, NoticeSeverity, Page, PagePart, PageSection, ReportError, TextTable, significant,
};
use kalmems_store::{Output, RunInfo, RunTiming};
use serde::Serialize;
use std::io;
use std::path::Path;

/// An image with its grey values.
#[derive(Clone, Debug)]
pub struct DevelopedImage {
    /// Black 0, white 1; NaN where there is no sample.
    pub picture: Picture,
    /// The same of the samples taken while x grows.
    pub forward: Picture,
    /// The same of those taken while x falls.
    pub backward: Picture,
    /// The image at the phases that the search began with; none without a search.
    pub before: Option<Picture>,
    /// The intensity that became black.
    pub black: f64,
    /// The intensity that became white.
    pub white: f64,
}

impl DevelopedImage {
    /// With black and white as the image file says, or else from the darkest to the brightest pixel.
    pub fn of(outcome: &ImageOutcome) -> Self {
        let mean = outcome.passes.together().picture();
        let [least, most] = mean.range().unwrap_or([0.0, 1.0]);
        let black = outcome.image.intensity.black.unwrap_or(least);
        let white = outcome.image.intensity.white.unwrap_or(most);
        // An image of one grey is black.
        let span = if white == black { 1.0 } else { white - black };
        let grey = |picture: Picture| picture.map(|v| (v - black) / span);
        let [forward, backward] =
            [&outcome.passes.forward, &outcome.passes.backward].map(|p| grey(p.picture()));
        let before = outcome.before.as_ref().map(|passes| grey(passes.together().picture()));
        Self { picture: grey(mean), forward, backward, before, black, white }
    }
}

/// What is said of an image.
#[derive(Clone, Debug, Serialize)]
pub struct ImageMetrics {
    /// Its name.
    pub name: String,
    /// The result in sentences: how much of the image there is, and where it was put.
    pub answer: Vec<String>,
    /// What became of the samples.
    pub samples: ScanSampleCounts,
    /// Pixels with at least one sample.
    pub filled_pixels: usize,
    /// Pixels without one.
    pub empty_pixels: usize,
    /// Empty pixels that the picture for the eye has filled from their neighbours.
    pub filled_for_the_eye: usize,
    /// The part of the pixels with at least one sample.
    pub coverage: f64,
    /// The intensity that became black.
    pub black: f64,
    /// The intensity that became white.
    pub white: f64,
    /// Pixels darker than black or brighter than white, cut in the picture.
    pub beyond_grey: usize,
    /// The root mean square of the samples about the mean of their pixel, as a grey value.
    pub within_pixel_rms: Option<f64>,
    /// Axis by axis.
    pub axes: Vec<ImageAxisMetrics>,
    /// Against the picture that it should be, where one was given.
    pub reference: Option<ReferenceMetrics>,
    /// What was found in the files and in the motion and does not keep them from being used.
    pub findings: Vec<String>,
}

/// What is said of an axis.
#[derive(Clone, Debug, Serialize)]
pub struct ImageAxisMetrics {
    /// `x` or `y`.
    pub name: &'static str,
    /// Pixels along it.
    pub pixels: u32,
    /// Its frequency while intensities were recorded, in Hz.
    pub frequency_hz: f64,
    /// Its amplitude then, in degrees.
    pub amplitude_deg: f64,
    /// The angle at the edge of the field of view in degrees.
    pub half_field_deg: f64,
    /// How far it was taken to be ahead of its trajectory, in degrees of its cycle.
    pub phase_deg: f64,
    /// The standard error of that, where it was searched.
    pub phase_sd_deg: Option<f64>,
    /// The phase error that moves no sample by more than a pixel.
    pub one_pixel_deg: f64,
    /// The root mean square of the difference between its passes, as a grey value.
    pub passes_differ_rms: Option<f64>,
    /// By how many pixels the place of a sample is uncertain, root mean square over the field of view: one standard deviation of the phase that was
    /// found and of what the trajectory's filter claims. None where neither is known.
    pub place_sd_px: Option<f64>,
    /// What the interpolation of the trajectory may be off by in pixels.
    pub interpolation_error_px: f64,
    /// Gaps in the trajectory, in which nothing was interpolated.
    pub gaps: usize,
}

/// How far an image is from what it should be.
#[derive(Clone, Debug, Serialize)]
pub struct ReferenceMetrics {
    /// The peak signal-to-noise ratio in dB; none where no pixel differs.
    pub psnr_db: Option<f64>,
    /// The structural similarity.
    pub ssim: Option<f64>,
}

impl ImageMetrics {
    /// Of an image; `reference` is the picture that it should be, and its file.
    pub fn of(
        outcome: &ImageOutcome,
        developed: &DevelopedImage,
        reference: Option<(&Path, &Picture)>,
    ) -> Result<Self, PictureError> {
        let all = outcome.passes.together();
        let span = (developed.white - developed.black).abs();
        let finite = |value: f64| value.is_finite().then_some(value);
        let reference = match reference {
            Some((path, truth)) if truth.size() != all.size() => {
                let (path, found, expected) = (path.to_owned(), truth.size(), all.size());
                return Err(PictureError::Size { path, found, expected });
            }
            Some((_, truth)) => Some(ReferenceMetrics {
                psnr_db: psnr_db(&developed.picture, truth).and_then(finite),
                ssim: structural_similarity(&developed.picture, truth),
            }),
            None => None,
        };
        let freedom = all.samples() as f64 - all.filled() as f64;
        let passes = [Some(&outcome.passes), outcome.passes_of_y.as_ref()];
        let axes = outcome.axes.iter().zip(passes).map(|(axis, passes)| ImageAxisMetrics {
            name: axis.name,
            pixels: axis.pixels,
            frequency_hz: axis.frequency_hz,
            amplitude_deg: axis.amplitude_rad.to_degrees(),
            half_field_deg: axis.half_field_rad.to_degrees(),
            phase_deg: axis.phase_rad.to_degrees(),
            phase_sd_deg: axis.found.and_then(|found| finite(found.sd_rad.to_degrees())),
            one_pixel_deg: PhaseAccuracy::of(axis.pixels, 1).one_pass_rad.to_degrees(),
            passes_differ_rms: passes.and_then(|passes| finite(passes.difference_rms() / span)),
            place_sd_px: place_sd_px(axis),
            interpolation_error_px: axis.interpolation_error_px,
            gaps: axis.gaps,
        });
        let axes: Vec<ImageAxisMetrics> = axes.collect();
        let beyond = developed.picture.values().iter().filter(|v| !v.is_nan() && !(0.0..=1.0).contains(*v));
        Ok(Self {
            name: outcome.image.name.to_string(),
            answer: answer(&axes, all.coverage()),
            samples: outcome.counts,
            filled_pixels: all.filled(),
            empty_pixels: all.counts().len() - all.filled(),
            filled_for_the_eye: for_the_eye(outcome, developed).map_or(0, |(_, count)| count),
            coverage: all.coverage(),
            black: developed.black,
            white: developed.white,
            beyond_grey: beyond.count(),
            within_pixel_rms: finite((all.scatter() / freedom).sqrt() / span),
            axes,
            reference,
            findings: (outcome.findings.iter().map(|(file, finding)| format!("{file}: {finding}")))
                .chain(outcome.axes.iter().filter_map(unsettled))
                .collect(),
        })
    }

    /// For a reader.
    pub fn to_text(&self) -> String {
        let ScanSampleCounts { samples, used, outside_field, in_gap, beyond_trajectory, without_intensity } =
            self.samples;
        let mut text = self.answer.join("\n") + "\n\n";
        for axis in &self.axes {
            text += &format!(
                "{}: {}, amplitude {:.4} deg in a field of ±{:.4} deg; interpolation within {:.4} pixels",
                axis.name,
                quantity(axis.frequency_hz, "Hz"),
                axis.amplitude_deg,
                axis.half_field_deg,
                axis.interpolation_error_px
            );
            if let Some(rms) = axis.passes_differ_rms {
                text += &format!("; forward and backward differ by {rms:.4} rms");
            }
            text += "\n";
        }
        text += &format!(
            "{used} of {samples} samples used; outside of the field {outside_field}, in gaps of a trajectory {in_gap}, \
             before or after it {beyond_trajectory}, without intensity {without_intensity}\n\
             {} pixels have samples, {} are empty",
            self.filled_pixels, self.empty_pixels
        );
        if self.filled_for_the_eye > 0 {
            text += &format!("; {} of them filled in picture.png", self.filled_for_the_eye);
        }
        text += "\n";
        if self.beyond_grey > 0 {
            text += &format!(
                "{} pixels are darker than black or brighter than white, and cut\n",
                self.beyond_grey
            );
        }
        if let Some(reference) = &self.reference {
            let psnr =
                reference.psnr_db.map_or_else(|| "no difference".to_owned(), |db| format!("PSNR {db:.2} dB"));
            let ssim = reference.ssim.map_or_else(String::new, |ssim| format!(", SSIM {ssim:.4}"));
            text += &format!("against the reference: {psnr}{ssim}\n");
        }
        for finding in &self.findings {
            text += &format!("note: {finding}\n");
        }
        text
    }
}

/// What an image is, and how far the places of its samples can be trusted.
fn answer(axes: &[ImageAxisMetrics], coverage: f64) -> Vec<String> {
    let sizes: Vec<String> = axes.iter().map(|axis| axis.pixels.to_string()).collect();
    let whole = format!("{} pixels, of which {:.2} % have samples.", sizes.join(" × "), 100.0 * coverage);
    let of_axis = |axis: &ImageAxisMetrics| {
        let mut text = format!("{}: phase {:.4} deg", axis.name, axis.phase_deg);
        if let Some(sd) = axis.phase_sd_deg {
            text += &format!(" ± {sd:.4} deg, found by the search");
        }
        text += &format!("; {:.3} deg move a sample by one pixel", axis.one_pixel_deg);
        if let Some(sd) = axis.place_sd_px {
            text += &format!("; the place of a sample is known to {sd:.3} pixels");
        }
        text + "."
    };
    std::iter::once(whole).chain(axes.iter().map(of_axis)).collect()
}

/// The relative change of an amplitude over a scan from which on a motion is said not to have settled.
const UNSETTLED: f64 = 0.05;

/// What is said of an axis whose motion has not settled.
fn unsettled(axis: &AxisOutcome) -> Option<String> {
    let [first, last] = axis.amplitudes_at_ends_rad;
    ((last - first).abs() > UNSETTLED * axis.amplitude_rad).then(|| {
        format!(
            "{}: the motion has not settled: its amplitude goes from {:.4} to {:.4} deg between the first and the last tenth of the scan; \
             the frequency and the amplitude that are stated are those of the sine that fits all of it best",
            axis.name,
            first.to_degrees(),
            last.to_degrees()
        )
    })
}

fn for_the_eye(outcome: &ImageOutcome, developed: &DevelopedImage) -> Option<(Picture, usize)> {
    outcome.image.fill.map(|Fill::Neighbours| developed.picture.filled_from_neighbours())
}

/// Writes an image into a result.
///
/// `image.png`, `forward.png` and `backward.png`, grey with 16 bits and transparent where there is no sample;
/// `counts.png`, the number of samples as grey value, and `counts_preview.png` with 8 bits to look at; `figures/`; `picture.png`, filled, where the image file says how;
/// `report.html`, `metrics.json` and `run.toml`.
pub fn write_image(
    outcome: &ImageOutcome,
    developed: &DevelopedImage,
    metrics: &ImageMetrics,
    output: &Output,
    info: RunInfo,
) -> Result<(), WriteError> {
    let input_id = input_id(outcome);
    let figures = image_figures(outcome);
    let html = image_page(outcome, developed, metrics, &figures)?;
    output.write("report.html", |w| w.write_all(html.as_bytes()))?;
    for figure in &figures {
        figure.files(|name, content| output.write(name, |w| w.write_all(content)))?;
    }
    let pictures = [
        ("image.png", &developed.picture),
        ("forward.png", &developed.forward),
        ("backward.png", &developed.backward),
    ];
    for (name, picture) in pictures {
        output.write(name, |w| write_grey(picture, w))?;
    }
    let all = outcome.passes.together();
    output.write("counts.png", |w| write_counts(all.counts(), all.size(), w))?;
    let (counts, _) = counts_preview(all.counts(), all.size());
    output.write("counts_preview.png", |w| w.write_all(&counts))?;
    if let Some(before) = &developed.before {
        output.write("before.png", |w| write_grey(before, w))?;
    }
    if let Some((picture, _)) = for_the_eye(outcome, developed) {
        output.write("picture.png", |w| write_grey(&picture, w))?;
    }
    output.write("metrics.json", |w| {
        serde_json::to_writer_pretty(&mut *w, metrics)?;
        writeln!(w)
    })?;
    output.write_run(&input_id, || {
        Ok(ImageRecord {
            timing: info.timing(),
            input: &outcome.sources,
            image: toml::Value::try_from(&outcome.image).map_err(io::Error::other)?,
        })
    })?;
    Ok(())
}

/// The report of an image: the page's text, which needs nothing else.
pub fn image_page(
    outcome: &ImageOutcome,
    developed: &DevelopedImage,
    metrics: &ImageMetrics,
    figures: &[Figure],
) -> Result<String, ReportError> {
    let mut verdict = PageSection::new("Verdict").part(PagePart::Verdict);
    let ScanSampleCounts { samples, used, .. } = metrics.samples;
    let text = format!(
        "{used} of {samples} samples are in the image; {:.2} % of its {} pixels have samples.",
        100.0 * metrics.coverage,
        metrics.filled_pixels + metrics.empty_pixels
    );
    // An image of which half is missing is none.
    verdict = if metrics.coverage < 0.5 {
        verdict.notice(NoticeSeverity::Warning, format!("{text}{}", link("applications")))
    } else {
        verdict.notice(NoticeSeverity::Ok, text)
    };
    for axis in &metrics.axes {
        let (off, pixel) = (axis.phase_sd_deg.unwrap_or(0.0), axis.one_pixel_deg);
        let known = format!(
            "{}: the phase {:.4} deg is known to {:.4} deg, and {:.3} deg move a sample by one pixel.",
            axis.name, axis.phase_deg, off, pixel
        );
        if axis.phase_sd_deg.is_some() {
            verdict = if off > pixel {
                verdict.notice(NoticeSeverity::Warning, format!("{known}{}", link("applications")))
            } else {
                verdict.notice(NoticeSeverity::Ok, known)
            };
        }
    }
    if metrics.beyond_grey > 0 {
        let text =
            format!("{} pixels are darker than black or brighter than white, and cut.", metrics.beyond_grey);
        verdict = verdict.notice(NoticeSeverity::Note, text);
    }
    let field: Vec<String> = (metrics.axes.iter())
        .map(|axis| {
            format!(
                "{} from −{:.4} to +{:.4} deg over {} pixels",
                axis.name, axis.half_field_deg, axis.half_field_deg, axis.pixels
            )
        })
        .collect();
    let caption = format!(
        "The image, {}. Black is an intensity of {}, white one of {}.",
        field.join(", "),
        significant(metrics.black),
        significant(metrics.white)
    );
    let (picture, alt) = (preview(&developed.picture), "The image");
    let answer = PageSection::new("Image");
    let answer = match metrics.axes.iter().find(|axis| axis.name == "x").and_then(bar) {
        Some(bar) => answer.raster_with_bar(picture, alt, caption, bar),
        None => answer.raster(picture, alt, caption),
    };
    let answer = match &developed.before {
        Some(before) => answer
            .raster(
                preview(before),
                "The image before the search",
                format!("The same samples at the phases that the search began with, {}.", starts(outcome)),
            )
            .raster(
                difference_preview(&developed.picture, before),
                "The difference of both images",
                "The first image minus the second: grey is no difference, white and black are half of the range of intensities and more.",
            ),
        None => answer,
    };
    let mut evidence = PageSection::new("What it rests on").part(PagePart::Evidence);
    let all = outcome.passes.together();
    evidence = figures.iter().cloned().fold(evidence, PageSection::figure);
    let (counts, white) = counts_preview(all.counts(), all.size());
    let most = all.counts().iter().copied().max().unwrap_or(0);
    evidence = evidence.raster(
        counts,
        "Samples of each pixel",
        format!("How many samples each pixel has: black is none, white {white:.0} or more, and the most are {most}."),
    );
    for (name, picture) in [("grows", &developed.forward), ("falls", &developed.backward)] {
        let caption = format!(
            "The samples that were taken while x {name}; where the phase of x is wrong both differ by a shift."
        );
        evidence = evidence.raster(preview(picture), format!("The image while x {name}"), caption);
    }
    let made = PageSection::made(
        "image",
        env!("CARGO_PKG_VERSION"),
        "`image.png` and its passes have 16 bits; `counts.png` has the counts as they are, which a viewer shows nearly black, and `counts_preview.png` what this page shows; the numbers are in `metrics.json`.",
    );
    let file = toml::to_string(&outcome.image).unwrap_or_else(|e| format!("cannot be written: {e}"));
    let page = Page::new(format!("{}: image along a trajectory", metrics.name), "")
        .with(verdict.notes(metrics.findings.clone()))
        .with(answer)
        .with(evidence.table(axes_table(metrics)))
        .with(
            made.preformatted("All figures", metrics.to_text())
                .preformatted("The image file as it was understood", file),
        );
    explained(page).to_html()
}

/// A bar of 1, 2 or 5 times a power of ten of degrees, a fifth of the field or less.
fn bar(axis: &ImageAxisMetrics) -> Option<(f64, String)> {
    let field = 2.0 * axis.half_field_deg;
    if !(field.is_finite() && field > 0.0) {
        return None;
    }
    let decade = 10_f64.portable_powf((field / 5.0).portable_log10().floor());
    let length =
        [5.0, 2.0, 1.0].map(|steps| steps * decade).into_iter().find(|length| *length <= field / 5.0)?;
    Some((length / field, format!("{} deg", significant(length))))
}

/// The phases that the search began with.
fn starts(outcome: &ImageOutcome) -> String {
    let each = outcome.axes.iter().filter(|axis| axis.found.is_some());
    let each: Vec<String> =
        each.map(|axis| format!("{:.4} deg of {}", axis.start_rad.to_degrees(), axis.name)).collect();
    each.join(" and ")
}

/// The difference of two pictures of one size to look at, grey where there is none.
fn difference_preview(one: &Picture, other: &Picture) -> Vec<u8> {
    let both = one.values().iter().zip(other.values());
    let grey: Vec<f64> = both.map(|(a, b)| 0.5 + (a - b)).collect();
    preview_of(&grey, one.size())
}

/// Counts of samples as a picture to look at, and the number that is white.
fn counts_preview(counts: &[u32], size: [usize; 2]) -> (Vec<u8>, f64) {
    let white = white_of(counts);
    let grey: Vec<f64> = counts.iter().map(|count| f64::from(*count) / white).collect();
    (preview_of(&grey, size), white)
}

/// The number of samples that is shown as white: what 95 of 100 pixels have at most, since the turning points of a scan have so
/// many that all others would be black.
fn white_of(counts: &[u32]) -> f64 {
    let mut sorted = counts.to_vec();
    sorted.sort_unstable();
    let place = sorted.len().saturating_sub(1) * 95 / 100;
    f64::from(sorted.get(place).copied().unwrap_or(1).max(1))
}

/// Root mean square over the parts of the field of view.
fn place_sd_px(axis: &AxisOutcome) -> Option<f64> {
    let pixels_per_rad = f64::from(axis.pixels) / (2.0 * axis.half_field_rad);
    let square = axis.places.iter().map(|part| part.together_rad().powi(2)).sum::<f64>();
    let sd = pixels_per_rad * (square / axis.places.len() as f64).sqrt();
    (sd.is_finite() && sd > 0.0).then_some(sd)
}

/// What is said of the axes.
fn axes_table(metrics: &ImageMetrics) -> TextTable {
    let columns = [
        ColumnHead::text("axis"),
        ColumnHead::number("frequency", "Hz"),
        ColumnHead::number("amplitude", "deg"),
        ColumnHead::number("phase", "deg"),
        ColumnHead::number("sd of the phase", "deg"),
        ColumnHead::number("sd of a sample's place", "pixels"),
        ColumnHead::number("passes differ", "grey, rms"),
        ColumnHead::number("interpolation within", "pixels"),
    ];
    let mut table = TextTable::new("The axes", columns);
    for axis in &metrics.axes {
        let known = |value: Option<f64>| value.map_or_else(|| "–".to_owned(), |value| format!("{value:.4}"));
        table.push([
            axis.name.to_owned(),
            format!("{:.3}", axis.frequency_hz),
            format!("{:.4}", axis.amplitude_deg),
            format!("{:.4}", axis.phase_deg),
            known(axis.phase_sd_deg),
            known(axis.place_sd_px),
            known(axis.passes_differ_rms),
            format!("{:.4}", axis.interpolation_error_px),
        ]);
    }
    table
}

/// What tells one input from another: the image's name and the bytes of its files. Phases are none of it, so that an
/// image tuned by hand takes the place of the one before.
fn input_id(outcome: &ImageOutcome) -> String {
    let files = outcome.sources.iter().map(|source| {
        let digest = source.sha256.get(..12).unwrap_or(&source.sha256);
        format!("{} {digest}", source.file)
    });
    format!("{}: image of {}", outcome.image.name, files.collect::<Vec<_>>().join(", "))
}

#[derive(Serialize)]
struct ImageRecord<'a> {
    timing: RunTiming,
    input: &'a [RecordingSource],
    image: toml::Value,
}
