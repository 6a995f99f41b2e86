//! The whole of a filter's way over rows of numbers.

use super::functions::{MOST, Matrices, Model};
use super::sample::{Room, Sample, Taking};
use kalmems::config::Method;
use kalmems::estimate::{AnyFilter, FilterKind, MeanAndCovariance, RowFilter, Transition};
use kalmems_core::{Covariance, FilterError, Mat, ProcessNoise, SigmaPoints};

/// What a filter is to do.
pub struct Job<'a> {
    pub method: Method,
    pub points: [f64; 3],
    pub motion: Model<'a>,
    pub sensor: Model<'a>,
    /// Samples, row after row, and the inputs likewise.
    pub z: &'a Matrices,
    pub inputs: &'a Matrices,
    pub q: &'a Matrices,
    pub r: &'a Matrices,
    pub x0: &'a [f64],
    pub p0: &'a [f64],
    /// The largest NIS that is believed, and the degrees of freedom of the noise of samples.
    pub limits: [f64; 2],
    /// Up to how many later samples tell of an earlier state as well.
    pub lag: usize,
    /// Whether to stop before a sample.
    pub stop: &'a dyn Fn() -> bool,
}

/// Those of all samples, row after row.
type MeansAndCovariances = (Vec<f64>, Vec<f64>);

/// What it says of each sample, row after row.
#[derive(Default)]
pub struct Run {
    pub x: Vec<f64>,
    pub p: Vec<f64>,
    pub innovation: Vec<f64>,
    pub s: Vec<f64>,
    pub nis: Vec<f64>,
    pub log_likelihood: Vec<f64>,
    pub taken: Vec<bool>,
    /// Mean and covariance given later samples, where they are wanted.
    pub smoothed: Option<MeansAndCovariances>,
    /// Where and why it stopped, if it did.
    pub stopped: Option<(usize, String)>,
}

/// How the state moves between two samples.
struct Motion<'a> {
    model: Model<'a>,
    at: (usize, &'a [f64]),
    noise: &'a StepNoise,
}

/// The lower triangle of Q and a root of it.
struct StepNoise {
    lower: Vec<f64>,
    root: Vec<f64>,
}

impl StepNoise {
    fn of(q: &[f64], n: usize) -> Self {
        const MANY: usize = MOST.0;
        let entry = |i: usize, j: usize| if i < n && j <= i { q[i * n + j] } else { 0.0 };
        let whole = ProcessNoise::<f64, MANY>::from(Covariance::from_lower(Mat::from_fn(entry)));
        let each = |of: &dyn Fn(usize, usize) -> f64| (0..n * n).map(|k| of(k / n, k % n)).collect();
        Self { lower: each(&entry), root: each(&|i, j| whole.root().0[i][j]) }
    }
}

impl Transition for Motion<'_> {
    fn advance(&self, x: &[f64], to: &mut [f64]) {
        self.model.value(self.at, x, to);
    }

    fn linearize(&self, x: &[f64], to: &mut [f64], jacobian: &mut [f64]) {
        self.model.linearize(self.at, x, to, jacobian);
    }

    fn noise(&self, covariance: &mut [f64], root: &mut [f64]) {
        covariance.copy_from_slice(&self.noise.lower);
        root.copy_from_slice(&self.noise.root);
    }
}

