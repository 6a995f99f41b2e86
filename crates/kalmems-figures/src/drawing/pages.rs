//! Figures of more panels than a sheet of paper takes, over several sheets.

use crate::drawing::layout::FigureLayout;
use crate::drawing::ruler::Ruler;
use crate::figure::Figure;

/// The height of a sheet in units of the drawing, 900 of which are its width.
const SHEET: f64 = 4_000.0;

impl Figure {
    /// The same on as many sheets as it takes, each with whole panels: itself where one is enough.
    ///
    /// The first sheet keeps the figure's name and its caption, the others get `_2`, `_3` and so on behind it. A panel that
    /// shares its x axis with one on the sheet before has one of its own.
    #[must_use]
    pub fn pages(self) -> Vec<Self> {
        let ruler = Ruler::new();
        let layout = FigureLayout::of(&self, &ruler);
        let ends: Vec<f64> = layout.places.iter().map(|place| place.frame.top + place.frame.height).collect();
        let (mut sheets, mut first_of_sheet, mut top) = (Vec::new(), 0, 0.0);
        for (panel, end) in ends.iter().enumerate() {
            if end - top > SHEET && panel > first_of_sheet {
                sheets.push(first_of_sheet..panel);
                (first_of_sheet, top) = (panel, ends[panel - 1]);
            }
        }
        sheets.push(first_of_sheet..ends.len());
        let count = sheets.len();
        if count == 1 {
            return vec![self];
        }
        let Self { id, title, caption, mut panels } = self;
        let mut pages = Vec::with_capacity(count);
        for (sheet, number) in sheets.into_iter().zip(1..) {
            let mut rest = panels.split_off(sheet.len());
            std::mem::swap(&mut panels, &mut rest);
            if let Some(first) = rest.first_mut() {
                first.shares_x = false;
            }
            let (id, caption) = match number {
                1 => (id.clone(), caption.clone()),
                _ => (format!("{id}_{number}"), String::new()),
            };
            let title = format!("{title} ({number} of {count})").trim_start().to_owned();
            pages.push(Self { id, title, caption, panels: rest });
        }
        pages
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Axis, Panel, Series, SeriesRole};

    fn figure(panels: usize) -> Figure {
        (0..panels).fold(Figure::new("angle_error", "Angle error", "What it shows."), |figure, n| {
            let panel = Panel::new(Axis::new("time", "s"), Axis::new(format!("filter {n}"), "deg"));
            let panel = panel.with(Series::line("", SeriesRole::Estimate, [(0.0, 0.0), (1.0, 1.0)]));
            figure.with(if n == 0 { panel } else { panel.sharing_x() })
        })
    }

    #[test]
    fn every_panel_is_on_one_sheet_that_can_be_drawn_whatever_their_number() {
        assert_eq!(figure(12).pages(), [figure(12)]);
        for panels in [38, 100] {
            let pages = figure(panels).pages();
            assert!(pages.len() > 1);
            let names: Vec<&str> = pages
                .iter()
                .flat_map(|page| page.panels.iter().map(|panel| panel.y.label.as_str()))
                .collect();
            let whole = figure(panels);
            assert_eq!(names, whole.panels.iter().map(|panel| panel.y.label.as_str()).collect::<Vec<_>>());
            assert_eq!(pages[1].id, "angle_error_2");
            for page in &pages {
                assert!(!page.panels[0].shares_x);
                assert!(page.to_svg().starts_with("<svg"));
            }
        }
    }
}
