//! Fewer points for the same picture: of each pixel column the first, lowest, highest and last sample.

/// Samples beyond this magnitude count as missing: the span of an axis would overflow.
const LARGEST: f64 = 1e300;
/// Nearer to zero than this, the digits of a number run out, and no axis can resolve it.
pub(crate) const SMALLEST: f64 = 1e-300;

/// Whether an axis can hold the value; false for NaN.
pub(crate) fn is_drawable(value: f64) -> bool {
    value.abs() <= LARGEST
}

/// How many samples stand for the rest.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Thinning {
    /// All samples are there.
    None,
    /// Per column of equal width in x.
    ByColumn,
    /// Per equal number of consecutive samples, because x does not increase throughout.
    ByCount,
}

/// What is left of a sampled signal, and what was found in it.
#[derive(Clone, Debug, PartialEq)]
pub struct DecimatedSignal<T> {
    /// Points in the order of the samples; a gap in the data separates one run from the next.
    pub runs: Vec<Vec<T>>,
    /// How many samples there were.
    pub samples: usize,
    /// How many of them are not finite, or too large for an axis.
    pub missing: usize,
    /// How many of the others are below 1e-300, most often zero or negative: a logarithmic axis cannot show them.
    pub not_positive: usize,
    /// How the points were chosen.
    pub thinning: Thinning,
}

/// Reduces a line of `(x, y)` to at most four points per column: first, lowest, highest and last.
///
/// No extreme is lost, and the points stay in order. Up to `4 · columns` samples stay as they are. A sample
/// that is not finite breaks the line; a gap narrower than a column is counted but not drawn.
pub fn decimate<P>(points: P, columns: usize) -> DecimatedSignal<[f64; 2]>
where
    P: IntoIterator<Item = (f64, f64)>,
    P::IntoIter: Clone,
{
    let points = points.into_iter();
    let samples = |each: &mut dyn FnMut(PlotSample)| {
        points.clone().for_each(|(x, y)| each(PlotSample { x, low: y, high: y }));
    };
    reduce(&samples, columns, 4, |column, run| {
        let mut kept = [
            (column.first.0, column.first.1.x, column.first.1.low),
            (column.lowest.0, column.lowest.1.x, column.lowest.1.low),
            (column.highest.0, column.highest.1.x, column.highest.1.high),
            (column.last.0, column.last.1.x, column.last.1.low),
        ];
        kept.sort_by_key(|point| point.0);
        let mut drawn = None;
        for (index, x, y) in kept {
            if drawn != Some(index) {
                run.push([x, y]);
            }
            drawn = Some(index);
        }
    })
}

/// Reduces a band of `(x, lower, upper)` to at most two points `[x, lower, upper]` per column.
///
/// Both have the lowest `lower` and the highest `upper` of the column, so that the band never gets narrower.
pub fn decimate_band<P>(points: P, columns: usize) -> DecimatedSignal<[f64; 3]>
where
    P: IntoIterator<Item = (f64, f64, f64)>,
    P::IntoIter: Clone,
{
    let points = points.into_iter();
    let samples = |each: &mut dyn FnMut(PlotSample)| {
        points.clone().for_each(|(x, low, high)| each(PlotSample { x, low, high }));
    };
    reduce(&samples, columns, 2, |column, run| {
        let (lower, upper) = (column.lowest.1.low, column.highest.1.high);
        run.push([column.first.1.x, lower, upper]);
        if column.last.0 != column.first.0 {
            run.push([column.last.1.x, lower, upper]);
        }
    })
}

/// The samples of two slices as points. Where one is shorter, its missing values count as missing samples.
pub fn pairs<'a>(x: &'a [f64], y: &'a [f64]) -> impl Iterator<Item = (f64, f64)> + Clone + 'a {
    (0..x.len().max(y.len())).map(move |i| (at(x, i), at(y, i)))
}

/// The samples of three slices as points of a band, like [`pairs`].
pub fn triples<'a>(
    x: &'a [f64],
    lower: &'a [f64],
    upper: &'a [f64],
) -> impl Iterator<Item = (f64, f64, f64)> + Clone + 'a {
    (0..x.len().max(lower.len()).max(upper.len())).map(move |i| (at(x, i), at(lower, i), at(upper, i)))
}

fn at(values: &[f64], index: usize) -> f64 {
    values.get(index).copied().unwrap_or(f64::NAN)
}

/// A line has `low == high`.
#[derive(Clone, Copy)]
struct PlotSample {
    x: f64,
    low: f64,
    high: f64,
}

impl PlotSample {
    fn is_drawable(&self) -> bool {
        is_drawable(self.x) && is_drawable(self.low) && is_drawable(self.high)
    }
}

/// What has been seen of one column, each with the index of the sample.
struct PixelColumn {
    number: usize,
    first: (usize, PlotSample),
    lowest: (usize, PlotSample),
    highest: (usize, PlotSample),
    last: (usize, PlotSample),
}

