//! From a figure to a drawing.

use crate::decimate::{Thinning, is_drawable};
use crate::drawing::axis::Range;
use crate::drawing::clip;
use crate::drawing::layout::{
    AXIS_LINE, AXIS_SIZE, EDGE, FigureLayout, LEGEND_SIZE, LegendEntry, PanelPlace, SWATCH, TICK_SIZE,
    TITLE_LINE, TITLE_SIZE, WIDTH,
};
use crate::drawing::map::{CellEdges, cells, contour};
use crate::drawing::notes::notes;
use crate::drawing::ruler::Ruler;
use crate::figure::{AxisScale, Figure, MapGrid, Series, SeriesRole, Shape, WrittenPoint};
use crate::scene::{Anchor, Colour, MarkGroup, Rect, Scene, SceneLink, SceneMark, Stroke};
use crate::style::{self, BAND_OPACITY, FAINT_INK, FRAME, GRID, INK};

const NOTE_SIZE: f64 = 10.0;
const NOTE_LINE: f64 = 14.0;
const TICK: f64 = 4.0;
/// How near to a point of a series it is that a click leads from.
const REACH: f64 = 9.0;
/// Points farther out count as this far, so that lines to them can still be cut at the frame.
const FARTHEST: f64 = 1e9;

/// Draws a figure.
pub(crate) fn scene(figure: &Figure) -> Scene {
    let ruler = Ruler::new();
    let layout = FigureLayout::of(figure, &ruler);
    let mut groups = Vec::new();
    groups.push(title(&layout));
    for place in &layout.places {
        groups.extend(panel(place));
    }
    let (group, height) = note_lines(figure, &layout, &ruler);
    groups.push(group);
    groups.retain(|group| !group.marks.is_empty());
    let links = layout.places.iter().flat_map(links).collect();
    Scene { id: figure.id.clone(), title: figure.title.clone(), width: WIDTH, height, groups, links }
}

/// Where a panel leads to: from its cells, or from around its points, the last drawn above.
fn links(place: &PanelPlace<'_>) -> Vec<SceneLink> {
    let Some((x, y)) = place.x.zip(place.y) else { return Vec::new() };
    let map = PointMap { x, y, frame: place.frame };
    let mut links = Vec::new();
    for series in &place.panel.series {
        let grid = match series.shape() {
            Shape::Map(grid) => Some((grid, map.edges(grid))),
            _ => None,
        };
        for link in series.links() {
            let area = match &grid {
                Some((grid, edges)) => edges.cell(grid, link.at),
                None => Some(around([map.x(link.at[0]), map.y(link.at[1])])),
            };
            let seen = area.filter(|area| clip::holds(&clip::guard(&place.frame), &[area.left, area.top]));
            let link = |area| SceneLink { area, text: link.text.clone(), anchor: link.anchor.clone() };
            links.extend(seen.map(link));
        }
    }
    links
}

fn around([x, y]: [f64; 2]) -> Rect {
    Rect { left: x - REACH, top: y - REACH, width: 2.0 * REACH, height: 2.0 * REACH }
}

fn title(layout: &FigureLayout<'_>) -> MarkGroup {
    let left = layout.places.first().map_or(EDGE, |place| place.frame.left);
    let mut group = MarkGroup::new("title");
    for (i, line) in layout.title.iter().enumerate() {
        let at = [left, EDGE + (i as f64 + 0.7) * TITLE_LINE];
        group.marks.push(text(at, line, TITLE_SIZE, INK, Anchor::Start));
    }
    group
}

fn note_lines(figure: &Figure, layout: &FigureLayout<'_>, ruler: &Ruler) -> (MarkGroup, f64) {
    let left = layout.places.first().map_or(EDGE, |place| place.frame.left);
    let mut group = MarkGroup::new("notes");
    let mut y = layout.bottom;
    for note in notes(figure, layout) {
        for line in ruler.wrap(&note, NOTE_SIZE, WIDTH - left - EDGE) {
            y += NOTE_LINE;
            group.marks.push(text([left, y], &line, NOTE_SIZE, FAINT_INK, Anchor::Start));
        }
    }
    let room = if group.marks.is_empty() { 4.0 } else { EDGE };
    (group, (y + room).ceil())
}

