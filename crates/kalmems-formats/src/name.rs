//! Names of columns with their units.

/// The name with the unit that a format keeps elsewhere, unless it ends with it already.
pub(crate) fn with_unit(name: &str, unit: &str) -> String {
    let (name, unit) = (name.trim(), unit.trim());
    if unit.is_empty() {
        return name.to_owned();
    }
    match name.strip_suffix(unit) {
        Some(rest) if rest.ends_with('_') => name.to_owned(),
        _ => format!("{name}_{unit}"),
    }
}

#[cfg(test)]
mod tests {
    use super::with_unit;

    #[test]
    fn a_unit_is_joined_once() {
        assert_eq!(with_unit("cap", "V"), "cap_V");
        assert_eq!(with_unit("cap_V", "V"), "cap_V");
        assert_eq!(with_unit(" cap ", " V "), "cap_V");
        assert_eq!(with_unit("cap", ""), "cap");
        // Ends with the letter, not with the unit.
        assert_eq!(with_unit("EMV", "V"), "EMV_V");
    }
}
