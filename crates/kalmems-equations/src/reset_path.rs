//! Where a path through resets is, and what has happened on it.

/// A path through resets: on which side of the zero of each reset's expression it is, and which of them have happened on it.
///
/// The side changes by the motion alone. A correction moves a state past zero without a reset, which is then made up for, and back without undoing one,
/// which then does not happen twice. A path keeps the sides of the first 32 resets; further ones go by the signs of their expressions.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ResetPath {
    /// A bit for each reset: whether its expression is below zero.
    below: u32,
    /// How often each has happened.
    happened: [u8; MOST_KEPT],
    /// Which has happened last.
    last: Option<usize>,
    /// One that happens so often and no more.
    held_back: Option<(usize, u8)>,
    /// Whether steps do not lead it on.
    pub(crate) stays: bool,
}

/// Resets of which a path keeps the sides.
pub(crate) const MOST_KEPT: usize = 32;

impl ResetPath {
    /// From these sides, a bit for each reset.
    pub fn of(below: u32) -> Self {
        Self { below, ..Self::default() }
    }

    /// The sides, a bit for each reset.
    pub const fn below(&self) -> u32 {
        self.below
    }

    /// How often a reset has happened.
    pub fn happened(&self, reset: usize) -> u8 {
        self.happened.get(reset).copied().unwrap_or(0)
    }

    /// The reset that has happened last.
    pub const fn last(&self) -> Option<usize> {
        self.last
    }

    /// The same, on which a reset happens so often and no more.
    #[must_use]
    pub const fn holding_back(self, reset: usize, after: u8) -> Self {
        Self { held_back: Some((reset, after)), ..self }
    }

    /// The same for several steps that all begin here.
    #[must_use]
    pub const fn staying(self) -> Self {
        Self { stays: true, ..self }
    }

    /// The same with this side of one reset.
    #[must_use]
    pub fn with_side(self, reset: usize, is_below: bool) -> Self {
        let bit = Self::bit(reset);
        Self { below: if is_below { self.below | bit } else { self.below & !bit }, ..self }
    }

    /// The same with all sides of another path, where steps lead it on.
    #[must_use]
    pub const fn with_sides_of(self, other: &Self) -> Self {
        Self { below: if self.stays { self.below } else { other.below }, ..self }
    }

    fn bit(reset: usize) -> u32 {
        u32::try_from(reset).ok().and_then(|reset| 1_u32.checked_shl(reset)).unwrap_or(0)
    }

    /// Whether the expression of a reset is below zero; `None` of a side that is not kept.
    pub(crate) fn is_below(&self, reset: usize) -> Option<bool> {
        (reset < MOST_KEPT).then(|| self.below & Self::bit(reset) != 0)
    }

    /// Enters that a reset happens.
    pub(crate) fn take(&mut self, reset: usize) {
        self.last = Some(reset);
        if let Some(happened) = self.happened.get_mut(reset) {
            *happened = happened.saturating_add(1);
        }
    }

    /// Whether a reset does not happen any more.
    pub(crate) fn holds_back(&self, reset: usize) -> bool {
        self.held_back.is_some_and(|(held, after)| held == reset && self.happened(reset) >= after)
    }
}
