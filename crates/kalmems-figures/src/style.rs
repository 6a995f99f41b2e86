//! Colours and line widths. The colours are those of Okabe and Ito, which the colour-blind can tell apart.

use crate::figure::{Panel, Series, SeriesRole, Shape};
use crate::scene::{Colour, Stroke};

/// How the pictures of this crate draw a series, for a program that draws it itself.
#[derive(Clone, Debug, PartialEq)]
pub struct SeriesStyle {
    /// As in HTML, such as `#0072b2`.
    pub colour: String,
    /// The width of a line, in pixels of a picture that is 800 pixels wide.
    pub width: f64,
    /// Whether a line is dashed.
    pub is_dashed: bool,
    /// What has a lower number is drawn first.
    pub layer: u8,
}

impl Panel {
    /// How each series is drawn, in their order.
    pub fn styles(&self) -> Vec<SeriesStyle> {
        let of = |(series, colour): (&Series, Colour)| {
            let Stroke { colour: Colour(red, green, blue), width, dashed } = stroke(series.role(), colour);
            let colour = format!("#{red:02x}{green:02x}{blue:02x}");
            SeriesStyle { colour, width, is_dashed: dashed, layer: layer(series) }
        };
        self.series.iter().zip(colours(&self.series)).map(of).collect()
    }
}

pub(crate) const INK: Colour = Colour(0x22, 0x22, 0x22);
pub(crate) const FAINT_INK: Colour = Colour(0x66, 0x66, 0x66);
pub(crate) const FRAME: Stroke = Stroke { colour: Colour(0x77, 0x77, 0x77), width: 0.8, dashed: false };
pub(crate) const GRID: Stroke = Stroke { colour: Colour(0xe4, 0xe4, 0xe4), width: 0.7, dashed: false };
pub(crate) const BAND_OPACITY: f64 = 0.22;

const BLACK: Colour = Colour(0x00, 0x00, 0x00);
const ORANGE: Colour = Colour(0xe6, 0x9f, 0x00);
const SKY: Colour = Colour(0x56, 0xb4, 0xe9);
const GREEN: Colour = Colour(0x00, 0x9e, 0x73);
const BLUE: Colour = Colour(0x00, 0x72, 0xb2);
const VERMILION: Colour = Colour(0xd5, 0x5e, 0x00);
const PURPLE: Colour = Colour(0xcc, 0x79, 0xa7);
const GREY: Colour = Colour(0x99, 0x99, 0x99);
/// Two of the muted colours of Paul Tol, for panels of more series than Okabe and Ito have colours.
const WINE: Colour = Colour(0x88, 0x22, 0x55);
const TEAL: Colour = Colour(0x44, 0xaa, 0x99);

/// For series whose role has no colour left, in this order. Yellow is missing: it cannot be seen on white.
const FREE: [Colour; 9] = [BLUE, VERMILION, GREEN, PURPLE, SKY, ORANGE, BLACK, WINE, TEAL];

fn colour_of(role: SeriesRole) -> Option<Colour> {
    match role {
        SeriesRole::Measured => Some(GREY),
        SeriesRole::Model => Some(VERMILION),
        SeriesRole::Estimate => Some(BLUE),
        SeriesRole::Reference => Some(ORANGE),
        SeriesRole::Input => Some(GREEN),
        SeriesRole::Bound => Some(PURPLE),
        SeriesRole::Failure => Some(BLACK),
        SeriesRole::Other => None,
    }
}

/// A colour for each series of a panel.
///
/// The first line of a role has its colour and each further one the next that is free. A band has the colour
/// of the line of the same role that it belongs to: the first band that of the first line. A series without a
/// label goes with the one of its role before it. One that states the place of its colour has that.
pub(crate) fn colours(series: &[Series]) -> Vec<Colour> {
    let mut used: Vec<Colour> = series.iter().filter_map(|s| colour_of(s.role())).collect();
    let mut assigned: Vec<(SeriesRole, Vec<Colour>)> = Vec::new();
    let mut counts: Vec<(SeriesRole, bool, usize)> = Vec::new();
    series
        .iter()
        .map(|s| {
            if let Some(place) = s.colour_place() {
                return FREE[place % FREE.len()];
            }
            let is_band = matches!(s.shape(), Shape::Band(_));
            let nth = nth(&mut counts, s.role(), is_band, s.label().trim().is_empty());
            let place = assigned.iter().position(|(role, _)| *role == s.role()).unwrap_or_else(|| {
                assigned.push((s.role(), Vec::new()));
                assigned.len() - 1
            });
            let Some((_, of_role)) = assigned.get_mut(place) else { return BLACK };
            while of_role.len() <= nth {
                let colour = colour_of(s.role())
                    .filter(|_| of_role.is_empty())
                    .or_else(|| FREE.iter().find(|c| !used.contains(c)).copied())
                    // More series than colours: start again.
                    .unwrap_or(FREE[used.len() % FREE.len()]);
                used.push(colour);
                of_role.push(colour);
            }
            of_role.get(nth).copied().unwrap_or(BLACK)
        })
        .collect()
}

