//! Where the panels of a figure lie, what their axes show, and where the legends stand.

use crate::drawing::axis::{Range, Ticks};
use crate::drawing::map::{ColourBar, edges};
use crate::drawing::ruler::Ruler;
use crate::figure::{Axis, AxisScale, Figure, Panel, Series, Shape};
use crate::scene::Rect;

pub(crate) const WIDTH: f64 = 900.0;
pub(crate) const EDGE: f64 = 12.0;
pub(crate) const TITLE_SIZE: f64 = 14.0;
pub(crate) const TITLE_LINE: f64 = 19.0;
pub(crate) const AXIS_SIZE: f64 = 12.0;
pub(crate) const AXIS_LINE: f64 = 15.0;
pub(crate) const TICK_SIZE: f64 = 11.0;
pub(crate) const LEGEND_SIZE: f64 = 11.5;
pub(crate) const LEGEND_LINE: f64 = 18.0;
/// The sample of a line in a legend, and the room after it.
pub(crate) const SWATCH: f64 = 24.0;
const SWATCH_ROOM: f64 = 6.0;
const ENTRY_ROOM: f64 = 22.0;
/// Between the title of the y axis, its labels and the frame.
const LABEL_ROOM: f64 = 13.0;
/// Right of the frame, for half of the last label of the x axis.
const RIGHT: f64 = 28.0;

/// One panel in its place.
pub(crate) struct PanelPlace<'a> {
    pub(crate) panel: &'a Panel,
    pub(crate) frame: Rect,
    /// None where there is nothing to show.
    pub(crate) x: Option<Range>,
    pub(crate) y: Option<Range>,
    pub(crate) x_ticks: Ticks,
    pub(crate) y_ticks: Ticks,
    pub(crate) y_title: Vec<String>,
    /// The right side of the y title, left of all labels.
    pub(crate) y_title_right: f64,
    /// Whether the labels of the x axis stand below this panel.
    pub(crate) labels_x: bool,
    pub(crate) legend: Vec<LegendEntry>,
    /// Beside a map.
    pub(crate) bar: Option<ColourBar>,
    /// Whether both axes have the same scale, as both are the same quantity.
    pub(crate) is_isotropic: bool,
}

/// A series in the legend.
pub(crate) struct LegendEntry {
    /// Which series of the panel.
    pub(crate) series: usize,
    pub(crate) text: String,
    /// The left end of the sample, and the middle of the line.
    pub(crate) at: [f64; 2],
}

impl LegendEntry {
    pub(crate) fn text_at(&self) -> [f64; 2] {
        [self.at[0] + SWATCH + SWATCH_ROOM, self.at[1] + 0.36 * LEGEND_SIZE]
    }
}

/// The panels of a figure in their places.
pub(crate) struct FigureLayout<'a> {
    pub(crate) title: Vec<String>,
    pub(crate) places: Vec<PanelPlace<'a>>,
    pub(crate) bottom: f64,
}

impl<'a> FigureLayout<'a> {
    pub(crate) fn of(figure: &'a Figure, ruler: &Ruler) -> Self {
        let height = match figure.panels.len() {
            0 | 1 => 320.0,
            2 => 220.0,
            _ => 180.0,
        };
        let title = ruler.wrap(&figure.title, TITLE_SIZE, WIDTH - 2.0 * EDGE);
        let axes: Vec<Axes> = shared(&figure.panels).into_iter().flat_map(|g| axes_of(g, height)).collect();

        let labels = axes.iter().flat_map(|a| &a.y_ticks.major).map(|t| ruler.width(&t.label, TICK_SIZE));
        let labels = labels.fold(0.0, f64::max);
        let y_titles: Vec<Vec<String>> =
            axes.iter().map(|a| title_lines(ruler, &a.y_ticks.title, height)).collect();
        let lines = y_titles.iter().map(Vec::len).max().unwrap_or(0);
        let left = (EDGE + lines as f64 * AXIS_LINE + labels + LABEL_ROOM).ceil();
        let bars: Vec<Option<ColourBar>> =
            figure.panels.iter().map(|p| ColourBar::of(p, ruler, height)).collect();
        let right = bars.iter().flatten().map(ColourBar::room).fold(RIGHT, f64::max);
        let width = (WIDTH - left - right).max(100.0);

        let mut top = EDGE + title.len() as f64 * TITLE_LINE;
        let mut places = Vec::new();
        for (((panel, axes), y_title), bar) in figure.panels.iter().zip(axes).zip(y_titles).zip(bars) {
            let (legend, rows) = legend(ruler, panel, [left, top], width);
            top = (top + if rows > 0 { rows as f64 * LEGEND_LINE + 5.0 } else { 10.0 }).ceil();
            let equal_scales = isotropic(panel, &axes, width);
            let [width, height] = equal_scales.unwrap_or([width, height]);
            let frame = Rect { left, top, width, height };
            let x_ticks =
                axes.x.map_or_else(|| Ticks::none(axes.x_axis), |x| x_ticks(ruler, axes.x_axis, x, width));
            top += height + if axes.labels_x { 24.0 + AXIS_LINE + 8.0 } else { 8.0 };
            places.push(PanelPlace {
                panel,
                frame,
                x: axes.x,
                y: axes.y,
                x_ticks,
                y_ticks: axes.y_ticks,
                y_title,
                y_title_right: left - labels - LABEL_ROOM,
                labels_x: axes.labels_x,
                legend,
                bar,
                is_isotropic: equal_scales.is_some(),
            });
        }
        Self { title, places, bottom: top }
    }
}

