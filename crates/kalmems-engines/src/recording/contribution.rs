//! Columns of an estimated motion that say by how much what is uncertain of the device moves it.

use crate::units::ColumnHeader;

/// What stands between a state and what moves it.
const BY: &str = "_by_";

/// How the name begins of what moves the motion of one record alone: such errors of several records are independent of one another.
pub const OF_RECORD: &str = "record.";

/// The column of a state of this unit that is moved by one standard deviation of something: `rate_by_electrodes.1A.gap_rad_per_s`.
pub fn contribution_column(state: &str, unit: &str, by: &str) -> String {
    format!("{state}{BY}{}_{unit}", by.replace(' ', "_"))
}

/// What moves a column of a motion, `rate_rad_per_s`, by the name of the column that says by how much; `None` of another column.
pub fn moved_by<'a>(column: &str, name: &'a str) -> Option<&'a str> {
    let header = ColumnHeader::parse(column);
    let unit = format!("_{}", header.unit_text);
    name.strip_prefix(column.strip_suffix(unit.as_str())?)?.strip_prefix(BY)?.strip_suffix(unit.as_str())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_column_is_known_by_what_moves_it() {
        let column = contribution_column("rate", "rad_per_s", "electrodes.1A.gap with electrodes.1A.gain");
        assert_eq!(moved_by("rate_rad_per_s", &column), Some("electrodes.1A.gap_with_electrodes.1A.gain"));
        for other in ["rate_rad_per_s", "rate_sd_rad_per_s", "angle_by_gap_rad", "rate_by_gap_rad"] {
            assert_eq!(moved_by("rate_rad_per_s", other), None, "{other}");
        }
    }
}
