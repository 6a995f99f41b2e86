//! How large something wrong must be to be seen without a reference.
//!
//! Whether the innovations hold it is told by a test that knows what is wrong, and not by those of the program: the ratio of the
//! likelihoods of one recording under the device as it is and as the filter is told. Of all tests of one hypothesis against one
//! other it is the most powerful (Neyman and Pearson, 1933). Where twice the logarithm of the ratio is d² on average, it has a
//! standard deviation of 2d, as that of a shift by d standard deviations; at a level of 10⁻⁶ (4.75 standard deviations) that test
//! sees it in 999 of 1000 cases (3.09) from d² = (4.75 + 3.09)² = 61.5 on. From there on the innovations hold it.
//!
//! A test that does not know what is wrong must look in many directions. One that looks in a hundred, as the sum of their squares
//! does, needs d² = 165 for the same: noncentral χ² of 100 degrees. Definitions and sizes were written down before a verdict was
//! looked at.

use super::wrong::{By, KINDS, Kind, claims, size};
use crate::devices::{Device, Setting};
use crate::side_by_side::side_by_side;
use kalmems::results::{EstimatorMetrics, Metrics};

/// From here on a test that knows what is wrong sees it.
const HELD: f64 = 61.5;

/// From here on one that looks in a hundred directions does.
const HELD_IN_A_HUNDRED: f64 = 165.0;

/// Sizes in multiples of that at which the innovations begin to hold it.
const SIZES: [f64; 5] = [0.5, 1.0, 2.0, 4.0, 8.0];

/// Seeds by which sizes are found, and those of the verdicts.
const FINDING: std::ops::RangeInclusive<u64> = 1..=3;
const JUDGING: std::ops::RangeInclusive<u64> = 201..=210;

/// What was found at one size.
struct Point {
    size: f64,
    /// Twice the logarithm of the likelihood ratio, on average; infinite where the filter that is told something wrong has no estimate.
    held: f64,
    failed: usize,
    /// The root mean square error in units of its claim, that of the quantity that is worst, on average.
    error: f64,
}

/// What was found of one kind.
struct Curve {
    kind: &'static Kind,
    /// Whether the filter can be told what is true.
    can_be_detected: bool,
    /// Whether the innovations hold it at any size.
    is_visible: bool,
    points: Vec<Point>,
}

/// What the first filter makes of it by itself.
fn first(metrics: Option<&Metrics>) -> Option<&EstimatorMetrics> {
    let estimator = metrics?.estimators().next()?;
    estimator.verdict.is_of_an_estimate().then_some(estimator)
}

/// Whether the verdict fails without a look at the reference.
fn fails_by_itself(metrics: Option<&Metrics>) -> bool {
    first(metrics).is_none_or(|estimator| {
        estimator.failing().next().is_some() || estimator.parameters.iter().any(|p| p.fault.is_some())
    })
}

impl Kind {
    /// Whether a filter can be told of it: what the simulation alone has is in no model.
    fn can_be_detected(&self) -> bool {
        self.key.starts_with("device.")
    }

    /// The figures of the filter that is told the truth, and of the one that is not, of one recording.
    fn both(&self, size: f64, seed: u64) -> [Option<Metrics>; 2] {
        let setting: [Setting; 1] = [self.setting(size)];
        let none: &[Setting] = &[];
        let device = Device::named(self.device);
        match (self.of_truth, self.can_be_detected()) {
            (false, _) => device.estimated_by(none, [none, &setting], seed),
            (true, true) => device.estimated_by(&setting, [&setting, none], seed),
            (true, false) => device.estimated_by(&setting, [none, none], seed),
        }
    }

    /// How much of a size the innovations hold.
    fn held(&self, size: f64) -> f64 {
        let seeds = FINDING.map(|seed| {
            let [right, wrong] = self.both(size, seed);
            match (first(right.as_ref()), first(wrong.as_ref())) {
                (Some(right), Some(wrong)) => {
                    2.0 * (right.log_likelihood().unwrap() - wrong.log_likelihood().unwrap())
                }
                (None, _) => panic!("{} by {size}: the filter that is right has no estimate", self.key),
                (_, None) => f64::INFINITY,
            }
        });
        let all: Vec<f64> = seeds.collect();
        all.iter().sum::<f64>() / all.len() as f64
    }

    /// The size at which the innovations begin to hold it, and whether there is one.
    fn smallest_held(&self) -> Option<f64> {
        let most = match self.by {
            By::Factor => 1.0,
            By::Sum => self.from * 4096.0,
            By::Division => 1e4,
        };
        let mut below = self.from / 64.0;
        let mut above = below;
        while self.held(above) < HELD {
            below = above;
            above *= 2.0;
            if above > most {
                return None;
            }
        }
        for _ in 0..4 {
            let middle = (below * above).sqrt();
            if self.held(middle) < HELD { below = middle } else { above = middle }
        }
        Some(above)
    }

    fn point(&self, size: f64) -> Point {
        let (mut failed, mut error, mut estimates) = (0, 0.0, 0);
        for seed in JUDGING {
            let wrong = self.judged(size, seed);
            failed += usize::from(fails_by_itself(wrong.as_ref()));
            if let Some(estimator) = first(wrong.as_ref()) {
                error += claims(estimator).map(|claim| claim.mean_square.sqrt()).fold(0.0, f64::max);
                estimates += 1;
            }
        }
        let held = if self.can_be_detected() { self.held(size) } else { f64::NAN };
        Point { size, held, failed, error: error / f64::from(estimates) }
    }

