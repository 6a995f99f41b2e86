//! Grey pictures as PNG, and back.

use crate::image::Picture;
use png::{BitDepth, ColorType, Decoder, Encoder, Transformations};
use std::fs::File;
use std::io::{self, BufReader, Write};
use std::path::{Path, PathBuf};

/// Why a picture cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum PictureError {
    /// It is no PNG, or none that can be read.
    #[error("cannot read the picture {}: {why}; expected a grey PNG of 8 or 16 bits", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        why: String,
    },
    /// It cannot be compared.
    #[error(
        "the picture {} is {} × {} pixels, the image {} × {}; expected one of the same size",
        path.display(), found[0], found[1], expected[0], expected[1]
    )]
    Size {
        /// The file.
        path: PathBuf,
        /// Its width and height.
        found: [usize; 2],
        /// Those of the image.
        expected: [usize; 2],
    },
}

/// Writes grey values from 0 to 1 with 16 bits; what is beyond is cut. Empty pixels are transparent.
pub fn write_grey(picture: &Picture, w: &mut dyn Write) -> io::Result<()> {
    let mut bytes = Vec::with_capacity(picture.values().len() * 4);
    for value in picture.values() {
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // 0 to 65535; NaN becomes 0
        let grey = (value.clamp(0.0, 1.0) * 65_535.0).round() as u16;
        bytes.extend(grey.to_be_bytes());
        bytes.extend(if value.is_nan() { [0; 2] } else { [255; 2] });
    }
    encode(picture.size(), ColorType::GrayscaleAlpha, &bytes, w)
}

/// Writes numbers as grey values of 16 bits; larger ones than 65535 are white.
pub(super) fn write_counts(counts: &[u32], size: [usize; 2], w: &mut dyn Write) -> io::Result<()> {
    let grey = counts.iter().map(|count| u16::try_from(*count).unwrap_or(u16::MAX));
    let bytes: Vec<u8> = grey.flat_map(u16::to_be_bytes).collect();
    encode(size, ColorType::Grayscale, &bytes, w)
}

/// A picture as a PNG file of 8 bits, to be looked at on a page; what is none is transparent. Nothing where it has no pixels.
pub fn preview(picture: &Picture) -> Vec<u8> {
    preview_of(picture.values(), picture.size())
}

/// Grey values from 0 to 1, row by row.
pub(super) fn preview_of(values: &[f64], size: [usize; 2]) -> Vec<u8> {
    let mut png = Vec::new();
    // Memory takes all that is written, and a picture of no pixels is none.
    if write_preview(values, size, &mut png).is_err() {
        png.clear();
    }
    png
}

fn write_preview(values: &[f64], size: [usize; 2], w: &mut dyn Write) -> io::Result<()> {
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // 0 to 255; NaN becomes 0
    let grey =
        |value: &f64| [(value.clamp(0.0, 1.0) * 255.0).round() as u8, if value.is_nan() { 0 } else { 255 }];
    let bytes: Vec<u8> = values.iter().flat_map(grey).collect();
    encode_with(size, (ColorType::GrayscaleAlpha, BitDepth::Eight), &bytes, w)
}

fn encode(size: [usize; 2], colour: ColorType, bytes: &[u8], w: &mut dyn Write) -> io::Result<()> {
    encode_with(size, (colour, BitDepth::Sixteen), bytes, w)
}

fn encode_with(
    size: [usize; 2],
    (colour, depth): (ColorType, BitDepth),
    bytes: &[u8],
    w: &mut dyn Write,
) -> io::Result<()> {
    let side = |pixels| u32::try_from(pixels).map_err(io::Error::other);
    let mut encoder = Encoder::new(w, side(size[0])?, side(size[1])?);
    encoder.set_color(colour);
    encoder.set_depth(depth);
    encoder.write_header()?.write_image_data(bytes)?;
    Ok(())
}

/// Reads a grey picture as values from 0 to 1; NaN where it is fully transparent.
pub fn read_grey(path: &Path) -> Result<Picture, PictureError> {
    let refuse = |why: String| PictureError::Read { path: path.to_owned(), why };
    let failed = |e: png::DecodingError| refuse(e.to_string());
    let file = File::open(path).map_err(|e| refuse(e.to_string()))?;
    let mut decoder = Decoder::new(BufReader::new(file));
    decoder.set_transformations(Transformations::EXPAND);
    let mut reader = decoder.read_info().map_err(failed)?;
    let length = reader.output_buffer_size().ok_or_else(|| refuse("it is too large".to_owned()))?;
    let mut bytes = vec![0; length];
    let info = reader.next_frame(&mut bytes).map_err(failed)?;
    let channels = match info.color_type {
        ColorType::Grayscale => 1,
        ColorType::GrayscaleAlpha => 2,
        other => return Err(refuse(format!("it is of the colour type {other:?}"))),
    };
    let values: Vec<f64> = match info.bit_depth {
        BitDepth::Sixteen => {
            bytes.chunks_exact(2).map(|b| f64::from(u16::from_be_bytes([b[0], b[1]])) / 65_535.0).collect()
        }
        _ => bytes.iter().map(|b| f64::from(*b) / 255.0).collect(),
    };
    let empty = |pixel: &[f64]| pixel.get(1).is_some_and(|alpha| *alpha == 0.0);
    let pixels = values.chunks_exact(channels).map(|p| if empty(p) { f64::NAN } else { p[0] }).collect();
    let size = [info.width as usize, info.height as usize];
    Picture::new(size, pixels).ok_or_else(|| refuse("it has not as many pixels as it says".to_owned()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_picture_comes_back_with_its_holes() {
        let picture = Picture::new([3, 2], vec![0.0, 1.0, f64::NAN, 0.25, 0.5, 2.0]).unwrap();
        let path = tempfile::tempdir().unwrap();
        let file = path.path().join("a.png");
        write_grey(&picture, &mut File::create(&file).unwrap()).unwrap();
        let back = read_grey(&file).unwrap();
        assert_eq!(back.size(), [3, 2]);
        for (a, b) in picture.values().iter().zip(back.values()) {
            assert!(a.is_nan() && b.is_nan() || (a.min(1.0) - b).abs() < 1.0 / 65_535.0, "{a} {b}");
        }
        std::fs::write(&file, "no picture").unwrap();
        assert!(read_grey(&file).unwrap_err().to_string().contains("expected a grey PNG"));
    }
}