/// A first pass over the samples: how many there are, and how x runs.
struct SampleSurvey {
    samples: usize,
    missing: usize,
    not_positive: usize,
    ordered: bool,
    x: Option<(f64, f64)>,
}

impl SampleSurvey {
    fn of(samples: SampleSource) -> Self {
        let mut survey = Self { samples: 0, missing: 0, not_positive: 0, ordered: true, x: None };
        samples(&mut |sample| {
            survey.samples += 1;
            if !sample.is_drawable() {
                survey.missing += 1;
                return;
            }
            survey.not_positive += usize::from(sample.low < SMALLEST);
            survey.x = match survey.x {
                None => Some((sample.x, sample.x)),
                Some((start, end)) => {
                    survey.ordered &= sample.x >= end;
                    Some((start, sample.x))
                }
            };
        });
        survey
    }

    fn thinning(&self, columns: usize, per_column: usize) -> Thinning {
        if self.samples <= columns.saturating_mul(per_column) {
            return Thinning::None;
        }
        match self.x {
            Some((start, end)) if self.ordered && start < end => Thinning::ByColumn,
            _ => Thinning::ByCount,
        }
    }

    /// Where a sample lies, in columns. Without thinning each sample has a column of its own.
    fn position(&self, thinning: Thinning, columns: usize, index: usize, x: f64) -> f64 {
        match (thinning, self.x) {
            (Thinning::ByColumn, Some((start, end))) => (x - start) / (end - start) * columns as f64,
            (Thinning::ByCount, _) => index as f64 / self.samples as f64 * columns as f64,
            _ => index as f64,
        }
    }
}

/// Hands over all samples in order, each time that it is called. Behind a pointer, so that the work on them is compiled once and
/// not for each iterator that anyone draws.
type SampleSource<'a> = &'a dyn Fn(&mut dyn FnMut(PlotSample));

