//! Numbers for people.

/// Three significant digits without an exponent.
pub fn significant(value: f64) -> String {
    if value == 0.0 || !value.is_finite() {
        return format!("{value}");
    }
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // clamped to a small positive number
    let decimals = (2.0 - value.abs().log10().floor()).clamp(0.0, 9.0) as usize;
    format!("{value:.decimals$}")
}

#[cfg(test)]
mod tests {
    use super::significant;

    #[test]
    fn three_digits() {
        for (value, text) in
            [(0.018_063, "0.0181"), (2.694, "2.69"), (123.45, "123"), (1e-5, "0.0000100"), (0.0, "0")]
        {
            assert_eq!(significant(value), text);
        }
    }
}