/// What the axes of a panel show, before it has a place.
struct Axes<'a> {
    x_axis: &'a Axis,
    x: Option<Range>,
    y: Option<Range>,
    y_ticks: Ticks,
    labels_x: bool,
}

/// Panels that follow each other and have one x axis.
fn shared(panels: &[Panel]) -> Vec<&[Panel]> {
    panels.chunk_by(|_, below| below.shares_x).collect()
}

fn axes_of(group: &[Panel], height: f64) -> Vec<Axes<'_>> {
    let Some(last) = group.len().checked_sub(1) else { return Vec::new() };
    let Some(x_axis) = group.first().map(|panel| &panel.x) else { return Vec::new() };
    let x = x_range(group, x_axis);
    group
        .iter()
        .enumerate()
        .map(|(i, panel)| {
            let y = y_range(panel, x);
            Axes {
                x_axis,
                x,
                y,
                y_ticks: y.map_or_else(
                    || Ticks::none(&panel.y),
                    |y| Ticks::new(&panel.y, y, (height / 28.0).floor()),
                ),
                labels_x: i == last,
            }
        })
        .collect()
}

fn x_range(group: &[Panel], axis: &Axis) -> Option<Range> {
    if let Some(range) = Range::fixed(axis) {
        return Some(range);
    }
    let has = |is: fn(&Shape) -> bool| group.iter().flat_map(|panel| &panel.series).any(|s| is(s.shape()));
    // A point on the frame would be drawn half outside; a map fills its panel.
    let has_points = has(|shape| matches!(shape, Shape::Points(_)));
    let margin = if has_points && !has(|shape| matches!(shape, Shape::Map(_))) { 0.015 } else { 0.0 };
    let ends = group.iter().flat_map(|panel| panel.series.iter().flat_map(|one| extent(one, panel)));
    Range::around(axis.scale, ends.map(|[x, _, _]| x), margin)
}

fn y_range(panel: &Panel, x: Option<Range>) -> Option<Range> {
    if let Some(range) = Range::fixed(&panel.y) {
        return Some(range);
    }
    let shown = |px: f64| x.is_some_and(|x| (0.0..=1.0).contains(&x.position(px)));
    let levels = panel.series.iter().filter_map(|s| match s.shape() {
        Shape::Level(y) => Some(*y),
        _ => None,
    });
    let values = panel
        .series
        .iter()
        .flat_map(|one| extent(one, panel))
        .filter(|p| shown(p[0]))
        .flat_map(|p| [p[1], p[2]]);
    // A map fills its panel.
    let margin = if panel.series.iter().any(|s| matches!(s.shape(), Shape::Map(_))) { 0.0 } else { 0.06 };
    Range::around(panel.y.scale, values.chain(levels), margin)
}

/// The size of a panel in which a unit of x is as long as one of y, at most this wide: where both axes are the same quantity, so that a circle
/// is round and a slope of one is diagonal. `None` where they are not, or where one span is much longer than the other.
fn isotropic(panel: &Panel, axes: &Axes, width: f64) -> Option<[f64; 2]> {
    const HEIGHT: f64 = 420.0;
    const LONGEST: f64 = 3.0;
    let Panel { x: x_axis, y: y_axis, shares_x, series } = panel;
    let is_quantity = !matches!(x_axis.unit.as_str(), "" | "1");
    let are_alike = is_quantity && x_axis.unit == y_axis.unit && !shares_x && axes.labels_x;
    let is_flat = series.iter().all(|series| !matches!(series.shape(), Shape::Map(_)));
    let (x, y) = (axes.x?, axes.y?);
    let is_linear = [x.scale, y.scale] == [AxisScale::Linear; 2];
    let ratio = (x.high - x.low) / (y.high - y.low);
    if !(are_alike && is_flat && is_linear && (LONGEST.recip()..=LONGEST).contains(&ratio)) {
        return None;
    }
    let width = width.min(HEIGHT * ratio);
    Some([width, width / ratio])
}