fn panel(place: &PanelPlace<'_>) -> Vec<MarkGroup> {
    let colours = style::colours(&place.panel.series);
    let mut groups = vec![grid(place)];
    let mut order: Vec<(&Series, Colour)> = place.panel.series.iter().zip(colours.iter().copied()).collect();
    order.sort_by_key(|(series, _)| style::layer(series));
    let mut empty = true;
    if let (Some(x), Some(y)) = (place.x, place.y) {
        let map = PointMap { x, y, frame: place.frame };
        for (series, colour) in order {
            let group = draw_series(series, colour, &map);
            empty &= group.marks.is_empty();
            groups.push(group);
        }
        groups.push(written(place, &map));
        // Under so many samples a band can no longer be seen.
        if place.panel.series.iter().any(|s| s.thinning() != Thinning::None) {
            groups.push(band_edges(place, &colours, &map));
        }
    }
    groups.push(axes(place));
    groups.extend(place.bar.iter().map(|bar| bar.draw(&place.frame)));
    groups.push(legend(place, &colours));
    if empty {
        let Rect { left, top, width, height } = place.frame;
        let at = [left + width / 2.0, top + height / 2.0];
        let mut group = MarkGroup::new("no-data");
        let has_data = place.panel.series.iter().any(|s| s.gaps() < s.source_samples());
        let words = if has_data { "no data in this range" } else { "no data" };
        group.marks.push(text(at, words, 13.0, FAINT_INK, Anchor::Middle));
        groups.push(group);
    }
    groups
}

/// From values to points of the drawing.
struct PointMap {
    x: Range,
    y: Range,
    frame: Rect,
}

impl PointMap {
    fn x(&self, value: f64) -> f64 {
        along_x(self.x, &self.frame, value)
    }

    fn y(&self, value: f64) -> f64 {
        along_y(self.y, &self.frame, value)
    }

    fn edges(&self, grid: &MapGrid) -> CellEdges {
        CellEdges::of(grid, [self.x.scale, self.y.scale], |x| self.x(x), |y| self.y(y))
    }

    /// Cuts lines far outside of the frame.
    fn cut(&self, runs: Vec<Vec<[f64; 2]>>) -> Vec<Vec<[f64; 2]>> {
        clip::lines(runs, &clip::guard(&self.frame))
    }

    /// Hides what lies outside of the frame, where anything does.
    fn hide_outside(&self, group: &mut MarkGroup) {
        // Rounding may put a point at the end of a range a hair outside.
        let Rect { left, top, width, height } = self.frame;
        let frame = Rect { left: left - 0.01, top: top - 0.01, width: width + 0.02, height: height + 0.02 };
        if !points_of(&group.marks).all(|point| clip::holds(&frame, point)) {
            group.clip = Some(self.frame);
        }
    }
}

fn along_x(range: Range, frame: &Rect, value: f64) -> f64 {
    (frame.left + range.position(value) * frame.width).clamp(-FARTHEST, FARTHEST)
}

fn along_y(range: Range, frame: &Rect, value: f64) -> f64 {
    (frame.bottom() - range.position(value) * frame.height).clamp(-FARTHEST, FARTHEST)
}

