//! Maps: cells in the colours of their values, the line at a level, and the colour bar.

use crate::decimate::is_drawable;
use crate::drawing::axis::{Range, Ticks};
use crate::drawing::layout::{AXIS_LINE, AXIS_SIZE, TICK_SIZE};
use crate::drawing::ruler::Ruler;
use crate::figure::{Axis, AxisScale, MapGrid, Panel, Shape};
use crate::scene::{Anchor, Colour, MarkGroup, Rect, SceneMark};
use crate::style::{self, FRAME, INK};

/// Colours between the lowest and the highest value.
const STEPS: u32 = 40;
/// The colour bar: its distance from the frame, its width, and the room between it and its labels.
const BAR_GAP: f64 = 14.0;
const BAR_WIDTH: f64 = 14.0;
const LABEL_GAP: f64 = 7.0;

/// The colour bar of a panel with a map.
pub(crate) struct ColourBar {
    range: Range,
    level: f64,
    ticks: Ticks,
    widest: f64,
}

impl ColourBar {
    /// For the first map of a panel, if it has one with values.
    pub(crate) fn of(panel: &Panel, ruler: &Ruler, height: f64) -> Option<Self> {
        let grid = panel.series.iter().find_map(|series| match series.shape() {
            Shape::Map(grid) => Some(grid),
            _ => None,
        })?;
        let range = range(grid)?;
        let ticks = ticks(&grid.colours, range, (height / 28.0).floor());
        let widest = ticks.major.iter().map(|tick| ruler.width(&tick.label, TICK_SIZE)).fold(0.0, f64::max);
        Some(Self { range, level: grid.level, ticks, widest })
    }

    /// The room right of the frame.
    pub(crate) fn room(&self) -> f64 {
        BAR_GAP + BAR_WIDTH + LABEL_GAP + self.widest + 6.0 + AXIS_LINE
    }

    /// Right of a panel's frame.
    pub(crate) fn draw(&self, frame: &Rect) -> MarkGroup {
        let mut group = MarkGroup::new("colour-bar");
        let kind = [("low", self.range.low), ("high", self.range.high), ("level", self.level)];
        group.data = kind.map(|(name, value)| (name, format!("{value:e}"))).to_vec();
        let (left, right) = (frame.right() + BAR_GAP, frame.right() + BAR_GAP + BAR_WIDTH);
        let at = |value: f64| frame.bottom() - self.range.position(value) * frame.height;
        for (from, colour) in steps(self.range, self.level) {
            // Up to the top, so that the next lies on it and no seam is left.
            let outline = [[left, at(from)], [right, at(from)], [right, frame.top], [left, frame.top]];
            group.marks.push(SceneMark::Areas { outlines: vec![outline.to_vec()], colour, opacity: 1.0 });
        }
        let (top, bottom) = (frame.top, frame.bottom());
        let mut runs = vec![vec![[left, top], [right, top], [right, bottom], [left, bottom], [left, top]]];
        let mut labels = Vec::new();
        for tick in &self.ticks.major {
            let y = at(tick.at);
            runs.push(vec![[right, y], [right + 4.0, y]]);
            labels.push(label(
                [right + LABEL_GAP, y + 0.36 * TICK_SIZE],
                &tick.label,
                TICK_SIZE,
                Anchor::Start,
            ));
        }
        group.marks.push(SceneMark::Lines { runs, stroke: FRAME });
        group.marks.append(&mut labels);
        let title = [right + LABEL_GAP + self.widest + AXIS_LINE, frame.top + frame.height / 2.0];
        let mut title = label(title, &self.ticks.title, AXIS_SIZE, Anchor::Middle);
        if let SceneMark::Text { turned, .. } = &mut title {
            *turned = true;
        }
        group.marks.push(title);
        group
    }
}

fn label(at: [f64; 2], text: &str, size: f64, anchor: Anchor) -> SceneMark {
    SceneMark::Text { at, text: text.to_owned(), size, colour: INK, anchor, turned: false }
}

/// The marks of a colour bar: on a logarithmic one the values, whose logarithms are the cells.
fn ticks(colours: &Axis, range: Range, count: f64) -> Ticks {
    if colours.scale == AxisScale::Linear {
        return Ticks::new(colours, range, count);
    }
    let [low, high] = [range.low, range.high].map(|end| libm::pow(10.0, end));
    let mut ticks = Ticks::new(colours, Range { scale: AxisScale::Log, low, high }, count);
    ticks.major.iter_mut().for_each(|tick| tick.at = libm::log10(tick.at));
    ticks
}

