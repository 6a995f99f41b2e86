//! A test object of the project's own, computed.

use kalmems_core::Scalar;

/// An object with fine detail: a tissue of crypts, as the mucosa of a colon shows under an endomicroscope, and a chart of
/// bars in its middle. It is computed from the seed alone and resembles no published picture.
///
/// A function of the position, not a raster: a sample takes its value exactly where the spot is. All edges are as soft as
/// a spot of [`TissueScene::SPOT`] makes them, so that there is nothing finer to be missed between samples.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TissueScene {
    seed: u64,
    chart: bool,
}

/// Rows of crypts across the field.
const ROWS: f64 = 17.0;
/// The chart: its centre is that of the field; half its side.
const CHART: f64 = 0.15;
/// What its bars stand on, and they.
const BLACK: f64 = 0.08;
const WHITE: f64 = 0.92;
/// Periods of its bars, in 400ths of the field.
const PERIODS: [f64; 4] = [20.0, 12.0, 8.0, 5.0];

impl TissueScene {
    /// The width over which an edge rises, as a part of the field: 2 pixels of 400.
    pub const SPOT: f64 = 2.0 / 400.0;

    /// Crypts that differ from seed to seed, with the chart.
    pub const fn mucosa(seed: u64) -> Self {
        Self { seed, chart: true }
    }

    /// The same without the chart.
    #[must_use]
    pub const fn without_chart(self) -> Self {
        Self { chart: false, ..self }
    }

    /// The intensity at a position in the field, in 0 to 1.
    pub fn intensity(&self, [x, y]: [f64; 2]) -> f64 {
        let tissue = || self.tissue(x, y);
        if !self.chart {
            return tissue();
        }
        let (u, v) = (x - 0.5, y - 0.5);
        let inside = edge(CHART - u.abs()) * edge(CHART - v.abs());
        if inside == 0.0 { tissue() } else { (1.0 - inside) * tissue() + inside * chart(u, v) }
    }

    /// Crypts: a dark lumen with a ragged rim, a bright ring of cells around it, dark septa with vessels between.
    fn tissue(&self, x: f64, y: f64) -> f64 {
        let illumination = 0.85 + 0.15 * self.noise(x, y, 3.0, 1);
        // Positions in rows, bent a little so that no row is straight.
        let bend = 0.35;
        let p = x * ROWS + bend * self.noise(x, y, 6.0, 2);
        let q = y * ROWS + bend * self.noise(x, y, 6.0, 3);
        let row = q.floor();
        let (mut nearest, mut second, mut key) = ((f64::INFINITY, 0.0, 0.0), f64::INFINITY, 0);
        for j in -1..=1 {
            let r = row + f64::from(j);
            let stagger = if r.rem_euclid(2.0) < 1.0 { 0.0 } else { 0.5 };
            let column = (p - stagger).floor();
            for i in -1..=1 {
                let c = column + f64::from(i);
                let a = p - (c + stagger + 0.5 + 0.3 * (self.random(c, r, 4) - 0.5));
                let b = q - (r + 0.5 + 0.3 * (self.random(c, r, 5) - 0.5));
                let distance = Scalar::sqrt(a * a + b * b);
                if distance < nearest.0 {
                    second = nearest.0;
                    nearest = (distance, a, b);
                    key = self.hash(c, r, 6);
                } else {
                    second = second.min(distance);
                }
            }
        }
        let (radius, a, b) = nearest;
        let part = |shift: u32| (key >> shift & 0xff) as f64 / 255.0;
        // A lumen longer one way than the other, whose rim cells make ragged.
        let stretch = 0.3 * part(0);
        let along = if part(8) < 0.5 { a } else { b } / (radius + 1e-12);
        let ragged = 0.03 * self.noise(x, y, 110.0, 7);
        let lumen = 0.13 + 0.07 * part(16) + stretch * along * along * 0.35 + ragged;
        let scale = 1.0 / ROWS;
        let in_lumen = edge((lumen - radius) * scale);
        // Half the way between this crypt and the next.
        let wall = (second - radius) * 0.5;
        let in_septum = edge((0.07 - wall) * scale);
        let vessel = edge((0.018 - (wall - 0.01).abs()) * scale);
        let nucleus = edge((0.16 - (radius - lumen - 0.14).abs()) * 0.12 * scale)
            * edge((self.noise(x, y, 120.0, 8) - 0.15) * 0.006);
        let cells = 0.66 + 0.1 * part(24) + 0.22 * nucleus + 0.05 * self.noise(x, y, 70.0, 9);
        let septum = 0.26 + 0.05 * self.noise(x, y, 60.0, 10) + 0.45 * vessel;
        let outside = cells + in_septum * (septum - cells);
        (illumination * (outside + in_lumen * (0.1 - outside))).clamp(0.0, 1.0)
    }

