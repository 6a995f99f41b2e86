//! What a figure shows, as plain data: panels, axes and series.

use crate::decimate::{DecimatedSignal, Thinning, decimate, decimate_band, is_drawable};
use crate::record::{Record, Track};
use std::sync::Arc;

/// Pixel columns of a figure, and so the columns to which a series is reduced.
const COLUMNS: usize = 800;

/// A figure: one panel or several below each other.
#[derive(Clone, Debug, PartialEq)]
pub struct Figure {
    /// A short name for files and references, such as `phase-error`.
    pub id: String,
    /// The line above the panels; empty for none.
    pub title: String,
    /// What the page prints below the picture.
    pub caption: String,
    /// From top to bottom.
    pub panels: Vec<Panel>,
}

impl Figure {
    /// A figure without panels yet.
    pub fn new(id: impl Into<String>, title: impl Into<String>, caption: impl Into<String>) -> Self {
        Self { id: id.into(), title: title.into(), caption: caption.into(), panels: Vec::new() }
    }

    /// Adds a panel below the others.
    #[must_use]
    pub fn with(mut self, panel: Panel) -> Self {
        self.panels.push(panel);
        self
    }
}

/// One coordinate system with its series.
#[derive(Clone, Debug, PartialEq)]
pub struct Panel {
    /// The horizontal axis.
    pub x: Axis,
    /// The vertical axis.
    pub y: Axis,
    /// Whether it has the same x axis as the panel above it: one range, labelled below the lowest of them.
    pub shares_x: bool,
    /// What is drawn, in the order of the legend.
    pub series: Vec<Series>,
}

impl Panel {
    /// A panel without series yet.
    pub fn new(x: Axis, y: Axis) -> Self {
        Self { x, y, shares_x: false, series: Vec::new() }
    }

    /// Takes the x axis of the panel above.
    #[must_use]
    pub fn sharing_x(mut self) -> Self {
        self.shares_x = true;
        self
    }

    /// Adds a series.
    #[must_use]
    pub fn with(mut self, series: Series) -> Self {
        self.series.push(series);
        self
    }
}

/// How values are placed along an axis.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum AxisScale {
    /// In proportion.
    #[default]
    Linear,
    /// By their logarithm; what is not positive lies below the axis.
    Log,
}

/// A quantity along one side of a panel. Its data are in `unit`; the tick labels take an SI prefix.
#[derive(Clone, Debug, PartialEq)]
pub struct Axis {
    /// The quantity, such as `phase error`.
    pub label: String,
    /// The unit of the data without prefix, such as `s`, `V^2/Hz` or `deg`; empty or `1` for a ratio.
    pub unit: String,
    /// Linear or logarithmic.
    pub scale: AxisScale,
    /// From and to; taken from the data where there is none.
    pub range: Option<[f64; 2]>,
    /// What stands beside the values 0, −1, −2 … in place of numbers; none where the axis has numbers.
    pub names: Vec<String>,
}

impl Axis {
    /// A linear axis over all of the data.
    pub fn new(label: impl Into<String>, unit: impl Into<String>) -> Self {
        let (label, unit) = (label.into(), unit.into());
        Self { label, unit, scale: AxisScale::Linear, range: None, names: Vec::new() }
    }

    /// An axis of things with these names, the first at 0 and each further one below it by 1.
    pub fn of_names(names: impl IntoIterator<Item = String>) -> Self {
        let names: Vec<String> = names.into_iter().collect();
        let range = Some([-(names.len() as f64) + 0.4, 0.6]);
        Self { range, names, ..Self::new("", "") }
    }

    /// Makes it logarithmic.
    #[must_use]
    pub fn log(mut self) -> Self {
        self.scale = AxisScale::Log;
        self
    }

    /// Shows this range only; the figure notes every series that leaves it.
    #[must_use]
    pub fn between(mut self, from: f64, to: f64) -> Self {
        self.range = Some([from, to]);
        self
    }
}

/// What a series stands for. It decides colour and width, the same throughout a report.
///
/// Measured and reference lines are wide and light, what is computed is thin and dark and lies above: where
/// the two agree, both can be seen.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum SeriesRole {
    /// What the sensor gave.
    Measured,
    /// What a model predicts for it.
    Model,
    /// What a filter says.
    Estimate,
    /// An independent measurement of the truth.
    Reference,
    /// What drives the device.
    Input,
    /// A bound, a limit or an interval that a test allows.
    Bound,
    /// Where something failed. Its points are crosses.
    Failure,
    /// Anything else: the next colour that is free.
    Other,
}

/// What is drawn.
#[derive(Clone, Debug, PartialEq)]
pub enum Shape {
    /// A line through the points of each run.
    Line(Vec<Vec<[f64; 2]>>),
    /// Separate points.
    Points(Vec<[f64; 2]>),
    /// The area between a lower and an upper line: x, lower, upper.
    Band(Vec<Vec<[f64; 3]>>),
    /// A horizontal line across the panel.
    Level(f64),
    /// Values over a grid, in colours.
    Map(MapGrid),
}

