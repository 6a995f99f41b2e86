//! What a phase error of x does to an image.

use kalmems::applications::image::{
    Lissajous, PhaseAccuracy, Picture, Raster, ShiftHistogram, TissueScene, edge_width, psnr_db,
    structural_similarity,
};
use kalmems::figures::{Axis, Figure, Panel, Series, SeriesRole};
use std::error::Error;
use std::fmt::Write as _;
use std::fs::File;
use std::path::Path;

const PIXELS: usize = 400;
const FRAME_S: f64 = 50e-3;
const RATE_HZ: f64 = 10e6;
/// In degrees: none; what a target of 0.05° leaves; the UKF and the model alone of Chen et al. 2020.
const ERRORS_DEG: [f64; 4] = [0.0, 0.05, 0.38, 2.73];

/// Writes the pictures; the figures, and the table of the figures of merit.
pub fn run(folder: &Path) -> Result<(Vec<Figure>, String), Box<dyn Error>> {
    let scene = TissueScene::mucosa(1);
    let truth = Picture::of_scene([PIXELS; 2], 8, |at| scene.intensity(at));
    let best = image(0.0, |at| scene.intensity(at));
    let mut table =
        "| phase error | largest shift | moved at all | blur of an edge | PSNR to the image without error \
                     | PSNR to the object | SSIM to the object |\n|---|---|---|---|---|---|---|\n"
            .to_owned();
    let mut shifts =
        Panel::new(Axis::new("shift in pixels", "1"), Axis::new("part of the samples", "1").log());
    for degrees in ERRORS_DEG {
        let seen = image(degrees, |at| scene.intensity(at));
        let histogram = histogram(degrees);
        let edge = image(degrees, |[x, _]| ((x - 0.5) / TissueScene::SPOT + 0.5).clamp(0.0, 1.0));
        let db = |value: Option<f64>| match value {
            Some(db) if db.is_finite() => format!("{db:.1} dB"),
            _ => "–".to_owned(),
        };
        writeln!(
            table,
            "| {degrees}° | {} | {:.1} % | {:.1} pixels | {} | {} | {:.3} |",
            histogram.largest(),
            100.0 * (1.0 - histogram.share(0)),
            edge_width(&edge).unwrap_or(f64::NAN),
            db(psnr_db(&seen, &best)),
            db(psnr_db(&seen, &truth)),
            structural_similarity(&seen, &truth).unwrap_or(f64::NAN),
        )?;
        let shares: Vec<(f64, f64)> =
            histogram.counts().map(|(shift, _)| (shift as f64, histogram.share(shift))).collect();
        if degrees > 0.0 {
            shifts = shifts
                .with(Series::points(format!("{degrees}°"), SeriesRole::Other, shares.clone()))
                .with(Series::line("", SeriesRole::Other, shares));
        }
        let name = format!("image_{:03.0}.png", 100.0 * degrees);
        write_zoomed(&seen.crop([125, 125], [150, 150]), 2, &folder.join(name))?;
    }
    writeln!(
        table,
        "\nTarget for one pixel of {PIXELS}: {:.3}° in one pass, {:.3}° between both.",
        PhaseAccuracy::of(400, 1).one_pass_rad.to_degrees(),
        PhaseAccuracy::of(400, 1).both_passes_rad.to_degrees()
    )?;
    let [least, most] = coverage();
    writeln!(
        table,
        "\nThe figure covers {:.1} % of the pixels, {:.1} % to {:.1} % over 24 ways in which the axes' phases lie to each other.",
        100.0 * (1.0 - best.empty() as f64 / (PIXELS * PIXELS) as f64),
        100.0 * least,
        100.0 * most
    )?;
    let shifts = Figure::new("image_shifts", "By how many pixels samples move", "").with(shifts);
    Ok((vec![shifts, against_error()], table))
}

/// The image of an object, with x ahead of where it is believed to be.
fn image(error_deg: f64, object: impl Fn([f64; 2]) -> f64) -> Picture {
    let mut raster = Raster::new([PIXELS; 2]);
    for (believed, real) in spots(error_deg) {
        raster.add(believed, object(real));
    }
    raster.picture()
}

fn histogram(error_deg: f64) -> ShiftHistogram {
    ShiftHistogram::of(spots(error_deg).map(|(believed, real)| (believed[0], real[0])), PIXELS)
}

fn spots(error_deg: f64) -> impl Iterator<Item = ([f64; 2], [f64; 2])> {
    let believed = Lissajous::published(RATE_HZ);
    let real = Lissajous { x: believed.x.ahead_by(error_deg.to_radians()), ..believed };
    let pairs = believed.frame(FRAME_S).zip(real.frame(FRAME_S));
    pairs.map(|(believed, real)| (believed.position, real.position))
}

/// The least and the most that the figure covers, as the phase of x goes through all that makes a difference: its frequency
/// is 1384 times and that of y 327 times what they have in common, so that it repeats every π/327.
fn coverage() -> [f64; 2] {
    let published = Lissajous::published(RATE_HZ);
    let covered = (0..24).map(|k| {
        let phase = f64::from(k) / 24.0 * std::f64::consts::PI / 327.0;
        let mut raster = Raster::new([PIXELS; 2]);
        for spot in (Lissajous { x: published.x.ahead_by(phase), ..published }).frame(FRAME_S) {
            raster.add(spot.position, 0.0);
        }
        raster.coverage()
    });
    covered.fold([1.0, 0.0], |[least, most], c| [c.min(least), c.max(most)])
}

fn against_error() -> Figure {
    let errors = [0.02, 0.05, 0.1, 0.15, 0.2, 0.286, 0.38, 0.573, 1.0, 1.5, 2.0, 2.73, 4.0];
    let mut panel = Panel::new(Axis::new("phase error", "deg").log(), Axis::new("PSNR", "dB"));
    let objects = [
        ("tissue with chart", TissueScene::mucosa(1)),
        ("tissue alone", TissueScene::mucosa(1).without_chart()),
        ("another tissue", TissueScene::mucosa(2).without_chart()),
    ];
    for (label, scene) in objects {
        let best = image(0.0, |at| scene.intensity(at));
        let points: Vec<(f64, f64)> = errors
            .into_iter()
            .filter_map(|error| Some((error, psnr_db(&image(error, |at| scene.intensity(at)), &best)?)))
            .collect();
        panel = panel.with(Series::points(label, SeriesRole::Other, points.clone())).with(Series::line(
            "",
            SeriesRole::Other,
            points,
        ));
    }
    Figure::new("image_psnr", "Against the image without phase error", "").with(panel)
}

/// Grey with 8 bits, each pixel `zoom` wide and high; empty pixels from their neighbours, and black where that fails.
fn write_zoomed(picture: &Picture, zoom: usize, path: &Path) -> Result<(), Box<dyn Error>> {
    let (picture, _) = picture.filled_from_neighbours();
    let [width, height] = picture.size().map(|pixels| pixels * zoom);
    let bytes: Vec<u8> = (0..width * height)
        .map(|i| {
            let value = picture.at(i % width / zoom, i / width / zoom).clamp(0.0, 1.0);
            #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // 0 to 255; NaN becomes 0
            let grey = (value * 255.0).round() as u8;
            grey
        })
        .collect();
    let mut encoder = png::Encoder::new(File::create(path)?, u32::try_from(width)?, u32::try_from(height)?);
    encoder.set_color(png::ColorType::Grayscale);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_compression(png::Compression::High);
    encoder.write_header()?.write_image_data(&bytes)?;
    Ok(())
}
