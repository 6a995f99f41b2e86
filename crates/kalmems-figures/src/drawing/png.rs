//! A drawing as PNG, with the bundled font.

use crate::drawing::error::ReportError;
use crate::drawing::ruler::{Ruler, font};
use crate::scene::{Anchor, Colour, MarkGroup, Rect, Scene, SceneMark};
use ::png::{BitDepth, ColorType, DeflateCompression, Encoder, EncodingError, Filter};
use tiny_skia::{
    FillRule, LineCap, LineJoin, Mask, Paint, Path, PathBuilder, Pixmap, Stroke, StrokeDash, Transform,
};
use ttf_parser::{Face, OutlineBuilder};

/// Pixels per unit of the drawing: 1800 across, enough for print.
const PIXELS: f32 = 2.0;
/// About a square metre of paper.
const HIGHEST: u32 = 16_000;

/// Draws and encodes it.
pub(crate) fn encode(scene: &Scene, figure: &str) -> Result<Vec<u8>, ReportError> {
    let (width, height) = (pixels(scene.width), pixels(scene.height));
    if height > HIGHEST {
        return Err(ReportError::TooHigh { figure: figure.to_owned(), height, limit: HIGHEST });
    }
    let failed = |why: String| ReportError::Png { figure: figure.to_owned(), why };
    let pixmap =
        Pixmap::new(width, height).ok_or_else(|| failed("there is nothing to draw on".to_owned()))?;
    let face = font().ok_or_else(|| failed("the bundled font cannot be read".to_owned()))?;
    let mut canvas = Canvas { pixmap, face, ruler: Ruler::new() };
    canvas.pixmap.fill(tiny_skia::Color::WHITE);
    for group in &scene.groups {
        canvas.group(group);
    }
    compressed(&canvas.pixmap).map_err(|e| failed(e.to_string()))
}

/// The file. Of a plot, compression of level 3 behind the filter `Up` takes half the time of the default and is a little smaller.
fn compressed(pixmap: &Pixmap) -> Result<Vec<u8>, EncodingError> {
    // Drawn on white: no pixel is transparent.
    let colours: Vec<u8> =
        pixmap.pixels().iter().flat_map(|pixel| [pixel.red(), pixel.green(), pixel.blue()]).collect();
    let mut file = Vec::new();
    let mut encoder = Encoder::new(&mut file, pixmap.width(), pixmap.height());
    encoder.set_color(ColorType::Rgb);
    encoder.set_depth(BitDepth::Eight);
    encoder.set_filter(Filter::Up);
    encoder.set_deflate_compression(DeflateCompression::Level(3));
    encoder.write_header()?.write_image_data(&colours)?;
    Ok(file)
}

struct Canvas {
    pixmap: Pixmap,
    face: Face<'static>,
    ruler: Ruler,
}

impl Canvas {
    fn group(&mut self, group: &MarkGroup) {
        let mask = group.clip.and_then(|clip| self.mask(clip));
        for mark in &group.marks {
            self.mark(mark, mask.as_ref());
        }
    }

    fn mask(&self, clip: Rect) -> Option<Mask> {
        let mut mask = Mask::new(self.pixmap.width(), self.pixmap.height())?;
        let rect = tiny_skia::Rect::from_xywh(f(clip.left), f(clip.top), f(clip.width), f(clip.height))?;
        mask.fill_path(&PathBuilder::from_rect(rect), FillRule::Winding, true, scale());
        Some(mask)
    }