/// From the lowest to the highest value.
fn range(grid: &MapGrid) -> Option<Range> {
    Range::around(AxisScale::Linear, grid.finite(), 0.0)
}

/// The lower end of each step of colour, and the colour. Equal distances from the level are equally dark.
fn steps(range: Range, level: f64) -> impl Iterator<Item = (f64, Colour)> {
    let farthest = (range.high - level).abs().max((range.low - level).abs());
    let step = (range.high - range.low) / f64::from(STEPS);
    (0..STEPS).map(move |k| {
        let from = range.low + step * f64::from(k);
        (from, style::diverging((from + 0.5 * step - level) / farthest))
    })
}

/// The cells of a map: for each colour all that is at least so high, so that the next colour lies on it and no seam is
/// left between cells.
/// What has no value lies below all of them.
pub(crate) fn cells(grid: &MapGrid, edges: &CellEdges) -> Vec<SceneMark> {
    let Some(range) = range(grid) else { return Vec::new() };
    let missing = areas(grid, edges, style::NO_VALUE, |value| !is_drawable(value));
    let coloured = steps(range, grid.level).enumerate().filter_map(|(k, (from, colour))| {
        areas(grid, edges, colour, |value| is_drawable(value) && (k == 0 || value >= from))
    });
    missing.into_iter().chain(coloured).collect()
}

/// All cells whose values are such, in one colour.
fn areas(
    grid: &MapGrid,
    edges: &CellEdges,
    colour: Colour,
    is_in: impl Fn(f64) -> bool,
) -> Option<SceneMark> {
    let mut outlines = Vec::new();
    for (row, edge) in grid.values.iter().zip(edges.rows.windows(2)) {
        let (bottom, top) = (edge[0], edge[1]);
        let mut at = 0;
        for run in row.chunk_by(|a, b| is_in(*a) == is_in(*b)) {
            let ends = edges.columns.get(at).zip(edges.columns.get(at + run.len()));
            at += run.len();
            let drawn = ends.filter(|_| run.first().is_some_and(|value| is_in(*value)));
            if let Some((&left, &right)) = drawn {
                outlines.push(vec![[left, bottom], [right, bottom], [right, top], [left, top]]);
            }
        }
    }
    (!outlines.is_empty()).then_some(SceneMark::Areas { outlines, colour, opacity: 1.0 })
}

/// Where the cells of a map end, as they are drawn.
pub(crate) struct CellEdges {
    columns: Vec<f64>,
    rows: Vec<f64>,
}

impl CellEdges {
    pub(crate) fn of(
        grid: &MapGrid,
        [x_scale, y_scale]: [AxisScale; 2],
        x: impl Fn(f64) -> f64,
        y: impl Fn(f64) -> f64,
    ) -> Self {
        let columns = edges(&grid.x, x_scale).into_iter().map(x).collect();
        Self { columns, rows: edges(&grid.y, y_scale).into_iter().map(y).collect() }
    }

    /// The cell that has this for its middle.
    pub(crate) fn cell(&self, grid: &MapGrid, at: [f64; 2]) -> Option<Rect> {
        let pair = |edges: &[f64], middles: &[f64], middle: f64| {
            let place = middles.iter().position(|known| *known == middle)?;
            Some([*edges.get(place)?, *edges.get(place + 1)?])
        };
        let [left, right] = pair(&self.columns, &grid.x, at[0])?;
        let [bottom, top] = pair(&self.rows, &grid.y, at[1])?;
        Some(Rect { left, top, width: right - left, height: bottom - top })
    }
}

/// Between neighbours, and as far beyond the first and the last as there is between them and their neighbours: every cell is whole. On a
/// logarithmic axis by ratios, so that cells that are equally large look so.
pub(crate) fn edges(at: &[f64], scale: AxisScale) -> Vec<f64> {
    let is_log = scale == AxisScale::Log;
    let at: Vec<f64> = at.iter().map(|value| if is_log { libm::log10(*value) } else { *value }).collect();
    let between: Vec<f64> = at.windows(2).map(|pair| pair[0].midpoint(pair[1])).collect();
    let first = at.first().zip(between.first()).map(|(at, edge)| at - (edge - at));
    let last = at.last().zip(between.last()).map(|(at, edge)| at + (at - edge));
    let all = first.into_iter().chain(between).chain(last);
    all.map(|edge| if is_log { libm::pow(10.0, edge) } else { edge }).collect()
}