fn draw_series(series: &Series, colour: Colour, map: &PointMap) -> MarkGroup {
    let mut group = MarkGroup::new("series");
    let kind;
    let stroke = style::stroke(series.role(), colour);
    match series.shape() {
        Shape::Line(runs) => {
            kind = "line";
            let runs: Vec<Vec<[f64; 2]>> =
                runs.iter().map(|run| run.iter().map(|p| [map.x(p[0]), map.y(p[1])]).collect()).collect();
            line(&mut group, map.cut(runs), stroke);
        }
        Shape::Points(points) => {
            kind = "points";
            let guard = clip::guard(&map.frame);
            let at = points.iter().map(|p| [map.x(p[0]), map.y(p[1])]);
            let at: Vec<[f64; 2]> = at.filter(|point| clip::holds(&guard, point)).collect();
            let radius = style::radius(points.len());
            if !at.is_empty() {
                group.marks.push(dots(at, series.role(), colour, radius));
            }
        }
        Shape::Band(runs) => {
            kind = "band";
            let guard = clip::guard(&map.frame);
            let outlines = runs.iter().map(|run| clip::area(outline(run, map), &guard));
            let outlines: Vec<Vec<[f64; 2]>> = outlines.filter(|outline| !outline.is_empty()).collect();
            if !outlines.is_empty() {
                group.marks.push(SceneMark::Areas { outlines, colour, opacity: BAND_OPACITY });
            }
        }
        Shape::Level(value) => {
            kind = "level";
            if is_drawable(*value) {
                let y = map.y(*value);
                line(&mut group, map.cut(vec![vec![[map.frame.left, y], [map.frame.right(), y]]]), stroke);
            }
        }
        Shape::Map(grid) => {
            kind = "map";
            group.marks = cells(grid, &map.edges(grid));
            let pieces = contour(grid).into_iter();
            let pieces = pieces.map(|run| run.iter().map(|p| [map.x(p[0]), map.y(p[1])]).collect());
            line(&mut group, map.cut(pieces.collect()), style::CONTOUR);
        }
    }
    group.data = vec![
        ("label", series.label().to_owned()),
        ("kind", kind.to_owned()),
        ("samples", series.source_samples().to_string()),
        ("gaps", series.gaps().to_string()),
    ];
    map.hide_outside(&mut group);
    group
}

/// The texts next to points that are in sight: away from the nearer side of the frame, in turns above and below.
fn written(place: &PanelPlace<'_>, map: &PointMap) -> MarkGroup {
    let mut group = MarkGroup::new("written");
    let texts = place.panel.series.iter().flat_map(|series| series.texts().iter().enumerate());
    for (turn, WrittenPoint { at, text: words }) in texts {
        let [x, y] = [map.x(at[0]), map.y(at[1])];
        if !clip::holds(&map.frame, &[x, y]) {
            continue;
        }
        let (aside, anchor) = if x < map.frame.left + 0.6 * map.frame.width {
            (WRITTEN_ASIDE, Anchor::Start)
        } else {
            (-WRITTEN_ASIDE, Anchor::End)
        };
        let down = if turn % 2 == 0 { -WRITTEN_ASIDE } else { WRITTEN_ASIDE + 0.8 * LEGEND_SIZE };
        group.marks.push(text([x + aside, y + down], words, LEGEND_SIZE, INK, anchor));
    }
    group
}

/// From a point to the text next to it.
const WRITTEN_ASIDE: f64 = 6.0;

/// Points as their role has them.
fn dots(at: Vec<[f64; 2]>, role: SeriesRole, colour: Colour, radius: f64) -> SceneMark {
    if !style::is_crossed(role) {
        return SceneMark::Dots { at, colour, radius };
    }
    let arm = 1.8 * radius;
    let cross =
        |[x, y]: [f64; 2]| [-1.0, 1.0].map(|side| vec![[x - arm, y - side * arm], [x + arm, y + side * arm]]);
    SceneMark::Lines { runs: at.into_iter().flat_map(cross).collect(), stroke: style::stroke(role, colour) }
}

/// A run of one sample has no length and becomes a dot.
fn line(group: &mut MarkGroup, runs: Vec<Vec<[f64; 2]>>, stroke: Stroke) {
    let (single, runs): (Vec<_>, Vec<_>) = runs.into_iter().partition(|run| run.len() == 1);
    let at: Vec<[f64; 2]> = single.into_iter().flatten().collect();
    if !runs.is_empty() {
        group.marks.push(SceneMark::Lines { runs, stroke });
    }
    if !at.is_empty() {
        group.marks.push(SceneMark::Dots { at, colour: stroke.colour, radius: stroke.width / 2.0 + 0.4 });
    }
}

