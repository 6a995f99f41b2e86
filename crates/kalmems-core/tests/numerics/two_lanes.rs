//! Each lane of a filter goes its own way: what it holds is, to the bit, what one number alone would.

use crate::pair::{Pair, PairMask};
use kalmems_core::update::Gate;
use kalmems_core::{
    Covariance, Ekf, Filter, IteratedEkf, Mat, Measurement, Over, Process, ProcessNoise, Scalar, SchmidtEkf,
    SigmaPoints, SquareRootEkf, SquareRootUkf, Ukf,
};

/// A product and a square: they bend.
struct Curve;
impl<T: Scalar> Measurement<T, 2, 2> for Curve {
    fn predict<S: Over<T>>(&self, x: &[S; 2]) -> [S; 2] {
        [x[0].sq() + x[1], x[0] * x[1]]
    }
}

/// A pendulum of sorts.
struct Swing<T>(ProcessNoise<T, 2>);
impl<T: Scalar> Process<T, 2> for Swing<T> {
    type Input = T;
    fn step<S: Over<T>>(&self, x: &[S; 2], push: &T) -> [S; 2] {
        [x[0] + x[1] * T::of(0.1), x[1] - x[0].sin() * T::of(0.1) + S::lift(*push)]
    }
    fn noise(&self) -> &ProcessNoise<T, 2> {
        &self.0
    }
}

/// What each step gives each lane: a push and a measurement; some of them cannot be used.
const GIVEN: [[(f64, [f64; 2]); 2]; 6] = [
    [(0.1, [1.0, 0.5]), (0.0, [2.0, 1.0])],
    [(0.0, [1.5, 0.4]), (0.0, [f64::NAN, 1.0])],
    [(f64::INFINITY, [1.2, 0.3]), (0.2, [2.5, 1.0])],
    [(0.0, [90.0, 0.3]), (0.1, [2.0, 1.2])], // an outlier in one lane
    [(0.0, [f64::INFINITY, 0.3]), (f64::NAN, [1.0, 0.9])],
    [(0.0, [1.0, 0.2]), (0.0, [1.0, 0.8])],
];

fn follow<T: Scalar, F: Filter<T, 2>>(mut filter: F, of: impl Fn([f64; 2]) -> T) -> (F, Vec<[T::Mask; 2]>) {
    let noise = Covariance::from_lower(Mat([[T::of(0.01), T::of(0.0)], [T::of(0.005), T::of(0.02)]]));
    let process = Swing(noise.into());
    let r = Covariance::from_lower(Mat([[T::of(0.2), T::of(0.0)], [T::of(0.05), T::of(0.1)]]));
    let none = T::of(0.0).lt(T::of(0.0));
    let taken = GIVEN.map(|[a, b]| {
        let moved = filter.predict(&process, &of([a.0, b.0])).unwrap_or(none);
        let y = [of([a.1[0], b.1[0]]), of([a.1[1], b.1[1]])];
        let seen = filter.update_where(&Curve, &y, &r, &Gate { nis: T::of(50.0) });
        [moved, seen.map_or(none, |innovation| innovation.taken)]
    });
    (filter, taken.to_vec())
}

fn compare<A: Filter<Pair, 2>, B: Filter<f64, 2>>(both: A, alone: impl Fn() -> B) {
    let (both, masks) = follow(both, Pair);
    for lane in 0..2 {
        let (alone, taken) = follow(alone(), |given| given[lane]);
        let bits = |x: f64| x.to_bits();
        for i in 0..2 {
            assert_eq!(bits(both.mean()[i].0[lane]), bits(alone.mean()[i]));
            for j in 0..2 {
                assert_eq!(bits(both.covariance().get(i, j).0[lane]), bits(alone.covariance().get(i, j)));
            }
        }
        let lane_of = |mask: PairMask| mask.0[lane];
        assert_eq!(masks.iter().map(|m| m.map(lane_of)).collect::<Vec<_>>(), taken);
        // Four or five predictions and three or four corrections of six.
        let refused = taken.iter().flatten().filter(|taken| !**taken).count();
        assert!((2..=4).contains(&refused), "{taken:?}");
    }
}

fn start<T: Scalar>() -> ([T; 2], Covariance<T, 2>) {
    let c = [[T::of(0.5), T::of(0.0)], [T::of(0.1), T::of(0.4)]];
    ([T::of(0.8), T::of(0.3)], Covariance::from_lower(Mat(c)))
}

fn wide<T: Scalar>() -> SigmaPoints<T> {
    SigmaPoints::standard()
}

/// Points that take something away.
fn taking<T: Scalar>() -> SigmaPoints<T> {
    SigmaPoints { alpha: T::of(1.0), beta: T::of(-0.6), kappa: T::of(0.5) }
}

#[test]
fn each_lane_is_a_filter_of_its_own() {
    fn ekf<T: Scalar>() -> Ekf<T, 2> {
        Ekf::new(start().0, start().1)
    }
    fn root<T: Scalar>() -> SquareRootEkf<T, 2> {
        SquareRootEkf::new(start().0, start().1)
    }
    fn iterated<T: Scalar>() -> IteratedEkf<T, 2, 20> {
        IteratedEkf::new(start().0, start().1, T::of(1e-3))
    }
    fn schmidt<T: Scalar>() -> SchmidtEkf<T, 2> {
        SchmidtEkf::new(start().0, start().1, [false, true])
    }
    compare(ekf(), ekf);
    compare(root(), root);
    compare(iterated(), iterated);
    compare(schmidt(), schmidt);
    let (mean, p) = start();
    compare(Ukf::new(mean, p, wide()), || Ukf::new(start().0, start().1, wide()));
    let (mean, p) = start();
    compare(SquareRootUkf::new(mean, p, wide()), || SquareRootUkf::new(start().0, start().1, wide()));
    let (mean, p) = start();
    compare(SquareRootUkf::new(mean, p, taking()), || SquareRootUkf::new(start().0, start().1, taking()));
}