/// All points as x, lowest and highest value; a level has no x and so none. Of a map, the ends of its cells.
pub(crate) fn extent<'a>(series: &'a Series, panel: &Panel) -> Box<dyn Iterator<Item = [f64; 3]> + 'a> {
    match series.shape() {
        Shape::Line(runs) => Box::new(runs.iter().flatten().map(|p| [p[0], p[1], p[1]])),
        Shape::Points(points) => Box::new(points.iter().map(|p| [p[0], p[1], p[1]])),
        Shape::Band(runs) => Box::new(runs.iter().flatten().copied()),
        Shape::Level(_) => Box::new(std::iter::empty()),
        Shape::Map(grid) => {
            let [columns, rows] =
                [(&grid.x, panel.x.scale), (&grid.y, panel.y.scale)].map(|(at, scale)| edges(at, scale));
            let (low, high) = (rows.first().copied(), rows.last().copied());
            let ends = [columns.first().copied(), columns.last().copied()];
            Box::new(ends.into_iter().flatten().filter_map(move |x| Some([x, low?, high?])))
        }
    }
}

/// As many marks as their labels leave room for.
fn x_ticks(ruler: &Ruler, axis: &Axis, range: Range, width: f64) -> Ticks {
    let mut count = (width / 75.0).floor();
    loop {
        let ticks = Ticks::new(axis, range, count);
        let widest = ticks.major.iter().map(|t| ruler.width(&t.label, TICK_SIZE)).fold(0.0, f64::max);
        let fits = ticks.major.windows(2).all(|pair| match pair {
            [a, b] => (range.position(b.at) - range.position(a.at)) * width >= widest + 14.0,
            _ => true,
        });
        if fits || count <= 2.0 {
            return ticks;
        }
        count -= 1.0;
    }
}

/// A title along the y axis, broken so that it is no longer than the panel is high.
fn title_lines(ruler: &Ruler, title: &str, limit: f64) -> Vec<String> {
    // More lines would leave no room for the data.
    const MOST: usize = 6;
    let mut lines = ruler.wrap(title, AXIS_SIZE, limit);
    if lines.len() > MOST {
        let rest = lines.split_off(MOST - 1).join(" ");
        lines.push(ruler.cut(&rest, AXIS_SIZE, limit));
    }
    lines
}

/// The entries in rows from `corner`, and the number of rows.
fn legend(ruler: &Ruler, panel: &Panel, corner: [f64; 2], width: f64) -> (Vec<LegendEntry>, usize) {
    let mut entries = Vec::new();
    let mut rows = 0_usize;
    let mut x = f64::INFINITY;
    for (series, s) in panel.series.iter().enumerate() {
        if s.label().trim().is_empty() {
            continue;
        }
        let text = ruler.cut(s.label().trim(), LEGEND_SIZE, width - SWATCH - SWATCH_ROOM);
        let needed = SWATCH + SWATCH_ROOM + ruler.width(&text, LEGEND_SIZE);
        if x + needed > width {
            rows += 1;
            x = 0.0;
        }
        let y = corner[1] + (rows as f64 - 0.5) * LEGEND_LINE;
        entries.push(LegendEntry { series, text, at: [corner[0] + x, y] });
        x += needed + ENTRY_ROOM;
    }
    (entries, rows)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::figure::SeriesRole;

    fn frame(x: Axis, y: Axis, radii: [f64; 2]) -> (Rect, [Range; 2], bool) {
        let at = |k: u32| f64::from(k) * std::f64::consts::TAU / 200.0;
        let points = (0..=200).map(|k| (1.0 + radii[0] * at(k).cos(), radii[1] * at(k).sin()));
        let panel = Panel::new(x, y).with(Series::line("circle", SeriesRole::Measured, points));
        let figure = Figure::new("circle", "", "").with(panel);
        let place = FigureLayout::of(&figure, &Ruler::new()).places.remove(0);
        (place.frame, [place.x.unwrap(), place.y.unwrap()], place.is_isotropic)
    }

    #[test]
    fn a_circle_of_one_quantity_is_round() {
        for radii in [[1.0, 1.0], [2.0, 1.0], [1.0, 2.5]] {
            let (frame, [x, y], is_isotropic) =
                frame(Axis::new("real", "rad/s"), Axis::new("imaginary", "rad/s"), radii);
            let per_unit = [frame.width / (x.high - x.low), frame.height / (y.high - y.low)];
            assert!(is_isotropic && (per_unit[0] / per_unit[1] - 1.0).abs() < 1e-12, "{per_unit:?}");
            assert!(frame.width <= WIDTH && frame.height <= 420.0 + 1e-9);
        }
    }

    #[test]
    fn other_quantities_and_long_spans_fill_the_width() {
        let wide = |x, y, radii| {
            let (frame, _, is_isotropic) = frame(x, y, radii);
            assert!(!is_isotropic && frame.width > 700.0);
        };
        wide(Axis::new("voltage", "V"), Axis::new("angle", "rad"), [1.0, 1.0]);
        wide(Axis::new("ratio", "1"), Axis::new("ratio", "1"), [1.0, 1.0]);
        wide(Axis::new("real", "V"), Axis::new("error", "V"), [1.0, 1e-3]);
        wide(Axis::new("real", "V").log(), Axis::new("other", "V").log(), [0.5, 0.5]);
    }
}