/// There along the upper edge and back along the lower one.
fn outline(run: &[[f64; 3]], map: &PointMap) -> Vec<[f64; 2]> {
    // A single sample is drawn one unit wide.
    if let [[x, lower, upper]] = run {
        let (x, lower, upper) = (map.x(*x), map.y(*lower), map.y(*upper));
        return vec![[x - 0.5, upper], [x + 0.5, upper], [x + 0.5, lower], [x - 0.5, lower]];
    }
    let there = run.iter().map(|p| [map.x(p[0]), map.y(p[2])]);
    let back = run.iter().rev().map(|p| [map.x(p[0]), map.y(p[1])]);
    there.chain(back).collect()
}

/// Both edges of every band, above everything else.
fn band_edges(place: &PanelPlace<'_>, colours: &[Colour], map: &PointMap) -> MarkGroup {
    let mut group = MarkGroup::new("band-edges");
    for (series, colour) in place.panel.series.iter().zip(colours) {
        let Shape::Band(runs) = series.shape() else { continue };
        let edges = runs.iter().flat_map(|run| {
            let run = without_steps(run);
            let edge = |side: usize| run.iter().map(|p| [map.x(p[0]), map.y(p[side])]).collect();
            [edge(1), edge(2)]
        });
        line(&mut group, map.cut(edges.collect()), style::band_edge(*colour));
    }
    map.hide_outside(&mut group);
    group
}

/// Where a column has two points at one height, the point between them: an edge without stairs.
fn without_steps(run: &[[f64; 3]]) -> Vec<[f64; 3]> {
    let mut rest = run;
    let mut points = Vec::new();
    while let [first, after @ ..] = rest {
        match after {
            [second, after @ ..] if first[1..] == second[1..] => {
                points.push([f64::midpoint(first[0], second[0]), first[1], first[2]]);
                rest = after;
            }
            _ => {
                points.push(*first);
                rest = after;
            }
        }
    }
    // An edge that is straight from end to end is no step.
    if points.len() < 2 { run.to_vec() } else { points }
}

fn points_of(marks: &[SceneMark]) -> impl Iterator<Item = &[f64; 2]> {
    marks.iter().flat_map(|mark| match mark {
        SceneMark::Lines { runs, .. } | SceneMark::Areas { outlines: runs, .. } => {
            runs.iter().flatten().collect()
        }
        SceneMark::Dots { at, .. } => at.iter().collect(),
        SceneMark::Text { .. } => Vec::new(),
    })
}

fn grid(place: &PanelPlace<'_>) -> MarkGroup {
    let frame = &place.frame;
    let mut group = MarkGroup::new("grid");
    let mut runs = Vec::new();
    if let Some(x) = place.x {
        for tick in &place.x_ticks.major {
            let at = crisp(along_x(x, frame, tick.at));
            runs.push(vec![[at, frame.top], [at, frame.bottom()]]);
        }
    }
    if let Some(y) = place.y {
        for tick in &place.y_ticks.major {
            let at = crisp(along_y(y, frame, tick.at));
            runs.push(vec![[frame.left, at], [frame.right(), at]]);
        }
    }
    if !runs.is_empty() {
        group.marks.push(SceneMark::Lines { runs, stroke: GRID });
    }
    group
}

