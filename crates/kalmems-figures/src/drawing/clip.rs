//! Cuts what lies far outside of a panel, so that one value far away does not make the drawing huge.

use crate::scene::Rect;

/// How far beyond the frame lines still go; what lies outside of the frame itself is hidden.
const ROOM: f64 = 20.0;

/// The frame and some room around it.
pub(crate) fn guard(frame: &Rect) -> Rect {
    Rect {
        left: frame.left - ROOM,
        top: frame.top - ROOM,
        width: frame.width + 2.0 * ROOM,
        height: frame.height + 2.0 * ROOM,
    }
}

/// Whether the point lies inside.
pub(crate) fn holds(rect: &Rect, point: &[f64; 2]) -> bool {
    (rect.left..=rect.right()).contains(&point[0]) && (rect.top..=rect.bottom()).contains(&point[1])
}

/// The pieces of open lines that lie inside.
pub(crate) fn lines(runs: Vec<Vec<[f64; 2]>>, rect: &Rect) -> Vec<Vec<[f64; 2]>> {
    let mut pieces = Vec::new();
    for run in runs {
        if run.iter().all(|point| holds(rect, point)) {
            pieces.push(run);
            continue;
        }
        let mut piece: Vec<[f64; 2]> = Vec::new();
        for pair in run.windows(2) {
            let &[a, b] = pair else { continue };
            let Some((from, to)) = inside(a, b, rect) else { continue };
            if piece.is_empty() {
                piece.push(along(a, b, from));
            }
            piece.push(along(a, b, to));
            if to < 1.0 {
                pieces.push(std::mem::take(&mut piece));
            }
        }
        if !piece.is_empty() {
            pieces.push(piece);
        }
    }
    pieces
}

/// The part of a line from `a` to `b` that lies inside, as shares of its length.
fn inside(a: [f64; 2], b: [f64; 2], rect: &Rect) -> Option<(f64, f64)> {
    let (mut from, mut to) = (0.0_f64, 1.0_f64);
    for (side, bound, sign) in sides(rect) {
        let (start, end) = (sign * (a[side] - bound), sign * (b[side] - bound));
        match (start >= 0.0, end >= 0.0) {
            (true, true) => {}
            (false, false) => return None,
            (false, true) => from = from.max(start / (start - end)),
            (true, false) => to = to.min(start / (start - end)),
        }
    }
    (from < to).then_some((from, to))
}

/// What is left of an area after each side has cut off what lies beyond it.
pub(crate) fn area(outline: Vec<[f64; 2]>, rect: &Rect) -> Vec<[f64; 2]> {
    if outline.iter().all(|point| holds(rect, point)) {
        return outline;
    }
    sides(rect).into_iter().fold(outline, |outline, (side, bound, sign)| {
        let mut kept = Vec::with_capacity(outline.len());
        let mut last = outline.last().copied();
        for b in outline {
            let Some(a) = last.replace(b) else { continue };
            let (start, end) = (sign * (a[side] - bound), sign * (b[side] - bound));
            if (start >= 0.0) != (end >= 0.0) {
                kept.push(along(a, b, start / (start - end)));
            }
            if end >= 0.0 {
                kept.push(b);
            }
        }
        kept
    })
}

/// Coordinate, bound, and the sign of what lies inside.
fn sides(rect: &Rect) -> [(usize, f64, f64); 4] {
    [(0, rect.left, 1.0), (0, rect.right(), -1.0), (1, rect.top, 1.0), (1, rect.bottom(), -1.0)]
}

fn along(a: [f64; 2], b: [f64; 2], share: f64) -> [f64; 2] {
    // Exact at both ends.
    let mix = |a: f64, b: f64| a * (1.0 - share) + b * share;
    [mix(a[0], b[0]), mix(a[1], b[1])]
}

#[cfg(test)]
mod tests {
    use super::*;

    const SQUARE: Rect = Rect { left: 0.0, top: 0.0, width: 10.0, height: 10.0 };

    fn rounded(points: &[[f64; 2]]) -> Vec<[f64; 2]> {
        points.iter().map(|p| p.map(|c| (c * 1e9).round() / 1e9 + 0.0)).collect()
    }

    #[test]
    fn lines_are_cut_at_the_sides() {
        let run = vec![[-5.0, 5.0], [5.0, 5.0], [5.0, 25.0], [8.0, 25.0], [8.0, 5.0], [9.0, 5.0]];
        assert_eq!(
            lines(vec![run], &SQUARE),
            [vec![[0.0, 5.0], [5.0, 5.0], [5.0, 10.0]], vec![[8.0, 10.0], [8.0, 5.0], [9.0, 5.0]]]
        );
        // Through the square without a point inside, and past a corner.
        let through = lines(vec![vec![[-10.0, 5.0], [20.0, 5.0]]], &SQUARE);
        assert_eq!(rounded(&through.concat()), [[0.0, 5.0], [10.0, 5.0]]);
        assert!(lines(vec![vec![[-10.0, 5.0], [5.0, -10.0]]], &SQUARE).is_empty());
        assert!(lines(vec![vec![[20.0, 5.0]]], &SQUARE).is_empty());
    }

    #[test]
    fn areas_are_cut_at_the_sides() {
        // A triangle whose tip lies above: cut where its legs cross the upper side.
        let got = area(vec![[2.0, 8.0], [8.0, 8.0], [5.0, -4.0]], &SQUARE);
        assert_eq!(rounded(&got), [[4.0, 0.0], [2.0, 8.0], [8.0, 8.0], [6.0, 0.0]]);
        assert!(area(vec![[20.0, 20.0], [30.0, 20.0], [30.0, 30.0]], &SQUARE).is_empty());
        assert!(area(Vec::new(), &SQUARE).is_empty());
    }
}
