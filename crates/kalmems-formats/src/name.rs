//! Names of columns with their units.

/// The name with the unit that a format keeps elsewhere, unless it ends with it already.
pub(crate) fn with_unit(name: &str, unit: &str) -> String {
    let (name, unit) = (name.trim(), without_brackets(unit.trim()));
    if unit.is_empty() {
        return name.to_owned();
    }
    match name.strip_suffix(unit) {
        Some(rest) if rest.ends_with('_') => name.to_owned(),
        _ => format!("{name}_{unit}"),
    }
}

/// A unit without the pair of brackets around it: `[V]`, `(V)`.
fn without_brackets(unit: &str) -> &str {
    let inner = [('[', ']'), ('(', ')')].into_iter().find_map(|(open, close)| {
        let inner = unit.strip_prefix(open)?.strip_suffix(close)?;
        // Those of `(m)/(s)` are two pairs.
        (!inner.contains([open, close])).then_some(inner)
    });
    inner.map_or(unit, str::trim)
}

#[cfg(test)]
mod tests {
    use super::with_unit;

    #[test]
    fn a_unit_is_joined_once() {
        assert_eq!(with_unit("cap", "V"), "cap_V");
        assert_eq!(with_unit("cap_V", "V"), "cap_V");
        assert_eq!(with_unit(" cap ", " V "), "cap_V");
        assert_eq!(with_unit("cap", "[V]"), "cap_V");
        assert_eq!(with_unit("cap_V", "( V )"), "cap_V");
        assert_eq!(with_unit("speed", "(m)/(s)"), "speed_(m)/(s)");
        assert_eq!(with_unit("cap", "[]"), "cap");
        assert_eq!(with_unit("cap", ""), "cap");
        // Ends with the letter, not with the unit.
        assert_eq!(with_unit("EMV", "V"), "EMV_V");
    }
}
