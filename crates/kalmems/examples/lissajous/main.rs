//! Makes the files of `examples/shared_scanner/image.toml`, and the pictures and tables of the book's chapter on images,
//! by simulation.
//!
//!     cargo run --release -p kalmems --example lissajous
//!
//! A folder as an argument gets the figures too. It takes about two minutes.

mod figures;
mod files;
mod scans;
mod searches;

use std::error::Error;
use std::path::Path;

fn main() -> Result<(), Box<dyn Error>> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    files::write(&root.join("examples/shared_scanner"))?;
    let book = root.join("book/src/figures");
    let (mut figures, merit) = figures::run(&book)?;
    std::fs::write(book.join("image_merit.md"), merit)?;
    let (sharpness, table) = searches::run()?;
    std::fs::write(book.join("image_search.md"), table)?;
    figures.push(sharpness);
    for figure in &figures {
        std::fs::write(book.join(format!("{}.svg", figure.id)), figure.to_svg())?;
        if let Some(preview) = std::env::args_os().nth(1) {
            std::fs::write(Path::new(&preview).join(format!("{}.svg", figure.id)), figure.to_svg())?;
        }
    }
    Ok(())
}
