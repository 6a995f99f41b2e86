//! A drawing as SVG.

use crate::scene::{Anchor, Colour, MarkGroup, Scene, SceneLink, SceneMark};
use crate::text::escape;
use std::fmt::Write as _;

/// The bundled font where it is installed, and the one whose widths are nearest where it is not.
const FONT_FAMILY: &str = "DejaVu Sans, Verdana, sans-serif";

/// The drawing as one `svg` element. Coordinates have two decimals.
pub(crate) fn write(scene: &Scene) -> String {
    document(scene, &[])
}

/// The same with what leads to other parts of the page that it stands on.
pub(crate) fn write_with_links(scene: &Scene) -> String {
    document(scene, &scene.links)
}

fn document(scene: &Scene, links: &[SceneLink]) -> String {
    // Of an image no part can be reached.
    let role = if links.is_empty() { "img" } else { "group" };
    let (width, height) = (number(scene.width), number(scene.height));
    let mut out = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" \
         viewBox=\"0 0 {width} {height}\" role=\"{role}\" aria-label=\"{}\" data-figure=\"{}\" \
         font-family=\"{FONT_FAMILY}\" style=\"font-kerning:none\">\n\
         <rect width=\"{width}\" height=\"{height}\" fill=\"#fff\"/>\n",
        escape(&scene.title),
        escape(&scene.id),
    );
    for group in &scene.groups {
        write_group(&mut out, group);
    }
    for link in links {
        write_link(&mut out, link);
    }
    out.push_str("</svg>\n");
    out
}

/// A place that can be clicked. The table that it leads to is what the keyboard reaches.
fn write_link(out: &mut String, SceneLink { area, text, anchor }: &SceneLink) {
    let [x, y, width, height] = [area.left, area.top, area.width, area.height].map(number);
    let text = escape(text);
    push(
        out,
        format_args!(
            "<a href=\"#{}\" tabindex=\"-1\" aria-label=\"{text}\"><title>{text}</title>\
             <rect x=\"{x}\" y=\"{y}\" width=\"{width}\" height=\"{height}\" fill=\"#000\" fill-opacity=\"0\"/></a>\n",
            escape(anchor),
        ),
    );
}

fn write_group(out: &mut String, group: &MarkGroup) {
    // A nested drawing hides what lies outside of it, and needs no name that two figures could share.
    let element = if group.clip.is_some() { "svg" } else { "g" };
    push(out, format_args!("<{element} class=\"{}\"", group.class));
    if let Some(clip) = group.clip {
        let [x, y, w, h] = [clip.left, clip.top, clip.width, clip.height].map(number);
        push(
            out,
            format_args!(
                " x=\"{x}\" y=\"{y}\" width=\"{w}\" height=\"{h}\" viewBox=\"{x} {y} {w} {h}\" \
                 overflow=\"hidden\""
            ),
        );
    }
    for (name, value) in &group.data {
        push(out, format_args!(" data-{name}=\"{}\"", escape(value)));
    }
    out.push_str(">\n");
    for mark in &group.marks {
        write_mark(out, mark);
    }
    push(out, format_args!("</{element}>\n"));
}