/// Where the values pass the level: a piece in each cell between four neighbours, straight between them.
pub(crate) fn contour(grid: &MapGrid) -> Vec<Vec<[f64; 2]>> {
    let mut pieces = Vec::new();
    for (ys, rows) in grid.y.windows(2).zip(grid.values.windows(2)) {
        let ([low, high], [below, above]) = (ys, rows) else { continue };
        for (xs, (a, b)) in grid.x.windows(2).zip(below.windows(2).zip(above.windows(2))) {
            let ([left, right], [v00, v10], [v01, v11]) = (xs, a, b) else { continue };
            let corners =
                [([*left, *low], v00), ([*right, *low], v10), ([*right, *high], v11), ([*left, *high], v01)];
            if corners.iter().any(|(_, value)| !is_drawable(**value)) {
                continue;
            }
            let mut crossings = Vec::new();
            for (k, (from, start)) in corners.iter().enumerate() {
                let (to, end) = &corners[(k + 1) % 4];
                if (**start >= grid.level) != (**end >= grid.level) {
                    let share = (grid.level - **start) / (**end - **start);
                    crossings.push([0, 1].map(|i| from[i] + share * (to[i] - from[i])));
                }
            }
            pieces.extend(crossings.chunks_exact(2).map(<[_]>::to_vec));
        }
    }
    pieces
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grid(value: impl Fn(f64, f64) -> f64) -> MapGrid {
        let at: Vec<f64> = (0..=40).map(|i| -2.0 + 0.1 * f64::from(i)).collect();
        let values = at.iter().map(|y| at.iter().map(|x| value(*x, *y)).collect()).collect();
        MapGrid { x: at.clone(), y: at, values, colours: Axis::new("height", "m"), level: 0.0 }
    }

    /// Of x² + y² − 1 it is the circle, all the way round.
    #[test]
    fn the_line_at_the_level_is_where_the_level_is() {
        let pieces = contour(&grid(|x, y| x * x + y * y - 1.0));
        let length: f64 = pieces.iter().map(|p| (p[1][0] - p[0][0]).hypot(p[1][1] - p[0][1])).sum();
        assert!((length - std::f64::consts::TAU).abs() < 0.02, "{length}");
        assert!(pieces.iter().flatten().all(|p| (p[0].hypot(p[1]) - 1.0).abs() < 0.003));
    }

    /// The area that ends up in a colour is that of the values it stands for.
    #[test]
    fn cells_have_the_colour_of_their_value() {
        let grid = grid(|x, _| if x > 1.5 { f64::NAN } else { x });
        let edges = CellEdges::of(&grid, [AxisScale::Linear; 2], |x| x, |y| y);
        let marks = cells(&grid, &edges);
        let area = |mark: &SceneMark| match mark {
            SceneMark::Areas { outlines, .. } => {
                outlines.iter().map(|o| (o[1][0] - o[0][0]) * (o[2][1] - o[1][1])).sum::<f64>()
            }
            _ => f64::NAN,
        };
        // Cells are whole at the ends: what has no value reaches from 1.55 to 2.05, all others begin at −2.05; what is at least 0 begins at
        // −0.05 or 0.05.
        assert!((area(&marks[0]) - 0.5 * 4.1).abs() < 1e-9, "{}", area(&marks[0]));
        assert!((area(&marks[1]) - 3.6 * 4.1).abs() < 1e-9, "{}", area(&marks[1]));
        let step = marks[1..].iter().zip(steps(range(&grid).unwrap(), 0.0));
        for (mark, (from, colour)) in step.skip(1) {
            let SceneMark::Areas { colour: drawn, .. } = mark else { panic!() };
            assert!(*drawn == colour && (area(mark) / 4.1 - (1.55 - from)).abs() < 0.101, "{from}");
            let is_blue = colour.2 > colour.0;
            assert!((from + 0.05).abs() < 0.09 || is_blue == (from < 0.0), "{from} {colour:?}");
        }
    }

    #[test]
    fn cells_are_whole_on_either_scale() {
        assert_eq!(edges(&[1.0, 2.0, 4.0], AxisScale::Linear), [0.5, 1.5, 3.0, 5.0]);
        let found = edges(&[1.0, 100.0, 1e4], AxisScale::Log);
        for (found, expected) in found.iter().zip([0.1, 10.0, 1e3, 1e5]) {
            assert!((found / expected - 1.0).abs() < 1e-12, "{found}");
        }
        assert!(edges(&[], AxisScale::Linear).is_empty());
    }
}
