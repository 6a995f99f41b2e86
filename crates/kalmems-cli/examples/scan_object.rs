//! What a detector records of a computed object while a simulated scanner of two axes sweeps a spot over it:
//! intensities along the true motion, from 10 ms on, when it is steady.
//!
//!     cargo run --release -p kalmems-cli --example scan_object -- out/simulated/shared_scanner_two_axes/reference.csv out/intensity.csv

use kalmems::applications::image::TissueScene;
use kalmems::simulate::WhiteNoise;
use std::error::Error;
use std::fmt::Write as _;
use std::path::Path;

/// The angles at the edges of the field of view, in rad.
const HALF_FIELD_RAD: [f64; 2] = [0.18, 0.125];
const FROM_S: f64 = 10e-3;
/// The standard deviation of an intensity between 0 and 1.
const NOISE: f64 = 0.02;

fn main() -> Result<(), Box<dyn Error>> {
    let files: Vec<_> = std::env::args_os().skip(1).collect();
    let [reference, out] = files.as_slice() else {
        return Err(
            "expected two files: the reference.csv of a simulation, and the intensities to write".into()
        );
    };
    scan(reference.as_ref(), out.as_ref())
}

/// Reads the motion of a simulation of `two_axes.toml` and writes an intensity for each sample of it.
pub fn scan(reference: &Path, out: &Path) -> Result<(), Box<dyn Error>> {
    let motion = std::fs::read_to_string(reference)?;
    let mut rows = motion.lines();
    let names: Vec<&str> = rows.next().unwrap_or_default().split(',').collect();
    let place = |name: &str| names.iter().position(|n| *n == name).ok_or(format!("no column `{name}`"));
    let places = [place("time_s")?, place("angle_x_rad")?, place("angle_y_rad")?];
    let object = TissueScene::mucosa(1).without_chart();
    let mut noise = WhiteNoise::new(1, 0);
    let mut text = "time_s,intensity_1\n".to_owned();
    for row in rows {
        let cells: Vec<&str> = row.split(',').collect();
        let mut numbers = [0.0; 3];
        for (number, place) in numbers.iter_mut().zip(places) {
            *number = cells.get(place).ok_or("a row is too short")?.parse()?;
        }
        let [time_s, x, y] = numbers;
        if time_s >= FROM_S {
            let position = [0.5 + 0.5 * x / HALF_FIELD_RAD[0], 0.5 + 0.5 * y / HALF_FIELD_RAD[1]];
            writeln!(text, "{time_s},{:.4}", object.intensity(position) + NOISE * noise.sample())?;
        }
    }
    std::fs::write(out, text)?;
    Ok(())
}