impl Job<'_> {
    fn taking(&self) -> Taking {
        match self.method {
            Method::Ukf | Method::SquareRootUkf => Taking::Unscented(self.points),
            Method::IteratedEkf => Taking::Iterated,
            _ => Taking::Extended,
        }
    }

    fn filter(&self) -> Option<Box<dyn RowFilter>> {
        let [alpha, beta, kappa] = self.points;
        let n = self.x0.len();
        let kind = FilterKind {
            method: self.method,
            points: SigmaPoints { alpha, beta, kappa },
            considered_from: n,
        };
        let lower = (0..n).flat_map(|i| self.p0[i * n..=i * n + i].iter().copied()).collect();
        let known = MeanAndCovariance { mean: self.x0.to_vec(), lower };
        AnyFilter::of(kind, &known).map(|filter| filter.over_rows(self.lag))
    }

    /// The whole way; `None` where there is no filter of so many states by this method.
    pub fn run(&self) -> Option<Run> {
        let mut filter = self.filter()?;
        let mut run = Run::default();
        run.stopped = self.follow(&mut *filter, &mut run).err();
        Some(run)
    }

    fn follow(&self, filter: &mut dyn RowFilter, run: &mut Run) -> Result<(), (usize, String)> {
        let (n, m) = (self.x0.len(), self.z.size);
        let rows = self.z.numbers.len() / m;
        (run.x, run.p) = (vec![0.0; rows * n], vec![0.0; rows * n * n]);
        (run.innovation, run.s) = (vec![0.0; rows * m], vec![0.0; rows * m * m]);
        let (mut room, mut noise) = (Room::new(n, m), StepNoise::of(self.q.at(0), n));
        let mut smoothed = LaterKnown::new(self.lag, rows, n);
        for k in 0..rows {
            if k % 64 == 0 && (self.stop)() {
                return Err((k, String::new()));
            }
            let failed = |why: FilterError| (k, why.to_string());
            if k > 0 {
                if self.q.varies && k > 1 {
                    noise = StepNoise::of(self.q.at(k - 1), n);
                }
                let at = (k - 1, self.inputs.at(k - 1));
                filter.predict(&Motion { model: self.motion, at, noise: &noise }).map_err(failed)?;
            }
            let sample = Sample {
                model: self.sensor,
                at: (k, self.inputs.at(k)),
                z: self.z.at(k),
                r: self.r.at(k),
                taking: self.taking(),
                gate: self.limits[0],
                freedom: self.limits[1],
            };
            let to = (&mut run.innovation[k * m..(k + 1) * m], &mut run.s[k * m * m..(k + 1) * m * m]);
            let predicted = sample.correct(filter, &mut room, to).map_err(failed)?;
            run.nis.push(predicted.nis);
            run.log_likelihood.push(predicted.log_likelihood);
            run.taken.push(predicted.is_taken);
            run.x[k * n..(k + 1) * n].copy_from_slice(filter.mean());
            filter.covariance(&mut run.p[k * n * n..(k + 1) * n * n]);
            smoothed.take(filter, k, self.stop).map_err(failed)?;
        }
        run.smoothed =
            smoothed.finish(filter, self.stop).map_err(|why| (rows.saturating_sub(1), why.to_string()))?;
        Ok(())
    }
}

/// Means and covariances given later samples.
struct LaterKnown {
    lag: usize,
    rows: usize,
    n: usize,
    means: Vec<f64>,
    covariances: Vec<f64>,
}

impl LaterKnown {
    fn new(lag: usize, rows: usize, n: usize) -> Self {
        let of = |wide: usize| if lag > 0 { vec![0.0; rows * wide] } else { Vec::new() };
        Self { lag, rows, n, means: of(n), covariances: of(n * n) }
    }

    /// Writes the states from that of the newest row back: all that are kept, or the one of so many rows before alone.
    fn look_back(
        &mut self,
        filter: &dyn RowFilter,
        (newest, only): (usize, Option<usize>),
        stop: &dyn Fn() -> bool,
    ) -> Result<(), FilterError> {
        let n = self.n;
        let mut back = 0;
        filter.look_back(&mut |mean, covariance| {
            let Some(row) = newest.checked_sub(back) else { return false };
            if only.is_none_or(|only| only == back) {
                self.means[row * n..(row + 1) * n].copy_from_slice(mean);
                self.covariances[row * n * n..(row + 1) * n * n].copy_from_slice(covariance);
            }
            back += 1;
            only.is_none_or(|only| back <= only) && !(back % 64 == 0 && stop())
        })
    }

    /// After the sample of a row.
    fn take(
        &mut self,
        filter: &dyn RowFilter,
        row: usize,
        stop: &dyn Fn() -> bool,
    ) -> Result<(), FilterError> {
        if self.lag == 0 || row < self.lag {
            return Ok(());
        }
        self.look_back(filter, (row, Some(self.lag)), stop)
    }

    /// After the last one.
    fn finish(
        mut self,
        filter: &dyn RowFilter,
        stop: &dyn Fn() -> bool,
    ) -> Result<Option<MeansAndCovariances>, FilterError> {
        if self.lag == 0 {
            return Ok(None);
        }
        if let Some(last) = self.rows.checked_sub(1) {
            self.look_back(filter, (last, None), stop)?;
        }
        Ok(Some((self.means, self.covariances)))
    }
}
