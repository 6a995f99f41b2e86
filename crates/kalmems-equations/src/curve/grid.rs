//! Surfaces through points on a grid.

use super::spline::{bends, weights};
use crate::description::CurveExtension;

/// The tensor product of two cubic splines ([`super::Curve`]) through points on a grid: its first and second derivatives by either argument, and
/// the mixed one, are continuous, and a product of cubics is reproduced exactly.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Grid {
    x: Vec<f64>,
    y: Vec<f64>,
    /// At each point, row by row of equal x: the value, its second derivatives by x and by y, and the fourth by x twice and y twice.
    nodes: Vec<[f64; 4]>,
}

/// The orders of the derivatives that are computed together.
pub(crate) const GROUPS: [[[u8; 2]; 3]; 2] = [[[0, 0], [1, 0], [0, 1]], [[2, 0], [1, 1], [0, 2]]];

impl Grid {
    /// Through values at rising places, row by row of equal x.
    pub(super) fn through(x: Vec<f64>, y: Vec<f64>, z: &[f64]) -> Self {
        let columns = y.len();
        let mut nodes: Vec<[f64; 4]> = z.iter().map(|value| [*value, 0.0, 0.0, 0.0]).collect();
        let bend =
            |nodes: &mut Vec<[f64; 4]>, places: &[f64], [first, step]: [usize; 2], [of, to]: [usize; 2]| {
                let values: Vec<f64> = (0..places.len()).map(|k| nodes[first + k * step][of]).collect();
                for (k, bend) in bends(places, &values).into_iter().enumerate() {
                    nodes[first + k * step][to] = bend;
                }
            };
        for column in 0..columns {
            bend(&mut nodes, &x, [column, columns], [0, 1]);
        }
        for row in 0..x.len() {
            bend(&mut nodes, &y, [row * columns, 1], [0, 2]);
            bend(&mut nodes, &y, [row * columns, 1], [1, 3]);
        }
        Self { x, y, nodes }
    }

    /// The three derivatives of a group of [`GROUPS`] at a point.
    pub(super) fn at(&self, [x, y]: [f64; 2], group: usize, outside: CurveExtension) -> [f64; 3] {
        let (Some((row, along_x)), Some((column, along_y))) =
            (weights(&self.x, x, outside), weights(&self.y, y, outside))
        else {
            return [f64::NAN; 3];
        };
        let orders = GROUPS.get(group).copied().unwrap_or_default();
        orders.map(|[i, j]| {
            let (of_x, of_y) = (&along_x[usize::from(i)], &along_y[usize::from(j)]);
            let mut sum = 0.0;
            for (p, weight_x) in of_x.iter().enumerate() {
                let start = (row + p % 2) * self.y.len() + column;
                let kind = p / 2;
                sum += weight_x
                    * (of_y[0] * self.nodes[start][kind]
                        + of_y[1] * self.nodes[start + 1][kind]
                        + of_y[2] * self.nodes[start][kind + 2]
                        + of_y[3] * self.nodes[start + 1][kind + 2]);
            }
            sum
        })
    }

    pub(super) fn places(&self) -> [&[f64]; 2] {
        [&self.x, &self.y]
    }

    /// The nodes, row by row of equal x.
    pub(crate) fn nodes(&self) -> &[[f64; 4]] {
        &self.nodes
    }

    pub(super) fn size(&self) -> f64 {
        self.nodes.iter().fold(0.0_f64, |size, node| size.max(node[0].abs()))
    }
}
