//! What of several numbers recordings tell, where the errors of one hang on another's.

/// How much the errors of two numbers may hang together before the one is not known without the other: what is found of a number is then
/// moved by 0.3 of its standard error where the other stays a standard error off, which widens its error by 5 %.
pub const CONNECTED: f64 = 0.3;

/// Whether a number that was sought can be put into its place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Standing {
    /// It can.
    Told,
    /// The recordings do not tell it, or not well enough.
    Untold,
    /// It is told, but together with another, at this place, that is not: with that one put back to what it was it would be another.
    HangsOn(usize),
}

/// The standing of each of `count` numbers: all or nothing of those whose errors hang together by more than [`CONNECTED`], over others too.
pub fn standings(
    count: usize,
    is_told: &dyn Fn(usize) -> bool,
    correlation: &dyn Fn(usize, usize) -> f64,
) -> Vec<Standing> {
    let mut standings: Vec<Standing> =
        (0..count).map(|i| if is_told(i) { Standing::Told } else { Standing::Untold }).collect();
    let mut open: Vec<usize> = (0..count).filter(|i| standings[*i] == Standing::Untold).collect();
    while let Some(from) = open.pop() {
        for (to, standing) in standings.iter_mut().enumerate() {
            let together = correlation(from, to).abs();
            // What is not a number hangs on anything.
            let hangs = to != from && (together.is_nan() || together > CONNECTED);
            if hangs && *standing == Standing::Told {
                *standing = Standing::HangsOn(from);
                open.push(to);
            }
        }
    }
    standings
}

#[cfg(test)]
mod tests {
    use super::*;
    use Standing::{HangsOn, Told, Untold};

    /// Five numbers: the last is not told; the fourth hangs on it, the third on the fourth; the first two on each other alone.
    #[test]
    fn a_chain_of_correlations_is_all_or_nothing() {
        let pairs = [(0, 1, 0.9), (2, 3, -0.5), (3, 4, 0.4), (1, 2, 0.29)];
        let correlation = |i: usize, j: usize| {
            pairs.iter().find(|(a, b, _)| [(i, j), (j, i)].contains(&(*a, *b))).map_or(0.0, |(.., c)| *c)
        };
        let found = standings(5, &|i| i != 4, &correlation);
        assert_eq!(found, [Told, Told, HangsOn(3), HangsOn(4), Untold]);
        assert_eq!(standings(5, &|_| true, &correlation), [Told; 5]);
        assert_eq!(standings(2, &|i| i == 0, &|_, _| f64::NAN), [HangsOn(1), Untold]);
    }
}