fn write_mark(out: &mut String, mark: &SceneMark) {
    match mark {
        SceneMark::Lines { runs, stroke } => {
            let dashes = if stroke.dashed { " stroke-dasharray=\"6 4\"" } else { "" };
            push(
                out,
                format_args!(
                    "<path fill=\"none\" stroke=\"{}\" stroke-width=\"{}\" stroke-linejoin=\"round\"{dashes} \
                     d=\"{}\"/>\n",
                    hex(stroke.colour),
                    number(stroke.width),
                    path(runs, false),
                ),
            );
        }
        SceneMark::Areas { outlines, colour, opacity } => push(
            out,
            format_args!(
                "<path fill=\"{}\" fill-opacity=\"{}\" d=\"{}\"/>\n",
                hex(*colour),
                number(*opacity),
                path(outlines, true),
            ),
        ),
        SceneMark::Dots { at, colour, radius } => {
            let mut d = String::new();
            for point in at {
                push(&mut d, format_args!("M{} {}h0", number(point[0]), number(point[1])));
            }
            push(
                out,
                format_args!(
                    "<path fill=\"none\" stroke=\"{}\" stroke-width=\"{}\" stroke-linecap=\"round\" \
                     d=\"{d}\"/>\n",
                    hex(*colour),
                    number(2.0 * radius),
                ),
            );
        }
        SceneMark::Text { at, text, size, colour, anchor, turned } => {
            let anchor = match anchor {
                Anchor::Start => "",
                Anchor::Middle => " text-anchor=\"middle\"",
                Anchor::End => " text-anchor=\"end\"",
            };
            let (x, y) = (number(at[0]), number(at[1]));
            let turn = if *turned { format!(" transform=\"rotate(-90 {x} {y})\"") } else { String::new() };
            push(
                out,
                format_args!(
                    "<text x=\"{x}\" y=\"{y}\" font-size=\"{}\" fill=\"{}\"{anchor}{turn}>{}</text>\n",
                    number(*size),
                    hex(*colour),
                    escape(text),
                ),
            );
        }
    }
}

/// Moves to the start of each run and on from point to point, in whole hundredths so that nothing adds up.
fn path(runs: &[Vec<[f64; 2]>], closed: bool) -> String {
    let mut d = String::new();
    for run in runs {
        let mut points = run.iter().map(|p| [hundredths(p[0]), hundredths(p[1])]);
        let Some(mut last) = points.next() else { continue };
        push(&mut d, format_args!("M{} {}", decimal(last[0]), decimal(last[1])));
        let mut separator = 'l';
        for point in points {
            if point == last {
                continue;
            }
            push(
                &mut d,
                format_args!("{separator}{} {}", decimal(point[0] - last[0]), decimal(point[1] - last[1])),
            );
            separator = ' ';
            last = point;
        }
        if closed {
            d.push('z');
        }
    }
    d
}

pub(crate) fn hex(colour: Colour) -> String {
    format!("#{:02x}{:02x}{:02x}", colour.0, colour.1, colour.2)
}

#[allow(clippy::cast_possible_truncation)] // coordinates are bounded where the drawing is made
fn hundredths(x: f64) -> i64 {
    (x * 100.0).round() as i64
}

fn number(x: f64) -> String {
    decimal(hundredths(x))
}

/// Hundredths without a zero that says nothing: `-50` is `-.5`.
fn decimal(hundredths: i64) -> String {
    let sign = if hundredths < 0 { "-" } else { "" };
    let (whole, part) = (hundredths.unsigned_abs() / 100, hundredths.unsigned_abs() % 100);
    let whole = if whole == 0 && part > 0 { String::new() } else { whole.to_string() };
    match (part, part % 10) {
        (0, _) => format!("{sign}{whole}"),
        (_, 0) => format!("{sign}{whole}.{}", part / 10),
        _ => format!("{sign}{whole}.{part:02}"),
    }
}

fn push(out: &mut String, text: std::fmt::Arguments<'_>) {
    // Writing to a String cannot fail.
    let _ = out.write_fmt(text);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_short() {
        for (x, text) in [
            (0.0, "0"),
            (-0.001, "0"),
            (0.5, ".5"),
            (-0.5, "-.5"),
            (-0.05, "-.05"),
            (12.0, "12"),
            (12.345_6, "12.35"),
            (-100.1, "-100.1"),
        ] {
            assert_eq!(number(x), text);
        }
    }

    #[test]
    fn paths_do_not_drift() {
        let run: Vec<[f64; 2]> =
            (0..1000).map(|i| [f64::from(i) * 0.333, f64::from(i % 7) * 0.777]).collect();
        let d = path(std::slice::from_ref(&run), false);
        let mut numbers =
            d.split(['M', 'l', ' ']).filter(|t| !t.is_empty()).map(|t| t.parse::<f64>().unwrap());
        let mut at = [0.0, 0.0];
        for point in run {
            for (coordinate, expected) in at.iter_mut().zip(point) {
                *coordinate += numbers.next().unwrap();
                assert!((*coordinate - expected).abs() < 0.006);
            }
        }
    }
}
