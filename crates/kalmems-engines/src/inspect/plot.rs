//! A small plot for the terminal, in braille dots: each character is two dots wide and four high.

use super::Envelope;

/// The lines of a plot of the envelope of `length` values in `2·width` points, `width` characters wide and `height` high, without axes. Each column of dots
/// covers what its rows cover, from their lowest to their highest value; what is NaN leaves a gap.
pub(super) fn plot(envelope: &Envelope, length: usize, width: usize, height: usize) -> Vec<String> {
    let (columns, rows) = (2 * width, 4 * height);
    let points = &envelope.points;
    let low = points.iter().map(|p| p.minimum).fold(f64::INFINITY, f64::min);
    let high = points.iter().map(|p| p.maximum).fold(f64::NEG_INFINITY, f64::max);
    let mut cells = vec![vec![0_u8; width]; height];
    let mut before: Option<(usize, usize, usize)> = None;
    for point in points {
        // The inverse of the rounding by which the stretches begin.
        let column = point.first.saturating_mul(columns).div_ceil(length);
        let (mut bottom, mut top) =
            (level(point.minimum, low, high, rows), level(point.maximum, low, high, rows));
        // A steep stretch is drawn up to its neighbour's, so that the eye sees one line.
        let own = (column, bottom, top);
        if let Some((_, lowest, highest)) = before.filter(|(last, ..)| last + 1 == column) {
            bottom = bottom.min(highest + 1);
            top = top.max(lowest.saturating_sub(1));
        }
        before = Some(own);
        for row in bottom..=top {
            // Rows of dots are counted from below, lines of text from above.
            let from_above = rows.saturating_sub(1 + row);
            if let Some(cell) = cells.get_mut(from_above / 4).and_then(|line| line.get_mut(column / 2)) {
                *cell |= dot(column % 2, from_above % 4);
            }
        }
    }
    cells.iter().map(|line| line.iter().map(|bits| char::from(*bits)).map(braille).collect()).collect()
}

/// The row of dots of a value, from 0 at `low` to the last at `high`; the middle where they are the same.
fn level(value: f64, low: f64, high: f64, rows: usize) -> usize {
    // Halves first, as the difference of two numbers can be beyond all numbers.
    let part = (value / 2.0 - low / 2.0) / (high / 2.0 - low / 2.0);
    let part = if part.is_finite() { part.clamp(0.0, 1.0) } else { 0.5 };
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // between 0 and the number of rows
    let row = (part * rows.saturating_sub(1) as f64).round() as usize;
    row
}

/// The bit of a dot in the order of Unicode, where the lowest row was added last.
const fn dot(column: usize, row: usize) -> u8 {
    match (column, row) {
        (0, 3) => 0x40,
        (_, 3) => 0x80,
        (0, row) => 1 << row,
        (_, row) => 8 << row,
    }
}

fn braille(bits: char) -> char {
    char::from_u32(0x2800 + u32::from(bits)).unwrap_or(' ')
}

#[cfg(test)]
mod tests {
    use crate::inspect::envelope;

    fn plot(values: &[f64], width: usize, height: usize) -> Vec<String> {
        super::plot(&envelope(values, 2 * width), values.len(), width, height)
    }

    #[test]
    fn a_ramp_goes_up() {
        assert_eq!(plot(&[0.0, 1.0, 2.0, 3.0], 2, 1), ["⡠⠊"]);
        assert_eq!(plot(&[3.0, 2.0, 1.0, 0.0], 2, 1), ["⠑⢄"]);
    }

    #[test]
    fn a_single_spike_is_seen() {
        let mut values = vec![0.0; 100_000];
        values[70_000] = 1.0;
        assert_eq!(plot(&values, 10, 2), ["⠀⠀⠀⠀⠀⠀⠀⡇⠀⠀", "⣀⣀⣀⣀⣀⣀⣀⣇⣀⣀"]);
    }

    #[test]
    fn a_constant_is_in_the_middle_and_missing_values_are_a_gap() {
        let nan = f64::NAN;
        assert_eq!(plot(&[2.0, 2.0, nan, nan, 2.0, 2.0], 3, 1), ["⠒⠀⠒"]);
        assert_eq!(plot(&[nan; 4], 2, 1), ["⠀⠀"]);
        assert_eq!(plot(&[], 2, 1), ["⠀⠀"]);
        assert_eq!(plot(&[f64::MIN, f64::MAX], 1, 1), ["⡸"]);
    }
}