    fn curve(&'static self) -> Curve {
        let can_be_detected = self.can_be_detected();
        let held = if can_be_detected { self.smallest_held() } else { None };
        // What they never hold is shown about the size from which on a reference sees it.
        let at = held.or_else(|| size(self)).unwrap_or(self.from);
        let points = SIZES.map(|factor| self.point(factor * at)).into_iter().collect();
        Curve { kind: self, can_be_detected, is_visible: held.is_some(), points }
    }
}

/// Several curves at once.
fn curves(kinds: &'static [Kind]) -> Vec<Curve> {
    side_by_side(kinds, |kind| {
        let curve = kind.curve();
        // As soon as it is known: all of them take long.
        println!("{}", row(&curve));
        curve
    })
}

/// How a size reads.
fn written(kind: &Kind, size: f64) -> String {
    let digits = |x: f64| format!("{x:.2e}").parse::<f64>().unwrap().to_string();
    match kind.by {
        By::Factor => format!("{} %", digits(100.0 * size)),
        By::Sum => format!("{} {}", digits(size), kind.unit),
        By::Division => format!("1/{}", digits(1.0 + size)),
    }
}

/// The row of the book.
fn row(Curve { kind, points, .. }: &Curve) -> String {
    let list = |of: &dyn Fn(&Point) -> String| points.iter().map(of).collect::<Vec<_>>().join(", ");
    format!(
        "| {} | `{}` | {} | {} | {} | {} |",
        kind.device,
        kind.key.rsplit_once("scanner.").map_or(kind.key, |(_, key)| key),
        written(kind, points[1].size),
        list(&|p| p.failed.to_string()),
        list(&|p| format!("{:.0}", p.held)),
        list(&|p| format!("{:.1}", p.error)),
    )
}

fn print(curves: &[&Curve]) {
    println!(
        "| device | wrong | by | fail of 10 at ½, 1, 2, 4, 8 times that | d² there | errors in claimed sd there |"
    );
    println!("|---|---|---|---|---|---|");
    for curve in curves {
        println!("{}", row(curve));
    }
}

/// How many runs fail of those whose d² is in a range, and of how many.
fn share(curves: &[Curve], from: f64, to: f64) -> (usize, usize) {
    let points = curves.iter().filter(|curve| curve.can_be_detected).flat_map(|curve| &curve.points);
    let points = points.filter(|point| from <= point.held && (point.held < to || to.is_infinite()));
    points.fold((0, 0), |(failed, all), point| (failed + point.failed, all + JUDGING.count()))
}

/// Without a reference a fault that the innovations hold is seen: stiffness and offset at eight times the size from which on a test that
/// knows them sees them.
#[test]
fn what_innovations_hold_fails_without_a_reference() {
    for place in [0, 7] {
        let kind = &KINDS[place];
        let held = kind.smallest_held().unwrap();
        let right = Device::named(kind.device).judged(&[], &[], 211);
        let wrong = kind.judged(8.0 * held, 211);
        assert!(
            !fails_by_itself(right.as_ref()) && fails_by_itself(wrong.as_ref()),
            "{} by {held}",
            kind.key
        );
    }
}

#[test]
#[ignore = "10 minutes in a release build"]
fn slow_power_without_a_reference() {
    let curves = curves(&KINDS);
    let select = |wanted: &dyn Fn(&Curve) -> bool| curves.iter().filter(|c| wanted(c)).collect::<Vec<_>>();
    println!("What the innovations hold:");
    print(&select(&|c| c.can_be_detected && c.is_visible));
    println!("What they do not, at the sizes from which on a reference tells:");
    print(&select(&|c| c.can_be_detected && !c.is_visible));
    println!("What no model can be told:");
    print(&select(&|c| !c.can_be_detected));
    for (from, to) in
        [(0.0, HELD), (HELD, HELD_IN_A_HUNDRED), (HELD_IN_A_HUNDRED, 1000.0), (1000.0, f64::INFINITY)]
    {
        println!("d² from {from} to {to}: {:?} fail", share(&curves, from, to));
    }
    for (words, from) in [("one direction", HELD), ("a hundred directions", HELD_IN_A_HUNDRED)] {
        let (failed, all) = share(&curves, from, f64::INFINITY);
        println!(
            "held in {words}, d² from {from} on: {failed} of {all} fail, {:.1} %",
            100.0 * failed as f64 / all as f64
        );
    }
    for curve in &curves {
        for point in &curve.points {
            if point.held >= HELD && point.failed < JUDGING.count() {
                println!(
                    "missed: {} of the {} by {}, d² {:.0}: {} of {} fail",
                    curve.kind.key,
                    curve.kind.device,
                    written(curve.kind, point.size),
                    point.held,
                    point.failed,
                    JUDGING.count()
                );
            }
        }
    }
    for from in [HELD, HELD_IN_A_HUNDRED] {
        let (failed, all) = share(&curves, from, f64::INFINITY);
        assert!(failed as f64 >= 0.95 * all as f64, "{failed} of {all} from {from} on");
    }
}
