//! What of several numbers recordings tell, where the errors of one depend on another's.

/// How much the errors of two numbers may hang together before the one is not known without the other: what is found of a number is then
/// moved by 0.3 of its standard error where the other stays a standard error off, which widens its error by 5 %.
pub const CONNECTED: f64 = 0.3;

/// Whether a number that was sought can be put into its place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NumberStatus {
    /// It can.
    Determined,
    /// The recordings do not tell it, or not well enough.
    Undetermined,
    /// It is told, but together with another, at this place, that is not: with that one put back to what it was it would be another.
    DependsOn(usize),
}

/// The status of each of `count` numbers: all or nothing of those whose errors hang together by more than [`CONNECTED`], over others too.
pub fn number_statuses(
    count: usize,
    is_told: &dyn Fn(usize) -> bool,
    correlation: &dyn Fn(usize, usize) -> f64,
) -> Vec<NumberStatus> {
    let mut statuses: Vec<NumberStatus> = (0..count)
        .map(|i| if is_told(i) { NumberStatus::Determined } else { NumberStatus::Undetermined })
        .collect();
    let mut open: Vec<usize> = (0..count).filter(|i| statuses[*i] == NumberStatus::Undetermined).collect();
    while let Some(from) = open.pop() {
        for (to, status) in statuses.iter_mut().enumerate() {
            let together = correlation(from, to).abs();
            // What is not a number depends on anything.
            let hangs = to != from && (together.is_nan() || together > CONNECTED);
            if hangs && *status == NumberStatus::Determined {
                *status = NumberStatus::DependsOn(from);
                open.push(to);
            }
        }
    }
    statuses
}

/// Numbers that make a recording the likeliest, and what is known of them.
pub struct LikelihoodSolution<'a> {
    /// Where they are, each from what was stated of it.
    pub at: &'a [f64],
    /// Their standard errors.
    pub spread: &'a dyn Fn(usize) -> f64,
    /// Whether a number is told well enough to be put into its place.
    pub is_told: &'a dyn Fn(usize) -> bool,
    /// The correlation of the errors of two numbers.
    pub correlation: &'a dyn Fn(usize, usize) -> f64,
}

/// As [`number_statuses`], with what a number that keeps its stated value does to the others.
///
/// Correlations are those at the likeliest values. What is stated of a number that keeps its value may be far from there, so that the others are
/// sought once more beside it, by `sought` with those that are kept: one that then moves by more than its standard error depends on it.
///
/// # Errors
/// Those of `sought`.
pub fn joint_number_statuses<E>(
    likeliest: &LikelihoodSolution,
    mut sought: impl FnMut(&[bool]) -> Result<Vec<f64>, E>,
) -> Result<Vec<NumberStatus>, E> {
    let LikelihoodSolution { at, spread, is_told, correlation } = likeliest;
    let count = at.len();
    let mut moved = vec![false; count];
    loop {
        let mut statuses = number_statuses(count, &|i| is_told(i) && !moved[i], correlation);
        let kept: Vec<bool> = statuses.iter().map(|status| *status != NumberStatus::Determined).collect();
        let strongest = |i: usize| {
            let others = (0..count).filter(|j| !is_told(*j));
            others.max_by(|a, b| correlation(i, *a).abs().total_cmp(&correlation(i, *b).abs()))
        };
        for (i, status) in statuses.iter_mut().enumerate().filter(|(i, _)| moved[*i]) {
            *status = strongest(i).map_or(NumberStatus::Undetermined, NumberStatus::DependsOn);
        }
        if !kept.contains(&true) || !kept.contains(&false) {
            return Ok(statuses);
        }
        let beside = sought(&kept)?;
        let distance = |i: usize| beside.get(i).map_or(f64::INFINITY, |there| (there - at[i]).abs());
        let is_far = |i: usize| distance(i).is_nan() || distance(i) > spread(i);
        let moves = |i: usize| !kept[i] && is_far(i);
        let now: Vec<bool> = (0..count).map(|i| moved[i] || moves(i)).collect();
        if now == moved {
            return Ok(statuses);
        }
        moved = now;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use NumberStatus::{DependsOn, Determined, Undetermined};

    /// The second number is uncorrelated with the first at the likeliest values, and another beside what is stated of it.
    #[test]
    fn a_number_that_is_correlated_with_an_undetermined_one_depends_on_it() {
        let likeliest = LikelihoodSolution {
            at: &[2.0, 0.1, 0.0],
            spread: &|_| 0.05,
            is_told: &|i| i != 0,
            correlation: &|i, j| f64::from(u8::from(i == j)),
        };
        let mut asked = 0;
        let found = joint_number_statuses(&likeliest, |kept| -> Result<_, ()> {
            asked += 1;
            assert!(kept[0]);
            Ok(vec![0.0, 0.3, 0.01])
        });
        assert_eq!((found.unwrap(), asked), (vec![Undetermined, DependsOn(0), Determined], 2));
        assert_eq!(joint_number_statuses(&likeliest, |_| Err("stopped")), Err("stopped"));
    }

    /// Five numbers: the last is not told; the fourth depends on it, the third on the fourth; the first two on each other alone.
    #[test]
    fn a_chain_of_correlations_is_all_or_nothing() {
        let pairs = [(0, 1, 0.9), (2, 3, -0.5), (3, 4, 0.4), (1, 2, 0.29)];
        let correlation = |i: usize, j: usize| {
            pairs.iter().find(|(a, b, _)| [(i, j), (j, i)].contains(&(*a, *b))).map_or(0.0, |(.., c)| *c)
        };
        let found = number_statuses(5, &|i| i != 4, &correlation);
        assert_eq!(found, [Determined, Determined, DependsOn(3), DependsOn(4), Undetermined]);
        assert_eq!(number_statuses(5, &|_| true, &correlation), [Determined; 5]);
        assert_eq!(number_statuses(2, &|i| i == 0, &|_, _| f64::NAN), [DependsOn(1), Undetermined]);
    }
}
