//! The labels of segments.

/// Labels that are the same number are the same label: `1711` and `1711.0`.
#[derive(Clone, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum SegmentLabel {
    Number(u64),
    Text(Vec<u8>),
}

impl SegmentLabel {
    pub(crate) fn of(bytes: &[u8]) -> Self {
        match fast_float2::parse::<f64, _>(bytes) {
            Ok(number) if number.is_finite() => Self::of_number(number),
            _ => Self::Text(bytes.to_vec()),
        }
    }

    pub(crate) fn of_number(number: f64) -> Self {
        // Adding 0 makes one zero of the two.
        Self::Number((number + 0.0).to_bits())
    }
}
