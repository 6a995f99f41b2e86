//! A long signal in few points, from which no extreme value is missing.

/// The lowest and highest values of consecutive stretches of a signal.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Envelope {
    /// One point per stretch that holds a number.
    pub points: Vec<EnvelopePoint>,
    /// How many values are NaN.
    pub missing: usize,
}

/// A stretch of a signal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EnvelopePoint {
    /// The index of its first value, NaN or not.
    pub first: usize,
    /// Its lowest value.
    pub minimum: f64,
    /// Its highest value.
    pub maximum: f64,
}

/// The envelope in at most `stretches` points; each value is in exactly one, and NaN is counted, not drawn.
pub fn envelope(values: &[f64], stretches: usize) -> Envelope {
    let stretches = stretches.min(values.len());
    let mut result = Envelope::default();
    let mut rest = values;
    // Stretch `i` begins at `i · len / stretches`, rounded down: what the division leaves over is carried on.
    let mut carried = 0;
    for _ in 0..stretches {
        let first = values.len() - rest.len();
        carried += values.len() % stretches;
        let more = usize::from(carried >= stretches);
        carried -= more * stretches;
        let (stretch, others) = rest.split_at(rest.len().min(values.len() / stretches + more));
        rest = others;
        let mut numbers = stretch.iter().copied().filter(|v| !v.is_nan());
        let mut count = 0;
        if let Some(start) = numbers.next() {
            count = 1;
            let (minimum, maximum) = numbers
                .inspect(|_| count += 1)
                .fold((start, start), |(low, high), v| (low.min(v), high.max(v)));
            result.points.push(EnvelopePoint { first, minimum, maximum });
        }
        result.missing += stretch.len() - count;
    }
    result
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn point(first: usize, minimum: f64, maximum: f64) -> EnvelopePoint {
        EnvelopePoint { first, minimum, maximum }
    }

    #[test]
    fn few_values_are_points_of_their_own() {
        let nan = f64::NAN;
        assert_eq!(envelope(&[3.0, nan, 1.0], 10).points, [point(0, 3.0, 3.0), point(2, 1.0, 1.0)]);
        assert_eq!(envelope(&[3.0, nan, 1.0], 10).missing, 1);
        assert_eq!(envelope(&[3.0, nan, 1.0, 5.0], 2).points, [point(0, 3.0, 3.0), point(2, 1.0, 5.0)]);
        assert_eq!(envelope(&[], 4), Envelope::default());
        assert_eq!(envelope(&[1.0], 0), Envelope::default());
    }

    proptest! {
        #[test]
        fn no_extreme_value_is_missing(
            values in proptest::collection::vec(prop_oneof![4 => -1e3..1e3_f64, 1 => Just(f64::NAN)], 1..500),
            stretches in 1..100_usize,
        ) {
            let found = envelope(&values, stretches);
            let numbers = || values.iter().copied().filter(|v| !v.is_nan());
            prop_assert_eq!(found.missing, values.len() - numbers().count());
            prop_assert!(found.points.len() <= stretches);
            prop_assert_eq!(
                found.points.iter().map(|p| p.minimum).reduce(f64::min), numbers().reduce(f64::min)
            );
            prop_assert_eq!(
                found.points.iter().map(|p| p.maximum).reduce(f64::max), numbers().reduce(f64::max)
            );
            prop_assert!(found.points.is_sorted_by(|a, b| a.first < b.first));
        }
    }
}