    /// Smooth noise of mean 0 within −1 to 1, with so many cells across the field: values at the corners of a lattice,
    /// joined by cubics.
    fn noise(&self, x: f64, y: f64, cells: f64, layer: u64) -> f64 {
        let (p, q) = (x * cells, y * cells);
        let (i, j) = (p.floor(), q.floor());
        let (s, t) = (smooth(p - i), smooth(q - j));
        let corner = |a: f64, b: f64| 2.0 * self.random(i + a, j + b, layer) - 1.0;
        let (top, bottom) = (corner(0.0, 0.0), corner(0.0, 1.0));
        let top = top + s * (corner(1.0, 0.0) - top);
        let bottom = bottom + s * (corner(1.0, 1.0) - bottom);
        top + t * (bottom - top)
    }

    /// In [0, 1).
    fn random(&self, i: f64, j: f64, layer: u64) -> f64 {
        (self.hash(i, j, layer) >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// A number that belongs to a place of a lattice (the finaliser of SplitMix64; Steele, Lea and Flood, 2014).
    fn hash(&self, i: f64, j: f64, layer: u64) -> u64 {
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // lattices have few places
        let place = ((i as i64 as u64) << 32) ^ (j as i64 as u64 & 0xffff_ffff);
        [self.seed, layer, place].iter().fold(0x9e37_79b9_7f4a_7c15, |h: u64, part| {
            let mut z = (h ^ part).wrapping_add(0x9e37_79b9_7f4a_7c15);
            z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
            z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
            z ^ (z >> 31)
        })
    }
}

/// From the chart's centre: bars that a shift along x blurs in its upper half, bars that a shift along y blurs in the
/// lower half; each half in lanes from coarse to fine.
fn chart(u: f64, v: f64) -> f64 {
    let lane = CHART / PERIODS.len() as f64;
    let across = v.rem_euclid(CHART);
    let lanes = if v < 0.0 { [u, across] } else { [across, u.midpoint(CHART)] };
    let index = (lanes[1] / lane).floor();
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // within the chart
    let Some(period) = PERIODS.get(index as usize).map(|p| p / 400.0) else { return BLACK };
    // Lanes along y are twice as wide, as the chart is.
    let stretch = if v < 0.0 { 1.0 } else { 2.0 };
    let inside_lane = edge(stretch * (0.43 * lane - (lanes[1] - (index + 0.5) * lane).abs()));
    // A bar is half a period wide; bars end half a period before the rim.
    let place = (lanes[0] / period).rem_euclid(1.0) - 0.5;
    BLACK + (WHITE - BLACK) * inside_lane * edge((0.25 - place.abs()) * period)
}

/// 0 far outside, 1 far inside, ½ on the edge, as a cubic over the width of the spot.
fn edge(inside: f64) -> f64 {
    smooth((inside / TissueScene::SPOT + 0.5).clamp(0.0, 1.0))
}

fn smooth(t: f64) -> f64 {
    t * t * (3.0 - 2.0 * t)
}
