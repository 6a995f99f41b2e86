//! The labels of segments.

/// Labels that are the same number are the same label: `1711` and `1711.0`.
#[derive(PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Label {
    Number(u64),
    Text(Vec<u8>),
}

impl Label {
    pub(crate) fn of(bytes: &[u8]) -> Self {
        match fast_float2::parse::<f64, _>(bytes) {
            // Adding 0 makes one zero of the two.
            Ok(number) if number.is_finite() => Self::Number((number + 0.0).to_bits()),
            _ => Self::Text(bytes.to_vec()),
        }
    }
}
