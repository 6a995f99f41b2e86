//! What the settings say of a column, applied to its numbers.

use super::scale::ColumnScale;
use super::{ColumnReading, DeclaredColumn};
use crate::units::{ColumnHeader, Unit};

/// What to write in the settings for a column whose unit is needed and not known.
pub(super) fn way_out(declared: &DeclaredColumn) -> Option<String> {
    let column = toml::Value::String(declared.column.clone());
    let unit = declared.usual_unit?;
    Some(format!("write `{} = {{ column = {column}, unit = \"{unit}\" }}` with its unit", declared.key))
}

/// The unit of the values, where one is known, and how the numbers become SI; in words what does not fit.
pub(super) fn apply(
    reading: &ColumnReading,
    file: &ColumnHeader,
) -> Result<(ColumnHeader, ColumnScale), String> {
    let known = reading.unit.as_ref().map(|(_, unit)| *unit).or(file.unit);
    let numbers = known.unwrap_or(Unit::ONE);
    let (unit, factor) = match &reading.scale {
        Some(scale) => scale.times_unit(numbers),
        None => (numbers, numbers.factor()),
    };
    let offset = match &reading.offset {
        Some(offset) if offset.unit().dimension() != unit.dimension() => {
            return Err(format!(
                "the offset `{}` has the dimension {} and the values have {}",
                offset.text(),
                offset.unit().dimension(),
                unit.dimension()
            ));
        }
        Some(offset) => offset.si(),
        None => 0.0,
    };
    let unit_text = match (&reading.scale, &reading.unit) {
        (Some(scale), _) if scale.unit() != Unit::ONE => unit.si_header(),
        (_, Some((text, _))) => text.clone(),
        _ => file.unit_text.clone(),
    };
    let scaled = reading.scale.as_ref().is_some_and(|scale| scale.unit() != Unit::ONE);
    let header = ColumnHeader {
        column: file.column.clone(),
        unit: (known.is_some() || scaled).then_some(unit),
        unit_text,
        is_stated: true,
    };
    Ok((header, ColumnScale::of_factor_and_offset(factor, offset)))
}

/// The ends of the range of the instrument in SI, in the unit of the values; in words what does not fit.
pub(super) fn range(reading: &ColumnReading, values: &ColumnHeader) -> Result<Option<(f64, f64)>, String> {
    let Some([low, high]) = &reading.range else { return Ok(None) };
    let unit = values.unit.unwrap_or(Unit::ONE);
    for end in [low, high] {
        if end.unit().dimension() != unit.dimension() {
            return Err(format!(
                "the end `{}` of the range has the dimension {} and the values have {}",
                end.text(),
                end.unit().dimension(),
                unit.dimension()
            ));
        }
    }
    Ok(Some((low.si(), high.si())))
}

/// In words, for the diagnosis.
pub(super) fn words(reading: &ColumnReading, file: &ColumnHeader) -> String {
    let mut words = match &reading.unit {
        Some((text, _)) => format!("its numbers are in `{text}`"),
        None if file.unit_text.is_empty() => "its numbers have no unit".to_owned(),
        None => format!("its numbers are in `{}`", file.unit_text),
    };
    if let Some(scale) = &reading.scale {
        words += &format!(", times `{}`", scale.text());
    }
    if let Some(offset) = &reading.offset {
        words += &format!(", plus `{}`", offset.text());
    }
    if let Some([low, high]) = &reading.range {
        words += &format!(", between `{}` and `{}`", low.text(), high.text());
    }
    if let Some(Ok(compensation)) = &reading.compensation {
        let curves = compensation.cross_axis.iter().map(|(_, curve)| curve);
        let curves = compensation.bias.iter().chain(&compensation.scale_factor).chain(curves);
        let names: Vec<String> = curves.map(|curve| format!("`{}`", curve.name)).collect();
        words += &format!(
            ", compensated by {} at the temperature of `{}`",
            names.join(", "),
            compensation.temperature.column
        );
    }
    words
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::units::Value;

    fn reading(unit: &str, scale: &str, offset: &str) -> ColumnReading {
        let value = |text: &str| (!text.is_empty()).then(|| Value::parse(text).unwrap());
        ColumnReading {
            unit: (!unit.is_empty()).then(|| (unit.to_owned(), Unit::parse(unit).unwrap())),
            scale: value(scale),
            offset: value(offset),
            ..ColumnReading::default()
        }
    }

    #[test]
    fn powers_of_ten_move_the_exponent_and_others_multiply() {
        for (unit, scale, offset, expected, si) in [
            ("V", "", "", ColumnScale::Decimal(0), "V"),
            ("mV", "", "", ColumnScale::Decimal(-3), "V"),
            ("mV", "10", "", ColumnScale::Decimal(-2), "V"),
            ("V", "10 mV/V", "", ColumnScale::Decimal(-2), "V"),
            ("V", "2.5", "", ColumnScale::Factor(2.5), "V"),
            // 2.5 mV, rounded once.
            ("mV", "2.5", "", ColumnScale::Factor(2.5e-3), "V"),
            ("V", "-1", "", ColumnScale::Affine { power: 0, factor: -1.0, offset: 0.0 }, "V"),
            ("mV", "", "0.1 V", ColumnScale::Affine { power: -3, factor: 1.0, offset: 0.1 }, "V"),
            ("V", "2.5", "100 mV", ColumnScale::Affine { power: 0, factor: 2.5, offset: 0.1 }, "V"),
            ("V", "0.5 gn/V", "", ColumnScale::Factor(0.5 * 9.806_65), "m/s^2"),
            ("1", "2.5", "0.25", ColumnScale::Affine { power: 0, factor: 2.5, offset: 0.25 }, "1"),
        ] {
            let (header, found) = apply(&reading(unit, scale, offset), &ColumnHeader::parse("u")).unwrap();
            assert_eq!(found, expected, "{unit} {scale} {offset}");
            let si = Unit::parse(si).unwrap().dimension();
            assert_eq!(header.unit.unwrap().dimension(), si, "{unit} {scale} {offset}");
        }
    }

    #[test]
    fn the_unit_of_the_name_counts_where_none_is_stated() {
        let (header, scale) = apply(&reading("", "10", ""), &ColumnHeader::parse("u_mV")).unwrap();
        assert_eq!((header.unit_text.as_str(), scale), ("mV", ColumnScale::Decimal(-2)));
        let (header, scale) = apply(&reading("", "10", ""), &ColumnHeader::parse("u")).unwrap();
        assert_eq!((header.unit, scale), (None, ColumnScale::Decimal(1)));
    }

    #[test]
    fn an_offset_of_another_dimension_is_refused() {
        let error = apply(&reading("V", "0.5 gn/V", "1 V"), &ColumnHeader::parse("u")).unwrap_err();
        insta::assert_snapshot!(error, @"the offset `1 V` has the dimension V and the values have m/s^2");
    }
}