/// Which line, or which band, of its role a series is.
fn nth(
    counts: &mut Vec<(SeriesRole, bool, usize)>,
    role: SeriesRole,
    is_band: bool,
    continues: bool,
) -> usize {
    // A band without a label belongs to the line before it.
    let line = counts.iter().find(|(r, band, _)| *r == role && !band);
    if let (true, true, Some((_, _, nth))) = (is_band, continues, line) {
        return *nth;
    }
    if let Some((_, _, nth)) = counts.iter_mut().find(|(r, b, _)| (*r, *b) == (role, is_band)) {
        *nth += usize::from(!continues);
        return *nth;
    }
    counts.push((role, is_band, 0));
    0
}

/// Whether the points of a role are crosses.
pub(crate) fn is_crossed(role: SeriesRole) -> bool {
    role == SeriesRole::Failure
}

/// A cell of a map that has no value.
pub(crate) const NO_VALUE: Colour = Colour(0xd6, 0xd6, 0xd6);

/// Blue to white to vermilion, which the colour-blind can tell apart, over −1 to 1.
pub(crate) fn diverging(position: f64) -> Colour {
    let end = if position < 0.0 { BLUE } else { VERMILION };
    let share = position.abs().min(1.0);
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // between two bytes
    let mix = |end: u8| (255.0 - share * (255.0 - f64::from(end))).round() as u8;
    Colour(mix(end.0), mix(end.1), mix(end.2))
}

/// The line at the level of a map.
pub(crate) const CONTOUR: Stroke = Stroke { colour: INK, width: 1.6, dashed: false };

/// How a line of this role is drawn.
pub(crate) fn stroke(role: SeriesRole, colour: Colour) -> Stroke {
    match role {
        SeriesRole::Measured | SeriesRole::Reference => Stroke { colour, width: 3.2, dashed: false },
        SeriesRole::Bound => Stroke { colour, width: 1.4, dashed: true },
        _ => Stroke { colour, width: 1.4, dashed: false },
    }
}

/// The edge of a band over dense data: darker than any line.
pub(crate) fn band_edge(colour: Colour) -> Stroke {
    let darker = |part: u8| part / 2;
    Stroke { colour: Colour(darker(colour.0), darker(colour.1), darker(colour.2)), width: 0.9, dashed: false }
}

/// Points that are so few are what a line was fitted to, and would be hidden by it.
const FEW: usize = 60;

/// What is drawn first lies below: maps, then bands, then clouds of points, then wide lines, then thin ones, then points.
pub(crate) fn layer(series: &Series) -> u8 {
    match (series.shape(), series.role()) {
        (Shape::Points(_), SeriesRole::Failure) => 8,
        (Shape::Points(points), _) if points.len() <= FEW => 7,
        (Shape::Map(_), _) => 0,
        (Shape::Band(_), SeriesRole::Bound) => 1,
        (Shape::Band(_), _) => 2,
        (Shape::Points(_), SeriesRole::Measured | SeriesRole::Reference) => 3,
        (Shape::Line(_) | Shape::Level(_), SeriesRole::Measured | SeriesRole::Reference) => 4,
        (Shape::Line(_), SeriesRole::Bound) | (Shape::Level(_), _) => 5,
        (Shape::Line(_), _) => 6,
        (Shape::Points(_), _) => 7,
    }
}

/// Many points are drawn smaller.
pub(crate) fn radius(points: usize) -> f64 {
    match points {
        0..=150 => 2.4,
        151..=600 => 1.7,
        _ => 1.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(role: SeriesRole) -> Series {
        Series::line("line", role, [(0.0, 0.0)])
    }

    fn band(role: SeriesRole) -> Series {
        Series::band("band", role, [(0.0, 0.0, 1.0)])
    }

    #[test]
    fn another_program_draws_a_panel_with_these_colours_and_widths() {
        let axis = || crate::Axis::new("time", "s");
        let panel = Panel::new(axis(), axis()).with(line(SeriesRole::Measured)).with(line(SeriesRole::Bound));
        let styles = panel.styles();
        assert_eq!((styles[0].colour.as_str(), styles[0].is_dashed), ("#999999", false));
        assert_eq!((styles[1].colour.as_str(), styles[1].is_dashed), ("#cc79a7", true));
        assert!(styles[0].layer < styles[1].layer && styles[0].width > styles[1].width);
    }

    #[test]
    fn roles_keep_their_colour_and_repeated_ones_get_another() {
        use SeriesRole::{Estimate, Model, Other};
        let series =
            [line(Other), band(Estimate), line(Estimate), line(Estimate), band(Estimate), line(Model)];
        let got = colours(&series);
        assert_eq!(got, [GREEN, BLUE, BLUE, PURPLE, PURPLE, VERMILION]);
        let unnamed = Series::level("", SeriesRole::Bound, 1.0);
        let pair = colours(&[line(SeriesRole::Bound), unnamed]);
        assert_eq!(pair[0], pair[1]);
        let unnamed = || Series::band("", Other, [(0.0, 0.0, 1.0)]);
        let banded = colours(&[line(Other), unnamed(), line(Other), unnamed()]);
        assert!(banded[0] == banded[1] && banded[2] == banded[3] && banded[1] != banded[2]);
        let stated = colours(&[line(Other), line(Estimate).of_colour(1), band(Other).of_colour(1)]);
        assert_eq!(stated[1..], [VERMILION, VERMILION]);
        let many = colours(&vec![line(Other); 20]);
        assert_eq!(many.len(), 20);
        assert!(many.windows(2).all(|pair| pair[0] != pair[1]));
    }
}