/// Frame, ticks, labels and titles. The data say which values lie at its edges.
fn axes(place: &PanelPlace<'_>) -> MarkGroup {
    let frame = &place.frame;
    let mut group = MarkGroup::new("axes");
    for (name, range) in [("x", place.x), ("y", place.y)] {
        let Some(range) = range else { continue };
        let (low, high, scale) = match name {
            "x" => ("x-low", "x-high", "x-scale"),
            _ => ("y-low", "y-high", "y-scale"),
        };
        let kind = if range.scale == AxisScale::Log { "log" } else { "linear" };
        group.data.extend([
            (low, format!("{:e}", range.low)),
            (high, format!("{:e}", range.high)),
            (scale, kind.to_owned()),
        ]);
    }
    group.data.extend([
        ("left", frame.left.to_string()),
        ("right", frame.right().to_string()),
        ("top", frame.top.to_string()),
        ("bottom", frame.bottom().to_string()),
    ]);
    let (right, bottom) = (frame.right(), frame.bottom());
    let mut runs = vec![vec![
        [frame.left, frame.top],
        [right, frame.top],
        [right, bottom],
        [frame.left, bottom],
        [frame.left, frame.top],
    ]];
    if let Some(x) = place.x {
        let at = |value| crisp(along_x(x, frame, value));
        for value in &place.x_ticks.minor {
            runs.push(vec![[at(*value), bottom], [at(*value), bottom + TICK / 2.0]]);
        }
        for tick in &place.x_ticks.major {
            let x = at(tick.at);
            runs.push(vec![[x, bottom], [x, bottom + TICK]]);
            if place.labels_x {
                group.marks.push(text([x, bottom + 17.0], &tick.label, TICK_SIZE, INK, Anchor::Middle));
            }
        }
    }
    if let Some(y) = place.y {
        let at = |value| crisp(along_y(y, frame, value));
        for value in &place.y_ticks.minor {
            runs.push(vec![[frame.left - TICK / 2.0, at(*value)], [frame.left, at(*value)]]);
        }
        for tick in &place.y_ticks.major {
            let y = at(tick.at);
            runs.push(vec![[frame.left - TICK, y], [frame.left, y]]);
            let at = [frame.left - 7.0, y + 0.36 * TICK_SIZE];
            group.marks.push(text(at, &tick.label, TICK_SIZE, INK, Anchor::End));
        }
    }
    group.marks.push(SceneMark::Lines { runs, stroke: FRAME });
    titles(&mut group, place);
    group
}

fn titles(group: &mut MarkGroup, place: &PanelPlace<'_>) {
    let frame = &place.frame;
    if place.labels_x {
        let at = [frame.left + frame.width / 2.0, frame.bottom() + 24.0 + AXIS_LINE - 3.0];
        group.marks.push(text(at, &place.x_ticks.title, AXIS_SIZE, INK, Anchor::Middle));
    }
    for (i, line) in place.y_title.iter().enumerate() {
        let above = (place.y_title.len() - i) as f64 - 0.75;
        let at = [place.y_title_right - above * AXIS_LINE, frame.top + frame.height / 2.0];
        let mut mark = text(at, line, AXIS_SIZE, INK, Anchor::Middle);
        if let SceneMark::Text { turned, .. } = &mut mark {
            *turned = true;
        }
        group.marks.push(mark);
    }
}

fn legend(place: &PanelPlace<'_>, colours: &[Colour]) -> MarkGroup {
    let mut group = MarkGroup::new("legend");
    for entry in &place.legend {
        let (Some(series), Some(colour)) = (place.panel.series.get(entry.series), colours.get(entry.series))
        else {
            continue;
        };
        group.marks.push(sample(series, *colour, entry));
        group.marks.push(text(entry.text_at(), &entry.text, LEGEND_SIZE, INK, Anchor::Start));
    }
    group
}

/// A piece of the series as it looks in the panel.
fn sample(series: &Series, colour: Colour, entry: &LegendEntry) -> SceneMark {
    let [x, y] = entry.at;
    match series.shape() {
        Shape::Line(_) | Shape::Level(_) => SceneMark::Lines {
            runs: vec![vec![[x, y], [x + SWATCH, y]]],
            stroke: style::stroke(series.role(), colour),
        },
        Shape::Points(points) => {
            let radius = style::radius(points.len()).max(1.7);
            dots(vec![[x + SWATCH / 2.0, y]], series.role(), colour, radius)
        }
        Shape::Map(_) => {
            SceneMark::Lines { runs: vec![vec![[x, y], [x + SWATCH, y]]], stroke: style::CONTOUR }
        }
        Shape::Band(_) => SceneMark::Areas {
            outlines: vec![vec![[x, y - 5.0], [x + SWATCH, y - 5.0], [x + SWATCH, y + 5.0], [x, y + 5.0]]],
            colour,
            opacity: BAND_OPACITY,
        },
    }
}

fn text(at: [f64; 2], text: &str, size: f64, colour: Colour, anchor: Anchor) -> SceneMark {
    SceneMark::Text { at, text: text.to_owned(), size, colour, anchor, turned: false }
}

/// On whole or half units a thin line is sharp.
fn crisp(x: f64) -> f64 {
    (x * 2.0).round() / 2.0
}
