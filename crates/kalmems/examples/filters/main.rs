//! Makes the figures and tables of the book's chapter on the choice of a filter, by simulation.
//!
//!     cargo run --release --example filters
//!
//! Seeds are 1, 2, 3, … as often as a table says. Times are measured in the run itself: the ratios differ from
//! machine to machine, and by some per cent from run to run. Everything else is the same wherever it runs.
//! A folder as an argument gets the figures too.

mod chance;
mod claims;
mod contest;
mod curvature;
mod drawing;
mod honesty;
mod linear;
mod scanner;

use std::error::Error;
use std::path::Path;

fn main() -> Result<(), Box<dyn Error>> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../book/src/figures");
    std::fs::create_dir_all(&folder)?;
    let ([cost, corrections], table, unscented) = contest::run()?;
    let (curvature, [rates, points], tuning) = curvature::run()?;
    let (claims, drift) = claims::run(&unscented, &tuning)?;
    let figures = [cost, corrections, curvature];
    let tables = [
        ("cost", table),
        ("curvature", rates),
        ("sigma_points", points),
        ("fixed_gain", linear::run()?),
        ("honesty", honesty::run()?),
        ("claims", claims),
        ("gain_drift", drift),
    ];
    for figure in &figures {
        std::fs::write(folder.join(format!("{}.svg", figure.id)), figure.to_svg())?;
        if let Some(preview) = std::env::args_os().nth(1) {
            std::fs::write(Path::new(&preview).join(format!("{}.svg", figure.id)), figure.to_svg())?;
        }
    }
    for (name, table) in tables {
        std::fs::write(folder.join(format!("filters_{name}.md")), table)?;
    }
    println!("written to {}", folder.display());
    Ok(())
}
