//! A drawing as a list of marks, from which the SVG is written.

/// Red, green, blue.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Colour(pub(super) u8, pub(super) u8, pub(super) u8);

/// A rectangle; y points down.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Rect {
    pub(crate) left: f64,
    pub(crate) top: f64,
    pub(crate) width: f64,
    pub(crate) height: f64,
}

impl Rect {
    pub(crate) fn right(&self) -> f64 {
        self.left + self.width
    }

    pub(crate) fn bottom(&self) -> f64 {
        self.top + self.height
    }
}

/// Where a text stands from its point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Anchor {
    Start,
    Middle,
    End,
}

/// How a line is drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Stroke {
    pub(crate) colour: Colour,
    pub(crate) width: f64,
    pub(crate) dashed: bool,
}

/// One thing to draw. Points are in units of the drawing.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum SceneMark {
    Lines { runs: Vec<Vec<[f64; 2]>>, stroke: Stroke },
    Areas { outlines: Vec<Vec<[f64; 2]>>, colour: Colour, opacity: f64 },
    Dots { at: Vec<[f64; 2]>, colour: Colour, radius: f64 },
    Text { at: [f64; 2], text: String, size: f64, colour: Colour, anchor: Anchor, turned: bool },
}

/// Marks that belong together.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct MarkGroup {
    pub(crate) class: &'static str,
    /// What the SVG says about the group: the range of a panel, the label of a series.
    pub(crate) data: Vec<(&'static str, String)>,
    /// What lies outside is not drawn.
    pub(crate) clip: Option<Rect>,
    pub(crate) marks: Vec<SceneMark>,
}

impl MarkGroup {
    pub(crate) fn new(class: &'static str) -> Self {
        Self { class, data: Vec::new(), clip: None, marks: Vec::new() }
    }
}

/// A whole drawing on white.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Scene {
    pub(crate) id: String,
    pub(crate) title: String,
    pub(crate) width: f64,
    pub(crate) height: f64,
    pub(crate) groups: Vec<MarkGroup>,
    /// What leads elsewhere, above all marks.
    pub(crate) links: Vec<SceneLink>,
}

/// A place of a drawing that leads to another part of the page that it is on.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct SceneLink {
    pub(crate) area: Rect,
    pub(crate) text: String,
    pub(crate) anchor: String,
}
