//! What the numbers of a clock's column count.

use super::scale::ColumnScale;
use crate::units::{ColumnHeader, kind};
use kalmems_formats::{LABVIEW_ZERO_S, SPREADSHEET_ZERO_S, TimeKind, TimeUnit};

/// What the numbers of a clock's column count, and whether that is the calendar.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct ClockUnit {
    pub(crate) unit: TimeUnit,
    /// Whether the times are seconds since 1970 in UTC.
    pub(crate) calendar: bool,
}

/// Words of a name that say where a count begins, each a word of its own, and the second that they name.
const ZEROS: [(&[&str], i64); 3] =
    [(&["unix", "epoch", "posix"], 0), (&["labview"], LABVIEW_ZERO_S), (&["excel"], SPREADSHEET_ZERO_S)];

/// Days, at the end of a name.
const DAYS: [&str; 3] = ["d", "day", "days"];

impl ClockUnit {
    /// What the format says, or else the name: its unit, and a word such as `unix` in it. `None` where neither says a unit of
    /// time. `scale` is what makes SI of the numbers, with what the settings say of them.
    pub(crate) fn of(header: &ColumnHeader, scale: ColumnScale, kind: Option<TimeKind>) -> Option<Self> {
        if let Some(kind) = kind {
            return Some(Self { unit: TimeUnit::SECOND, calendar: kind == TimeKind::Calendar });
        }
        let name = header.column.to_lowercase();
        let words: Vec<&str> = name.split(|letter: char| !letter.is_alphanumeric()).collect();
        let zero = ZEROS.iter().find(|(names, _)| words.iter().any(|word| names.contains(word)));
        let spreadsheet = zero.is_some_and(|(_, zero_s)| *zero_s == SPREADSHEET_ZERO_S);
        let unit = match header.unit {
            Some(unit) if kind::TIME.accepts(unit.dimension()) => of_scale(scale)?,
            None if words.len() > 1 && words.last().is_some_and(|last| DAYS.contains(last)) => {
                TimeUnit::seconds(86_400)
            }
            // A spreadsheet counts days.
            None if spreadsheet => TimeUnit::seconds(86_400),
            _ => return None,
        };
        let zero_s = zero.map_or(0, |(_, zero_s)| *zero_s);
        Some(Self { unit: unit.from(zero_s), calendar: zero.is_some() })
    }
}

/// Powers of ten and whole numbers of seconds, which all units of time have, and decimal numbers of few digits, such as the
/// 25·10⁻⁹ s of a counter.
fn of_scale(scale: ColumnScale) -> Option<TimeUnit> {
    match scale {
        ColumnScale::Decimal(power) => Some(TimeUnit::decimal(power)),
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // within the bounds
        ColumnScale::Factor(factor) if factor.fract() == 0.0 && (1.0..1e9).contains(&factor) => {
            Some(TimeUnit::seconds(factor as u32))
        }
        ColumnScale::Factor(factor) => {
            let text = format!("{factor:e}");
            let (digits, power) = text.split_once('e')?;
            let decimals = digits.split_once('.').map_or(0, |(_, decimals)| decimals.len());
            let power = power.parse::<i32>().ok()?.checked_sub(i32::try_from(decimals).ok()?)?;
            let factor: u32 = digits.replace('.', "").parse().ok()?;
            (factor < 1_000_000).then_some(TimeUnit { factor, ..TimeUnit::decimal(power) })
        }
        // A count has its own zero and goes forward.
        ColumnScale::Affine { .. } => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(name: &str) -> Option<(u32, i32, i64, bool)> {
        let header = ColumnHeader::parse(name);
        let ClockUnit { unit, calendar } = ClockUnit::of(&header, ColumnScale::of(header.unit), None)?;
        Some((unit.factor, unit.power, unit.zero_s, calendar))
    }

    #[test]
    fn a_counter_of_few_digits_is_exact() {
        let of = |factor: f64| of_scale(ColumnScale::Factor(factor)).map(|unit| (unit.factor, unit.power));
        assert_eq!(of(2.5e-8), Some((25, -9)));
        assert_eq!(of(60.0), Some((60, 0)));
        assert_eq!(of(1.0 / 3.0), None);
        assert_eq!(of(-60.0), None);
        assert_eq!(of_scale(ColumnScale::Affine { power: 0, factor: 1.0, offset: 1.0 }), None);
    }

    #[test]
    fn the_name_of_a_clock_says_what_it_counts() {
        for (name, expected) in [
            ("time_s", Some((1, 0, 0, false))),
            ("time_ns", Some((1, -9, 0, false))),
            ("time_min", Some((60, 0, 0, false))),
            ("time_h", Some((3600, 0, 0, false))),
            ("time_days", Some((86_400, 0, 0, false))),
            ("time_unix_ms", Some((1, -3, 0, true))),
            ("epoch_us", Some((1, -6, 0, true))),
            ("time_labview_s", Some((1, 0, -2_082_844_800, true))),
            ("time_excel", Some((86_400, 0, -2_209_161_600, true))),
            ("time", None),
            ("time_V", None),
            ("d", None),
            // No word of its own.
            ("unixoid", None),
        ] {
            assert_eq!(of(name), expected, "{name}");
        }
    }
}
