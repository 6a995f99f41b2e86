//! Filters whose answers are the same: a page draws one of them.

use crate::estimate::{SegmentEstimate, StateSeries, Trajectory, TrajectoryKind};

/// Answers that differ by less than this share of the claimed standard deviation, root mean square, are the same in a picture.
const SAME: f64 = 0.01;

/// The filter before this one in the estimate with the same answer after the settling time, if there is one.
pub(super) fn twin<'a>(estimate: &'a SegmentEstimate, trajectory: &Trajectory) -> Option<&'a Trajectory> {
    let before = estimate.trajectories.iter().take_while(|other| other.key != trajectory.key);
    let of_its_kind =
        |other: &&Trajectory| other.kind == trajectory.kind && trajectory.kind == TrajectoryKind::Filtered;
    before.filter(of_its_kind).find(|other| is_the_same(estimate, other, trajectory))
}

/// A sentence for captions on the filters that are not drawn, with the space before it; empty if there are none.
pub(super) fn not_drawn(estimate: &SegmentEstimate) -> String {
    let pairs = estimate.trajectories.iter().filter_map(|one| Some((twin(estimate, one)?, one)));
    let each = pairs.map(|(drawn, one)| {
        format!(
            " {} agrees with {} within {:.0} % of the claimed standard deviation and is not drawn.",
            one.name,
            drawn.name,
            100.0 * SAME
        )
    });
    each.collect()
}

fn is_the_same(estimate: &SegmentEstimate, one: &Trajectory, other: &Trajectory) -> bool {
    let scored = other.scored_after(estimate.start_s, estimate.skip_s);
    let agree = |(a, b): (&StateSeries, &StateSeries)| {
        let of = |values: &[f64]| values.get(scored.clone()).map(<[f64]>::to_vec).unwrap_or_default();
        let (means, sds) = (of(&a.mean).into_iter().zip(of(&b.mean)), of(&a.sd).into_iter().zip(of(&b.sd)));
        let finite = |(x, y): &(f64, f64)| x.is_finite() && y.is_finite();
        let apart: f64 = means.filter(finite).map(|(x, y)| (x - y).powi(2)).sum();
        let (claimed, sds_apart) = sds
            .filter(finite)
            .fold((0.0, 0.0), |(claimed, apart), (x, y)| (claimed + x * x, apart + (x - y).powi(2)));
        a.name == b.name && claimed > 0.0 && apart.max(sds_apart) < SAME * SAME * claimed
    };
    one.states.len() == other.states.len() && one.states.iter().zip(&other.states).all(agree)
}
