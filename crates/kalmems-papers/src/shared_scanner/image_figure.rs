//! What errors of the phase do to an image.

use super::published::{s_figure_10, s_table_iii};
use crate::program::{Check, Item, ItemHead, ItemKind, PaperPlace, PartWork, ReproduceError, ValueOrigin};
use kalmems_applications::image::{
    Lissajous, Picture, Raster, ShiftHistogram, TissueScene, edge_width, preview, psnr_db,
};
use kalmems_figures::significant;
use kalmems_figures::{Axis, ColumnHead, Figure, Panel, Series, SeriesRole, TextTable};

/// S Figure 10.
pub static HEAD: ItemHead = ItemHead {
    key: "figure-10",
    title: "images of 400 × 400 pixels with errors of the phase of x",
    kind: ItemKind::Figure,
    places: &[PaperPlace { paper: "S", label: "Figure 10", page: "section IV-C" }],
    origin: ValueOrigin::Measured,
};

const PIXELS: usize = 400;
const RATE_HZ: f64 = 10e6;
const FRAME_S: f64 = 50e-3;

/// The four images of the figure.
#[allow(clippy::unnecessary_wraps)] // the signature of every part
pub fn run(_: &PartWork) -> Result<Vec<Item>, ReproduceError> {
    let drifted = s_figure_10::CALIBRATED_DEG - s_figure_10::TUNED_DEG;
    let errors = [
        ("tuned by hand (10b)", 0.0),
        ("UKF (10d)", s_table_iii::UKF.phase),
        ("without adjustment (10a)", drifted),
        ("model alone (10c)", s_table_iii::MODEL.phase),
    ];
    let scene = TissueScene::mucosa(1);
    let best = image(0.0, |at| scene.intensity(at));
    let mut table = TextTable::new(
        "Error of the phase of x, and what it does",
        [
            ColumnHead::text("image"),
            ColumnHead::number("phase error", "deg"),
            ColumnHead::number("largest shift", "pixels"),
            ColumnHead::number("blur of an edge", "pixels"),
            ColumnHead::number("PSNR", "dB"),
        ],
    );
    let mut profile = Panel::new(Axis::new("pixel", ""), Axis::new("mean of the rows", ""));
    let (mut blurs, mut pictures) = (Vec::new(), Vec::new());
    for (name, degrees) in errors {
        let seen = image(degrees, |at| scene.intensity(at));
        let edge = image(degrees, |[x, _]| ((x - 0.5) / TissueScene::SPOT + 0.5).clamp(0.0, 1.0));
        let blur = edge_width(&edge).unwrap_or(f64::NAN);
        blurs.push(blur);
        let shifts = spots(degrees).map(|(believed, real)| (believed[0], real[0]));
        let largest = ShiftHistogram::of(shifts, PIXELS).largest();
        let psnr = psnr_db(&seen, &best).filter(|db| db.is_finite());
        table.push([
            name.to_owned(),
            significant(degrees),
            largest.to_string(),
            significant(blur),
            psnr.map_or_else(|| "–".to_owned(), significant),
        ]);
        profile = profile.with(Series::line(name, SeriesRole::Other, across(&edge)));
        let shows = format!(
            "{name}: the computed object with an error of {} deg of the phase of x.",
            significant(degrees)
        );
        pictures.push((preview(&seen), shows));
    }
    let item = pictures.into_iter().fold(Item::new(&HEAD), |item, (png, shows)| item.picture(png, shows));
    let item = item
        .check(Check::claim(
            "the UKF's error leaves a noticeably sharper image than the model's alone",
            "noticeable reduction of blur",
            format!("an edge {} pixels wide against {}", significant(blurs[1]), significant(blurs[3])),
            "an edge less than half as wide",
            blurs[1] < 0.5 * blurs[3],
        ))
        .check(Check::claim(
            "the image without adjustment has noticeable blur",
            "noticeable",
            format!("an edge {} pixels wide against {} when tuned", significant(blurs[2]), significant(blurs[0])),
            "an edge more than 1.5 times as wide",
            blurs[2] > 1.5 * blurs[0],
        ))
        .remark(
            "The paper's image is a mouse's colon; ours is computed, so that the PSNR is that of another object. How \
             far samples move and how wide an edge becomes does not depend on it. `kalmems image` finds the phase of \
             the sharpest image by itself, which the paper does by hand.",
        )
        .table(table)
        .figure(
            Figure::new(
                "figure-10_edge",
                "An upright edge in the middle of the image",
                "The mean of all rows. Forward and backward passes move to opposite sides, so that an edge becomes two.",
            )
            .with(profile),
        );
    Ok(vec![item])
}

/// Where samples are believed to be and where they are, x being ahead by an error.
fn spots(error_deg: f64) -> impl Iterator<Item = ([f64; 2], [f64; 2])> {
    let believed = Lissajous::published(RATE_HZ);
    let real = Lissajous { x: believed.x.ahead_by(error_deg.to_radians()), ..believed };
    let pairs = believed.frame(FRAME_S).zip(real.frame(FRAME_S));
    pairs.map(|(believed, real)| (believed.position, real.position))
}

fn image(error_deg: f64, object: impl Fn([f64; 2]) -> f64) -> Picture {
    let mut raster = Raster::new([PIXELS; 2]);
    for (believed, real) in spots(error_deg) {
        raster.add(believed, object(real));
    }
    raster.picture()
}

/// The mean over the rows of the columns around the middle; empty pixels do not count.
fn across(picture: &Picture) -> Vec<(f64, f64)> {
    const AROUND: usize = 30;
    (PIXELS / 2 - AROUND..PIXELS / 2 + AROUND)
        .filter_map(|column| {
            let filled = (0..PIXELS).map(|row| picture.at(column, row)).filter(|v| v.is_finite());
            let (sum, count) = filled.fold((0.0, 0.0), |(s, n), v| (s + v, n + 1.0));
            (count > 0.0).then_some((column as f64, sum / count))
        })
        .collect()
}