    fn mark(&mut self, mark: &SceneMark, mask: Option<&Mask>) {
        match mark {
            SceneMark::Lines { runs, stroke } => {
                let Some(path) = path(runs, false) else { return };
                let dash = if stroke.dashed { StrokeDash::new(vec![6.0, 4.0], 0.0) } else { None };
                let pen = Stroke {
                    width: f(stroke.width),
                    line_join: LineJoin::Round,
                    line_cap: LineCap::Butt,
                    dash,
                    ..Stroke::default()
                };
                self.pixmap.stroke_path(&path, &paint(stroke.colour, 1.0), &pen, scale(), mask);
            }
            SceneMark::Areas { outlines, colour, opacity } => {
                let Some(path) = path(outlines, true) else { return };
                self.fill(&path, *colour, *opacity, mask);
            }
            SceneMark::Dots { at, colour, radius } => {
                let mut builder = PathBuilder::new();
                for point in at {
                    builder.push_circle(f(point[0]), f(point[1]), f(*radius));
                }
                let Some(path) = builder.finish() else { return };
                self.fill(&path, *colour, 1.0, mask);
            }
            SceneMark::Text { at, text, size, colour, anchor, turned } => {
                let width = self.ruler.width(text, *size);
                let start = match anchor {
                    Anchor::Start => 0.0,
                    Anchor::Middle => -width / 2.0,
                    Anchor::End => -width,
                };
                let Some(mut path) = self.outline(text, *size, start) else { return };
                if *turned {
                    let Some(up) = path.transform(Transform::from_rotate(-90.0)) else { return };
                    path = up;
                }
                let Some(path) = path.transform(Transform::from_translate(f(at[0]), f(at[1]))) else {
                    return;
                };
                self.fill(&path, *colour, 1.0, mask);
            }
        }
    }

    fn fill(&mut self, path: &Path, colour: Colour, opacity: f64, mask: Option<&Mask>) {
        self.pixmap.fill_path(path, &paint(colour, opacity), FillRule::Winding, scale(), mask);
    }

    /// The outlines of a line of text, from `start` on the base line. None for blanks.
    fn outline(&self, text: &str, size: f64, start: f64) -> Option<Path> {
        let mut pen = Pen {
            builder: PathBuilder::new(),
            scale: f(size) / f32::from(self.face.units_per_em()),
            x: f(start),
        };
        for c in text.chars() {
            let glyph = self.face.glyph_index(c).unwrap_or_default();
            // None for a blank.
            let _ = self.face.outline_glyph(glyph, &mut pen);
            pen.x += f32::from(self.face.glyph_hor_advance(glyph).unwrap_or_default()) * pen.scale;
        }
        pen.builder.finish()
    }
}

/// Takes the outline of a glyph, whose y points up.
struct Pen {
    builder: PathBuilder,
    scale: f32,
    x: f32,
}

impl Pen {
    fn at(&self, x: f32, y: f32) -> (f32, f32) {
        (self.x + x * self.scale, -y * self.scale)
    }
}

impl OutlineBuilder for Pen {
    fn move_to(&mut self, x: f32, y: f32) {
        let (x, y) = self.at(x, y);
        self.builder.move_to(x, y);
    }

    fn line_to(&mut self, x: f32, y: f32) {
        let (x, y) = self.at(x, y);
        self.builder.line_to(x, y);
    }

    fn quad_to(&mut self, x1: f32, y1: f32, x: f32, y: f32) {
        let ((x1, y1), (x, y)) = (self.at(x1, y1), self.at(x, y));
        self.builder.quad_to(x1, y1, x, y);
    }

    fn curve_to(&mut self, x1: f32, y1: f32, x2: f32, y2: f32, x: f32, y: f32) {
        let ((x1, y1), (x2, y2), (x, y)) = (self.at(x1, y1), self.at(x2, y2), self.at(x, y));
        self.builder.cubic_to(x1, y1, x2, y2, x, y);
    }

    fn close(&mut self) {
        self.builder.close();
    }
}

fn path(runs: &[Vec<[f64; 2]>], closed: bool) -> Option<Path> {
    let mut builder = PathBuilder::new();
    for run in runs {
        let mut points = run.iter();
        let Some(first) = points.next() else { continue };
        builder.move_to(f(first[0]), f(first[1]));
        for point in points {
            builder.line_to(f(point[0]), f(point[1]));
        }
        if closed {
            builder.close();
        }
    }
    builder.finish()
}

fn paint(colour: Colour, opacity: f64) -> Paint<'static> {
    let mut paint = Paint::default();
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // an opacity is between 0 and 1
    let alpha = (opacity * 255.0).round() as u8;
    paint.set_color_rgba8(colour.0, colour.1, colour.2, alpha);
    paint.anti_alias = true;
    paint
}

fn scale() -> Transform {
    Transform::from_scale(PIXELS, PIXELS)
}

#[allow(clippy::cast_possible_truncation)] // coordinates of a picture
fn f(x: f64) -> f32 {
    x as f32
}

#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a cast saturates, and the caller checks
fn pixels(length: f64) -> u32 {
    (length * f64::from(PIXELS)).ceil() as u32
}
