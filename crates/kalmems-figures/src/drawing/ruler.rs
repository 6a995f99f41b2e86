//! Text in figures: how wide it is, and where it may be broken.

use ttf_parser::Face;

/// The font of the figures, `DejaVu` Sans reduced to the characters that they use; see `assets/README.md`.
const FONT: &[u8] = include_bytes!("../../assets/dejavu-sans-subset.ttf");

/// The bundled font. A test makes sure that it can be read.
pub(crate) fn font() -> Option<Face<'static>> {
    Face::parse(FONT, 0).ok()
}

/// Measures text in the bundled font.
pub(crate) struct Ruler {
    face: Option<Face<'static>>,
}

impl Ruler {
    pub(crate) fn new() -> Self {
        Self { face: font() }
    }

    pub(crate) fn width(&self, text: &str, size: f64) -> f64 {
        let em = |c: char| {
            let face = self.face.as_ref()?;
            let advance = face.glyph_hor_advance(face.glyph_index(c).unwrap_or_default())?;
            Some(f64::from(advance) / f64::from(face.units_per_em()))
        };
        text.chars().map(|c| em(c).unwrap_or(0.6) * size).sum()
    }

    /// Breaks text at spaces into lines no wider than `limit`; a longer word is cut with an ellipsis.
    pub(crate) fn wrap(&self, text: &str, size: f64, limit: f64) -> Vec<String> {
        let mut lines: Vec<String> = Vec::new();
        for word in text.split_whitespace() {
            let word = self.cut(word, size, limit);
            if let Some(line) = lines.last_mut() {
                let longer = format!("{line} {word}");
                if self.width(&longer, size) <= limit {
                    *line = longer;
                    continue;
                }
            }
            lines.push(word);
        }
        lines
    }

    /// The text, or its start and an ellipsis where it is wider than `limit`.
    pub(crate) fn cut(&self, text: &str, size: f64, limit: f64) -> String {
        if self.width(text, size) <= limit {
            return text.to_owned();
        }
        let mut start = text.to_owned();
        while start.pop().is_some() {
            let cut = format!("{}…", start.trim_end());
            if self.width(&cut, size) <= limit {
                return cut;
            }
        }
        String::new()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_font_has_what_figures_write() {
        let face = font().unwrap();
        for c in ('!'..='~').chain("±×·−≤≥√°µ–…χ²σθφωΩΔ⁻⁰¹²³⁴⁵⁶⁷⁸⁹₀₁₂→←↑↓≈∞§ÄÖÜäöüßé�".chars())
        {
            assert!(face.glyph_index(c).is_some_and(|glyph| glyph.0 > 0), "{c}");
        }
        assert!(FONT.len() < 80_000);
    }

    #[test]
    fn widths_are_those_of_dejavu_sans() {
        // The advance widths of the font's own table: 2048 per em; `0` has 1303, `i` 569, `M` 1767.
        let ruler = Ruler::new();
        approx::assert_relative_eq!(ruler.width("0iM", 20.48), 13.03 + 5.69 + 17.67, max_relative = 1e-12);
    }

    #[test]
    fn wraps_and_cuts() {
        let ruler = Ruler::new();
        let lines = ruler.wrap("the angle of the mirror against its reference", 12.0, 100.0);
        assert_eq!(lines, ["the angle of the", "mirror against", "its reference"]);
        assert!(lines.iter().all(|line| ruler.width(line, 12.0) <= 100.0));
        assert_eq!(ruler.cut("pneumonoultramicroscopic", 12.0, 60.0), "pneum…");
        assert_eq!(ruler.cut("wide", 12.0, 0.0), "");
    }
}
