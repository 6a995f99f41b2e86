//! Whether a column can be the signal of a device.

use super::{Finding, FindingKind};

/// The first finding by which one of these columns is no signal of a device throughout, in the segments that are wanted by their labels: it
/// is clipped, lacks a bit, or is another channel.
///
/// What hangs or is missing for a while is told, and left to the filters, which find it as they find outliers.
pub fn unusable_signal<'a>(
    diagnosis: &'a [Finding],
    columns: &[&str],
    wanted: impl Fn(&str) -> bool,
) -> Option<&'a Finding> {
    diagnosis.iter().find(|finding| {
        matches!(finding.kind, FindingKind::Saturation | FindingKind::DroppedBit | FindingKind::Repeats)
            && finding.column.as_deref().is_some_and(|column| columns.contains(&column))
            && finding.segment.as_deref().is_none_or(&wanted)
    })
}
