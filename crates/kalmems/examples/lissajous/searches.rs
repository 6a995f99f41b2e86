//! How well the phase of the sharpest image is the true one.

use super::scans::Recorded;
use kalmems::applications::image::{Sharpness, TissueScene, search_phases};
use kalmems::figures::{Axis, Figure, Panel, Series, SeriesRole};
use kalmems::progress::Silent;
use std::error::Error;
use std::fmt::Write as _;

/// The truth in degrees; that of x is by how much Chen et al. 2020 had to tune it.
const PHASES_DEG: [f64; 2] = [-0.745, 1.3];
const SEEDS: u64 = 6;
const RANGE_DEG: f64 = 5.0;

fn recorded(scene: TissueScene, pixels: usize, noise: f64, seed: u64) -> Recorded {
    Recorded {
        scene,
        pixels,
        phases_deg: PHASES_DEG,
        noise,
        seed,
        rate_hz: 10e6,
        trajectory_rate_hz: 1e6,
        duration_s: 50e-3,
    }
}

/// The measures against phase as a figure, and the errors of the search as a table.
pub fn run() -> Result<(Figure, String), Box<dyn Error>> {
    let mut table =
        "| object | noise | error of x, rms (largest) | claimed | error of y, rms (largest) | claimed |\n\
                     |---|---|---|---|---|---|\n"
            .to_owned();
    for (name, chart, noise) in
        [("tissue with chart", true, 0.05), ("tissue alone", false, 0.05), ("tissue alone", false, 0.2)]
    {
        let (mut squares, mut largest, mut claimed) = ([0.0; 2], [0.0_f64; 2], [0.0; 2]);
        for seed in 1..=SEEDS {
            let scene = TissueScene::mucosa(seed);
            let scene = if chart { scene } else { scene.without_chart() };
            let scan = recorded(scene, 400, noise, seed).scan()?;
            let range = Some(RANGE_DEG.to_radians());
            let found = search_phases(&scan, [0.0; 2], [range; 2], Sharpness::WithinPixel, &Silent)?.found;
            for axis in 0..2 {
                let Some(found) = found[axis] else { continue };
                let error = found.phase_rad.to_degrees() - PHASES_DEG[axis];
                squares[axis] += error * error / SEEDS as f64;
                largest[axis] = largest[axis].max(error.abs());
                claimed[axis] += found.sd_rad.to_degrees() / SEEDS as f64;
            }
        }
        write!(table, "| {name} | {noise} ")?;
        for axis in 0..2 {
            let rms = f64::sqrt(squares[axis]);
            write!(table, "| {rms:.4}° ({:.4}°) | {:.4}° ", largest[axis], claimed[axis])?;
        }
        writeln!(table, "|")?;
    }
    Ok((measures()?, table))
}

/// Each measure as the phase of x goes through the truth, that of y being 1.3° off and then right.
fn measures() -> Result<Figure, Box<dyn Error>> {
    let mut figure = Figure::new("image_sharpness", "Measures of sharpness, the true phase at −0.745°", "");
    let phases: Vec<f64> = (-25..=25).map(|i| f64::from(i) * 0.2).collect();
    for (index, (sharpness, name, pixels)) in [
        (Sharpness::WithinPixel, "within pixels, 200 × 200", 200),
        (Sharpness::PassMismatch, "between passes, 200 × 200", 200),
        (Sharpness::Gradient, "−gradient, 200 × 200", 200),
        (Sharpness::Gradient, "−gradient, 400 × 400", 400),
    ]
    .into_iter()
    .enumerate()
    {
        let scan = recorded(TissueScene::mucosa(1).without_chart(), pixels, 0.05, 1).scan()?;
        let mut panel = Panel::new(Axis::new("phase of x", "deg"), Axis::new(name, "1"));
        if index > 0 {
            panel = panel.sharing_x();
        }
        for (label, y) in [("y right", PHASES_DEG[1]), ("y 1.3° off", 0.0)] {
            let label = if index == 0 { label } else { "" };
            let points: Vec<(f64, f64)> = phases
                .iter()
                .map(|x| {
                    let (passes, _) = scan.reconstruct([x.to_radians(), f64::to_radians(y)], 0);
                    (*x, sharpness.of(&passes))
                })
                .collect();
            let role = if y == 0.0 { SeriesRole::Model } else { SeriesRole::Estimate };
            panel = panel.with(Series::line(label, role, points));
        }
        figure = figure.with(panel);
    }
    Ok(figure)
}
