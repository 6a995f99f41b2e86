//! A drawing as a list of marks, from which the SVG and the PNG are written.

/// Red, green, blue.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Colour(pub(super) u8, pub(super) u8, pub(super) u8);

/// A rectangle; y points down.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Rect {
    pub(super) left: f64,
    pub(super) top: f64,
    pub(super) width: f64,
    pub(super) height: f64,
}

impl Rect {
    pub(super) fn right(&self) -> f64 {
        self.left + self.width
    }

    pub(super) fn bottom(&self) -> f64 {
        self.top + self.height
    }
}

/// Where a text stands from its point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Anchor {
    Start,
    Middle,
    End,
}

/// How a line is drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Stroke {
    pub(super) colour: Colour,
    pub(super) width: f64,
    pub(super) dashed: bool,
}

/// One thing to draw. Points are in units of the drawing.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Mark {
    Lines { runs: Vec<Vec<[f64; 2]>>, stroke: Stroke },
    Areas { outlines: Vec<Vec<[f64; 2]>>, colour: Colour, opacity: f64 },
    Dots { at: Vec<[f64; 2]>, colour: Colour, radius: f64 },
    Text { at: [f64; 2], text: String, size: f64, colour: Colour, anchor: Anchor, turned: bool },
}

/// Marks that belong together.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Group {
    pub(super) class: &'static str,
    /// What the SVG says about the group: the range of a panel, the label of a series.
    pub(super) data: Vec<(&'static str, String)>,
    /// What lies outside is not drawn.
    pub(super) clip: Option<Rect>,
    pub(super) marks: Vec<Mark>,
}

impl Group {
    pub(super) fn new(class: &'static str) -> Self {
        Self { class, data: Vec::new(), clip: None, marks: Vec::new() }
    }
}

/// A whole drawing on white.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Scene {
    pub(super) id: String,
    pub(super) title: String,
    pub(super) width: f64,
    pub(super) height: f64,
    pub(super) groups: Vec<Group>,
}