/// Values over a grid: blue below a level, white at it, vermilion above, and a line where the level is passed.
#[derive(Clone, Debug, PartialEq)]
pub struct MapGrid {
    /// Where the columns are, rising.
    pub x: Vec<f64>,
    /// Where the rows are, rising.
    pub y: Vec<f64>,
    /// One row for each y, with one value for each x. A value that is not finite leaves its cell empty.
    pub values: Vec<Vec<f64>>,
    /// The quantity of the values: the title of the colour bar. With a logarithmic scale the values are decimal logarithms of the quantity.
    pub colours: Axis,
    /// Where the colours part.
    pub level: f64,
}

impl MapGrid {
    pub(crate) fn finite(&self) -> impl Iterator<Item = f64> + '_ {
        self.values.iter().flatten().copied().filter(|value| is_drawable(*value))
    }
}

/// A labelled signal, reduced to what a picture can show when it is made.
#[derive(Clone, Debug, PartialEq)]
pub struct Series {
    label: String,
    role: SeriesRole,
    shape: Shape,
    source_samples: usize,
    gaps: usize,
    not_positive: usize,
    thinning: Thinning,
    record: Option<Arc<Record>>,
    place: Option<SamplesPlace>,
    links: Vec<SeriesLink>,
    colour_place: Option<usize>,
    written: Vec<WrittenPoint>,
}

/// A text that stands in the panel next to a point.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct WrittenPoint {
    /// The point.
    pub(crate) at: [f64; 2],
    /// The text.
    pub(crate) text: String,
}

/// A point of a series, or a cell of a map, that leads to another part of the page.
#[derive(Clone, Debug, PartialEq)]
pub struct SeriesLink {
    /// The point, or the middle of the cell.
    pub at: [f64; 2],
    /// What is there, for the reader who points at it.
    pub text: String,
    /// The part of the page: the name of a row of one of its tables (see [`TextTable::with_anchors`](crate::TextTable::with_anchors)).
    pub anchor: String,
}

/// Where all samples of a series are, in a file beside the page (see [`SamplesWriter`](crate::SamplesWriter)).
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SamplesPlace {
    /// The name of the track.
    pub track: Arc<str>,
    /// Whether the series is the band of the track, and not its value.
    pub is_band: bool,
}

impl Series {
    /// A line through `(x, y)`. A value that is not finite breaks it.
    pub fn line<P>(label: impl Into<String>, role: SeriesRole, points: P) -> Self
    where
        P: IntoIterator<Item = (f64, f64)>,
        P::IntoIter: Clone,
    {
        let points = points.into_iter();
        let record = recorded(points.clone().map(|(x, y)| (x, [y])), [0, 0]);
        Self::reduced((label.into(), role, record), decimate(points, COLUMNS), Shape::Line)
    }

    /// Separate points at `(x, y)`.
    pub fn points<P>(label: impl Into<String>, role: SeriesRole, points: P) -> Self
    where
        P: IntoIterator<Item = (f64, f64)>,
        P::IntoIter: Clone,
    {
        let points = points.into_iter();
        let record = recorded(points.clone().map(|(x, y)| (x, [y])), [0, 0]);
        Self::reduced((label.into(), role, record), decimate(points, COLUMNS), |runs| {
            Shape::Points(runs.concat())
        })
    }

    /// Spans of x, such as times, shaded from a lowest to a highest y. What lies between them is no missing sample.
    pub fn spans(
        label: impl Into<String>,
        role: SeriesRole,
        spans: &[[f64; 2]],
        [low, high]: [f64; 2],
    ) -> Self {
        let corners = spans
            .iter()
            .flat_map(|[from, to]| [(*from, low, high), (*to, low, high), (*to, f64::NAN, f64::NAN)]);
        Self { gaps: 0, ..Self::band(label, role, corners.collect::<Vec<_>>()) }
    }

    /// The area between `lower` and `upper` of `(x, lower, upper)`.
    pub fn band<P>(label: impl Into<String>, role: SeriesRole, points: P) -> Self
    where
        P: IntoIterator<Item = (f64, f64, f64)>,
        P::IntoIter: Clone,
    {
        let points = points.into_iter();
        let record = recorded(points.clone().map(|(x, low, high)| (x, [low, high])), [0, 1]);
        Self::reduced((label.into(), role, record), decimate_band(points, COLUMNS), Shape::Band)
    }

    /// A horizontal line at `y`. One that is not finite is noted and not drawn.
    pub fn level(label: impl Into<String>, role: SeriesRole, y: f64) -> Self {
        let single = decimate([(0.0, y)], 1);
        Self::reduced((label.into(), role, None), single, |_| Shape::Level(y))
    }

