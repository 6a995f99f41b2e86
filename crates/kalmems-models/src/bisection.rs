//! Where something first becomes true, by halving.

use kalmems_core::Scalar;

/// The ends of an interval that is halved so often, so that at the upper end `is_beyond` holds, and at the lower one it does not;
/// so it is at the given ends.
pub(crate) fn halved<P: Scalar>(
    (mut low, mut high): (P, P),
    times: u32,
    is_beyond: impl Fn(P) -> bool,
) -> (P, P) {
    for _ in 0..times {
        let middle = (low + high).half();
        if is_beyond(middle) {
            high = middle;
        } else {
            low = middle;
        }
    }
    (low, high)
}
