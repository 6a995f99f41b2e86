//! The files of the example.

use super::scans::Recorded;
use kalmems::applications::image::{Lissajous, TissueScene};
use std::error::Error;
use std::fmt::Write as _;
use std::path::Path;

/// Writes `image_intensity.csv` and `image_trajectory.csv`: a small image, so that the files are small.
pub fn write(folder: &Path) -> Result<(), Box<dyn Error>> {
    let recorded = Recorded {
        scene: TissueScene::mucosa(1),
        pixels: 100,
        phases_deg: [2.73, -1.6],
        noise: 0.02,
        seed: 1,
        rate_hz: 2e6,
        trajectory_rate_hz: 400e3,
        duration_s: 25e-3,
    };
    let mut text = "intensity_1\n".to_owned();
    for intensity in recorded.intensities().1 {
        writeln!(text, "{intensity:.3}")?;
    }
    std::fs::write(folder.join("image_intensity.csv"), text)?;
    let believed = Lissajous::published(recorded.rate_hz);
    let (time, x) = recorded.trajectory(believed.x);
    let (_, y) = recorded.trajectory(believed.y);
    let mut text = "time_us,x_mrad,y_mrad\n".to_owned();
    for ((t, x), y) in time.iter().zip(x).zip(y) {
        writeln!(text, "{:.1},{:.2},{:.2}", t * 1e6, x * 1e3, y * 1e3)?;
    }
    std::fs::write(folder.join("image_trajectory.csv"), text)?;
    Ok(())
}