    /// Values over a grid, with a colour bar beside the panel; the label is that of the line at the grid's level.
    pub fn map(label: impl Into<String>, grid: MapGrid) -> Self {
        let source_samples = grid.values.iter().map(Vec::len).sum();
        Self {
            label: label.into(),
            role: SeriesRole::Measured,
            source_samples,
            gaps: source_samples - grid.finite().count(),
            not_positive: 0,
            thinning: Thinning::None,
            record: None,
            place: None,
            links: Vec::new(),
            colour_place: None,
            written: Vec::new(),
            shape: Shape::Map(grid),
        }
    }

    /// All that has passed through two channels of a track, as [`of_all`](Self::of_all) has it: a line through its samples where they are
    /// few, else the area between the extremes of groups of them.
    pub fn of_track(label: impl Into<String>, role: SeriesRole, track: &Track, channels: [usize; 2]) -> Self {
        let groups = track.extremes(channels);
        let is_line = channels[0] == channels[1] && track.is_whole();
        let series = if is_line {
            Self::line(label, role, groups.into_iter().map(|(x, low, _)| (x, low)).collect::<Vec<_>>())
        } else {
            Self::band(label, role, groups)
        };
        series.of_all(track, channels)
    }

    /// On a page, all that has passed through two channels of a track stands for this series, of which pictures show a part: a
    /// line or points through one channel (twice the same), or a band from the lower to the upper one.
    #[must_use]
    pub fn of_all(mut self, track: &Track, channels: [usize; 2]) -> Self {
        self.record = track.record(channels).map(Arc::new);
        self
    }

    /// Says where all of its samples are, for a page that has groups of them alone.
    #[must_use]
    pub fn with_samples_in(mut self, place: SamplesPlace) -> Self {
        self.place = Some(place);
        self
    }

    /// On a page, leads from its points to other parts of the page.
    #[must_use]
    pub fn leading_to(mut self, links: Vec<SeriesLink>) -> Self {
        self.links = links;
        self
    }

    /// Has the colour of this place among the free ones, in every panel the same, whatever its role.
    #[must_use]
    pub fn of_colour(mut self, place: usize) -> Self {
        self.colour_place = Some(place);
        self
    }

    /// Separate points, each with a text next to it: above the first, below the second, and so on.
    pub fn written(
        label: impl Into<String>,
        role: SeriesRole,
        points: impl IntoIterator<Item = (f64, f64, String)>,
    ) -> Self {
        let written = points.into_iter().map(|(x, y, text)| WrittenPoint { at: [x, y], text });
        let written: Vec<WrittenPoint> = written.collect();
        let points = written.iter().map(|one| (one.at[0], one.at[1]));
        Self { written: written.clone(), ..Self::points(label, role, points) }
    }

    fn reduced<T>(
        (label, role, record): (String, SeriesRole, Option<Arc<Record>>),
        data: DecimatedSignal<T>,
        shape: impl FnOnce(Vec<Vec<T>>) -> Shape,
    ) -> Self {
        Self {
            label,
            role,
            source_samples: data.samples,
            gaps: data.missing,
            not_positive: data.not_positive,
            thinning: data.thinning,
            record,
            place: None,
            links: Vec::new(),
            colour_place: None,
            written: Vec::new(),
            shape: shape(data.runs),
        }
    }

    /// Its text in the legend; a series without one has no entry there.
    pub fn label(&self) -> &str {
        &self.label
    }

    /// What it stands for.
    pub fn role(&self) -> SeriesRole {
        self.role
    }

    /// The place of its colour among the free ones, if that is stated.
    pub(crate) fn colour_place(&self) -> Option<usize> {
        self.colour_place
    }

    /// What is left to draw.
    pub fn shape(&self) -> &Shape {
        &self.shape
    }

    /// How many samples it was made from.
    pub fn source_samples(&self) -> usize {
        self.source_samples
    }

    /// How many of them are missing: not finite, or beyond 1e300.
    pub fn gaps(&self) -> usize {
        self.gaps
    }

    /// How many of the others are not positive.
    pub(crate) fn not_positive(&self) -> usize {
        self.not_positive
    }

    pub(crate) fn thinning(&self) -> Thinning {
        self.thinning
    }

    /// Where all of its samples are, beside a page.
    pub(crate) fn place(&self) -> Option<&SamplesPlace> {
        self.place.as_ref()
    }

    /// Its texts in the panel.
    pub(crate) fn texts(&self) -> &[WrittenPoint] {
        &self.written
    }

    /// Where it leads to.
    pub(crate) fn links(&self) -> &[SeriesLink] {
        &self.links
    }

    /// What a page has of it to look into.
    pub(crate) fn record(&self) -> Option<&Arc<Record>> {
        self.record.as_ref()
    }
}

/// What is kept of samples.
fn recorded<const N: usize>(
    samples: impl Iterator<Item = (f64, [f64; N])>,
    channels: [usize; 2],
) -> Option<Arc<Record>> {
    let mut track = Track::new(N);
    for (x, values) in samples {
        track.push(x, &values);
    }
    track.record(channels).map(Arc::new)
}