fn reduce<T>(
    samples: SampleSource,
    columns: usize,
    per_column: usize,
    emit: fn(&PixelColumn, &mut Vec<T>),
) -> DecimatedSignal<T> {
    let columns = columns.max(1);
    let survey = SampleSurvey::of(samples);
    let thinning = survey.thinning(columns, per_column);
    let last_column = if thinning == Thinning::None { usize::MAX } else { columns - 1 };

    let mut runs = Vec::new();
    let mut run = Vec::new();
    let mut column: Option<PixelColumn> = None;
    let mut missing_since = false;
    let mut previous = 0.0;
    let mut next = 0;
    samples(&mut |sample| {
        let index = next;
        next += 1;
        if !sample.is_drawable() {
            missing_since = true;
            return;
        }
        let position = survey.position(thinning, columns, index, sample.x);
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // between 0 and the sample count
        let number = (position as usize).min(last_column);
        // A gap that no pixel can show would only multiply the runs.
        let breaks = missing_since && position - previous >= 1.0;
        missing_since = false;
        previous = position;
        let here = (index, sample);
        match &mut column {
            Some(open) if open.number == number && !breaks => {
                if sample.low < open.lowest.1.low {
                    open.lowest = here;
                }
                if sample.high > open.highest.1.high {
                    open.highest = here;
                }
                open.last = here;
            }
            _ => {
                if let Some(done) = column.take() {
                    emit(&done, &mut run);
                }
                if breaks && !run.is_empty() {
                    runs.push(std::mem::take(&mut run));
                }
                column = Some(PixelColumn { number, first: here, lowest: here, highest: here, last: here });
            }
        }
    });
    if let Some(done) = column {
        emit(&done, &mut run);
    }
    if !run.is_empty() {
        runs.push(run);
    }
    DecimatedSignal {
        runs,
        samples: survey.samples,
        missing: survey.missing,
        not_positive: survey.not_positive,
        thinning,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn line(y: &[f64], columns: usize) -> DecimatedSignal<[f64; 2]> {
        decimate(y.iter().enumerate().map(|(i, y)| (i as f64, *y)), columns)
    }

    #[test]
    fn keeps_first_lowest_highest_last_in_order() {
        // Two columns of six samples each.
        let y = [1.0, 5.0, 2.0, -3.0, 0.0, 2.5, 9.0, 7.0, 8.0, 7.5, 10.0, 4.0];
        let got = decimate(y.iter().enumerate().map(|(i, y)| (i as f64, *y)), 2);
        assert_eq!(got.thinning, Thinning::ByColumn);
        let expected: Vec<[f64; 2]> =
            [(0, 1.0), (1, 5.0), (3, -3.0), (5, 2.5), (6, 9.0), (10, 10.0), (11, 4.0)]
                .map(|(i, y): (u32, f64)| [f64::from(i), y])
                .to_vec();
        assert_eq!(got.runs, vec![expected]);
    }

    #[test]
    fn a_short_line_stays_as_it_is_and_breaks_at_what_is_missing() {
        let got = line(&[1.0, f64::NAN, 3.0, 4.0, f64::INFINITY, 1e301, -1.0], 100);
        assert_eq!(got.thinning, Thinning::None);
        assert_eq!(got.runs, vec![vec![[0.0, 1.0]], vec![[2.0, 3.0], [3.0, 4.0]], vec![[6.0, -1.0]]]);
        assert_eq!((got.samples, got.missing, got.not_positive), (7, 3, 1));
    }

    #[test]
    fn a_gap_of_some_columns_breaks_a_long_line_and_a_narrow_one_does_not() {
        let mut y = vec![1.0; 10_000];
        y[100] = f64::NAN;
        y[5000..6000].fill(f64::NAN);
        let got = line(&y, 100);
        assert_eq!(got.missing, 1001);
        assert_eq!(got.runs.len(), 2);
        assert_eq!(got.runs[0].last(), Some(&[4999.0, 1.0]));
        assert_eq!(got.runs[1].first(), Some(&[6000.0, 1.0]));
    }

    #[test]
    fn scattered_gaps_do_not_make_the_result_grow() {
        let y: Vec<f64> = (0..100_000).map(|i| if i % 2 == 0 { f64::NAN } else { f64::from(i) }).collect();
        let got = line(&y, 100);
        assert_eq!(got.missing, 50_000);
        assert!(got.runs.iter().map(Vec::len).sum::<usize>() <= 400);
    }

    #[test]
    fn a_band_never_gets_narrower() {
        let band = |i: u32| (f64::from(i), -f64::from(i % 7), f64::from(i % 5));
        let got = decimate_band((0..10_000).map(band), 50);
        assert_eq!(got.runs.len(), 1);
        assert_eq!(got.runs[0].len(), 100);
        for [_, lower, upper] in &got.runs[0] {
            assert_eq!((*lower, *upper), (-6.0, 4.0));
        }
    }

    #[test]
    fn slices_of_unequal_length_are_not_cut() {
        let got = decimate(pairs(&[0.0, 1.0, 2.0], &[5.0]), 10);
        assert_eq!((got.samples, got.missing), (3, 2));
        let got = decimate_band(triples(&[0.0], &[5.0, 1.0], &[6.0, 2.0]), 10);
        assert_eq!((got.samples, got.missing), (2, 1));
    }

    #[test]
    fn nothing_gives_nothing() {
        assert_eq!(line(&[], 10).runs, Vec::<Vec<[f64; 2]>>::new());
        assert_eq!(line(&[f64::NAN; 1000], 10).runs, Vec::<Vec<[f64; 2]>>::new());
        assert_eq!(line(&[1.0, 2.0], 0).runs.len(), 1);
    }

    fn any_sample() -> impl Strategy<Value = f64> {
        prop_oneof![20 => -1e3..1e3_f64, 1 => Just(f64::NAN), 1 => any::<f64>()]
    }

    proptest! {
        #[test]
        fn extremes_order_and_bound_hold(
            steps in prop::collection::vec((0.0..2.0_f64, any_sample()), 0..3000),
            columns in 1_usize..40,
            shuffled in any::<bool>(),
        ) {
            let mut x = 0.0;
            let points: Vec<(f64, f64)> = steps
                .iter()
                .map(|(step, y)| {
                    x += if shuffled { step - 1.0 } else { *step };
                    (x, *y)
                })
                .collect();
            let got = decimate(points.iter().copied(), columns);
            let kept: Vec<[f64; 2]> = got.runs.iter().flatten().copied().collect();
            prop_assert!(kept.len() <= 4 * columns);
            prop_assert!(got.runs.iter().all(|run| !run.is_empty()));

            let finite: Vec<[f64; 2]> =
                points.iter().filter(|p| p.1.abs() <= LARGEST).map(|p| [p.0, p.1]).collect();
            prop_assert_eq!(got.missing, points.len() - finite.len());
            let extreme = |of: &[[f64; 2]], pick: fn(f64, f64) -> f64| of.iter().map(|p| p[1]).reduce(pick);
            prop_assert_eq!(extreme(&kept, f64::min), extreme(&finite, f64::min));
            prop_assert_eq!(extreme(&kept, f64::max), extreme(&finite, f64::max));
            prop_assert_eq!(kept.first(), finite.first());
            prop_assert_eq!(kept.last(), finite.last());

            // A subsequence of the samples: order is kept and nothing is invented.
            let bits = |points: &[[f64; 2]]| points.iter().map(|p| p.map(f64::to_bits)).collect::<Vec<_>>();
            let (kept, finite) = (bits(&kept), bits(&finite));
            let mut rest = finite.iter();
            prop_assert!(kept.iter().all(|point| rest.any(|sample| sample == point)));
        }
    }
}
