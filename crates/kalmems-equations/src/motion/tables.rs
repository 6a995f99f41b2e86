//! What a step over one interval needs beside the equations: the matrices of its linear part.

use super::{MOST_STATES, Motion, SIZES};
use kalmems_core::{EtdWeights, Mat};

/// The matrices of [`EtdWeights`] for one motion, one linear part and one interval, of the size that its step is compiled for.
///
/// Nothing is allocated when they are set anew.
#[derive(Clone, Debug)]
pub struct StepTables {
    interval: f64,
    is_runge_kutta: bool,
    /// Of each row of the rates, whether the linear part does not describe it whole. A list of such rows would be a loop of a length that is not
    /// known when a step is compiled.
    bent: [bool; MOST_STATES],
    /// [`MATRICES`] matrices, one behind the other, row by row.
    matrices: Vec<f64>,
}

/// The linear part, the six of a step, and the products of two of these with the linear part.
pub(super) const MATRICES: usize = 9;

/// The matrices by their places.
pub(super) struct StepMatrices<'a, const N: usize>([&'a [[f64; N]; N]; MATRICES]);

#[allow(clippy::inline_always)] // places that are known become addresses
impl<const N: usize> StepMatrices<'_, N> {
    #[inline(always)]
    pub(super) fn linear(&self) -> &[[f64; N]; N] {
        self.0[0]
    }
    #[inline(always)]
    pub(super) fn to_middle(&self) -> &[[f64; N]; N] {
        self.0[1]
    }
    #[inline(always)]
    pub(super) fn bend_to_middle(&self) -> &[[f64; N]; N] {
        self.0[2]
    }
    #[inline(always)]
    pub(super) fn to_end(&self) -> &[[f64; N]; N] {
        self.0[3]
    }
    #[inline(always)]
    pub(super) fn bend_to_end(&self) -> &[[f64; N]; N] {
        self.0[4]
    }
    #[inline(always)]
    pub(super) fn bend_of_middles(&self) -> &[[f64; N]; N] {
        self.0[5]
    }
    #[inline(always)]
    pub(super) fn bend_of_end(&self) -> &[[f64; N]; N] {
        self.0[6]
    }
    /// The way to the middle of what is linear: `to_middle`·A.
    #[inline(always)]
    pub(super) fn straight_to_middle(&self) -> &[[f64; N]; N] {
        self.0[7]
    }
    /// The way to the end of what is linear: e^{A·s} − 1.
    #[inline(always)]
    pub(super) fn straight_to_end(&self) -> &[[f64; N]; N] {
        self.0[8]
    }
}

impl StepTables {
    /// Of no interval yet.
    pub(super) fn of_size(size: usize) -> Self {
        Self {
            interval: 0.0,
            is_runge_kutta: false,
            bent: [false; MOST_STATES],
            matrices: vec![0.0; MATRICES * size * size],
        }
    }

    /// Whether they are those of Runge and Kutta's method, without a linear part.
    pub(super) const fn is_runge_kutta(&self) -> bool {
        self.is_runge_kutta
    }

    /// Of each row of the rates, whether the linear part does not describe it whole.
    #[inline]
    pub(super) fn bent_rows<const N: usize>(&self) -> &[bool; N] {
        const { assert!(N <= MOST_STATES, "there are no more rows") };
        self.bent.first_chunk().unwrap_or(&[false; N])
    }

    /// The matrices for a step of N states; `None` for those of another size.
    #[inline]
    pub(super) fn of<const N: usize>(&self) -> Option<StepMatrices<'_, N>> {
        let mut all = self.matrices.as_chunks::<N>().0;
        let mut matrices = [&[[0.0; N]; N]; MATRICES];
        for matrix in &mut matrices {
            let (first, rest) = all.split_first_chunk::<N>()?;
            (*matrix, all) = (first, rest);
        }
        Some(StepMatrices(matrices))
    }

    fn set<const N: usize>(&mut self, linear: Mat<f64, N, N>, interval: f64) {
        let EtdWeights {
            to_middle, bend_to_middle, to_end, bend_to_end, bend_of_middles, bend_of_end, ..
        } = EtdWeights::new(linear, interval);
        let straight = [to_middle.times(&linear), to_end.times(&linear)];
        let own = [linear, to_middle, bend_to_middle, to_end, bend_to_end, bend_of_middles, bend_of_end];
        let all = own.iter().chain(&straight).flat_map(|matrix| matrix.0.as_flattened());
        for (to, entry) in self.matrices.iter_mut().zip(all) {
            *to = *entry;
        }
    }
}

impl Motion {
    /// Room for the tables of its steps.
    pub fn tables(&self) -> StepTables {
        StepTables::of_size(self.size)
    }

    /// Makes them those of steps of `interval` seconds, which may be negative, with this linear part: ∂f/∂x of all states, row by row,
    /// as [`linearize`](Self::linearize) gives it at any point. What is linear of the motion is followed exactly then.
    pub fn set_tables(&self, tables: &mut StepTables, linear: &[f64], interval: f64) {
        let (moving, columns) = (self.states, self.states());
        let entry = |i: usize, j: usize| {
            let known = linear.get(i * columns + j).filter(|_| i < moving && j < moving);
            // Where the motion cannot be linearised, the step has all of it in what bends.
            known.copied().filter(|slope| slope.is_finite()).unwrap_or(0.0)
        };
        (tables.interval, tables.is_runge_kutta) = (interval, false);
        for (row, bends) in tables.bent.iter_mut().enumerate() {
            *bends = self.bent.contains(&row);
        }
        macro_rules! by_size {
            ($($size:literal)+) => {
                match self.size {
                    $($size => tables.set::<$size>(Mat::from_fn(entry), interval),)+
                    _ => {}
                }
            };
        }
        const { assert!(SIZES.len() == 10, "each size has its tables") };
        by_size!(1 2 3 4 5 6 8 12 16 24);
    }

    /// The tables of steps of Runge and Kutta's method over `interval` seconds.
    pub fn runge_kutta(&self, interval: f64) -> StepTables {
        let mut tables = self.tables();
        self.set_runge_kutta(&mut tables, interval);
        tables
    }

    /// Makes them those of Runge and Kutta's method of fourth order, which has no linear part.
    pub fn set_runge_kutta(&self, tables: &mut StepTables, interval: f64) {
        if tables.is_runge_kutta && tables.interval == interval {
            return;
        }
        (tables.interval, tables.is_runge_kutta) = (interval, true);
        for (row, bends) in tables.bent.iter_mut().enumerate() {
            *bends = row < self.states;
        }
        tables.matrices.fill(0.0);
        let shares = [0.0, 0.5, 0.5, 1.0, 1.0, 1.0 / 3.0, 1.0 / 6.0];
        for (matrix, share) in tables.matrices.chunks_exact_mut(self.size * self.size).zip(shares) {
            for diagonal in matrix.iter_mut().step_by(self.size + 1) {
                *diagonal = share * interval;
            }
        }
    }
}
