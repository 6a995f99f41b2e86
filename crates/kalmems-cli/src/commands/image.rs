//! `kalmems image`.

use crate::args::ImageArguments;
use crate::progress::ProgressDisplay;
use crate::tell::tell;
use crate::{CommandEnding, print_result, target};
use kalmems::applications::ApplicationFile;
use kalmems::applications::image::Image;
use kalmems::applications::image::reconstruct;
use kalmems::applications::image::{DevelopedImage, ImageMetrics, read_grey, write_image};
use kalmems::results::{RunInfo, Work};
use std::time::{Instant, SystemTime};

pub fn run(arguments: &ImageArguments) -> Result<(), CommandEnding> {
    let (started, clock) = (SystemTime::now(), Instant::now());
    let wrong = |e: &dyn std::fmt::Display| CommandEnding::Wrong(e.to_string());
    let mut image = Image::load(&arguments.image).map_err(|e| wrong(&e))?;
    for (axis, phase) in [("x", &arguments.phase_x), ("y", &arguments.phase_y)] {
        if let Some(phase) = phase {
            image.set_phase(axis, phase).map_err(|e| CommandEnding::Wrong(format!("--phase-{axis}: {e}")))?;
        }
    }
    let reference = match &arguments.reference {
        Some(path) => Some((path.as_path(), read_grey(path).map_err(|e| wrong(&e))?)),
        None => None,
    };
    let work = Work::of_file("image", &arguments.image, image.files());
    let output = arguments.folder.begin(&["image", &image.name.to_string()], work)?;
    let bar = ProgressDisplay::default();
    let outcome = reconstruct(&image, &bar)
        .map_err(|e| if e.is_interruption() { CommandEnding::Interrupted } else { wrong(&e) })?;
    drop(bar);
    let developed = DevelopedImage::of(&outcome);
    let reference = reference.as_ref().map(|(path, picture)| (*path, picture));
    let metrics = ImageMetrics::of(&outcome, &developed, reference).map_err(|e| wrong(&e))?;
    let info = RunInfo { started, took: clock.elapsed() };
    write_image(&outcome, &developed, &metrics, &output, info).map_err(|e| wrong(&e))?;
    let out = target::finish(output)?;
    print_result(arguments.json, &metrics, || metrics.to_text())?;
    tell!("results in {}; look at {}", out.display(), out.join("image.png").display());
    Ok(())
}
