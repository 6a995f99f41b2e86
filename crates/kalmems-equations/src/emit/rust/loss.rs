/// Samples within the bound after which a state that is kept takes one.
pub const UNSUSPECTED: u32 = 16;
/// The share of samples beyond the bound with which a filter goes on from means that it kept: its gate closes soon if they are right.
const ANEW: f32 = 0.07;

impl WatchRules {
    /// How many samples a state is kept for.
    pub fn longest(&self) -> u32 {
        self.lost.saturating_mul(64)
    }

    /// How many samples in a row a kept state predicts within the bound before the filter goes on from it.
    pub fn agrees(&self, measurements: usize) -> u32 {
        let samples = if self.lost / 2 > UNSUSPECTED { self.lost / 2 } else { UNSUSPECTED };
        samples.saturating_mul(measurements as u32)
    }

    /// A watch after the settling time.
    pub fn settled(&self) -> InnovationWatch {
        InnovationWatch { seen: self.settling, ..InnovationWatch::NEW }
    }

    /// A watch after the settling time, whose gate is open.
    pub fn anew(&self) -> InnovationWatch {
        InnovationWatch { beyond: ANEW, open: 1, ..self.settled() }
    }
}

/// What becomes of a filter whose gate is open, after a sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LossOutcome {
    /// It goes on.
    None,
    /// It goes on from the state that it has kept.
    Kept,
    /// It begins again.
    Again,
    /// It goes on, and what it has kept is given up.
    GivenUp,
}

/// What is known of a state that is kept through a loss of the signal: that of the filter as its gate opened, which is predicted on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct KeptRecord {
    /// 0 if nothing is kept, or samples since then.
    pub age: u32,
    /// Samples in a row that it predicts within the bound.
    pub agrees: u32,
    /// Samples in a row of which the filter, which takes samples as they are, has moved like it.
    pub alike: u32,
    /// How often the filter has begun again since then.
    pub tries: u32,
}

/// Where a filter begins again.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Beginning {
    /// With the means that it has kept and the covariance of the start.
    Kept,
    /// As at the start, while something is kept.
    Start,
    /// As at the start, without anything kept.
    Unknown,
}

/// Whether means point where others point: half a cycle apart they point the other way.
pub fn is_alike(pairs: impl Iterator<Item = [f32; 2]>) -> bool {
    let [mut product, mut own, mut kept] = [0.0_f32; 3];
    for [mean, other] in pairs {
        product += mean * other;
        own += mean * mean;
        kept += other * other;
    }
    product > 0.0 && product * product > 0.25 * own * kept
}

impl KeptRecord {
    /// Nothing is kept.
    pub const NONE: Self = Self { age: 0, agrees: 0, alike: 0, tries: 0 };

    /// Whether the state is predicted on.
    pub fn is_kept(&self, rules: &WatchRules) -> bool {
        self.age > 0 && self.age < rules.longest()
    }

    /// Whether too many samples are none of the signal, or something is kept since they were.
    #[inline(always)]
    pub fn is_open(&self, watches: &[InnovationWatch]) -> bool {
        self.age > 0 || watches.iter().any(|watch| watch.open > 0)
    }

    /// Whether the gate has opened just now: the filter keeps its state before the correction.
    pub fn opens(&mut self, rules: &WatchRules, watches: &[InnovationWatch]) -> bool {
        let opens = self.age == 0 && watches.iter().any(|watch| watch.open > 0 && watch.seen >= rules.settling);
        if opens {
            *self = Self { age: 1, ..Self::NONE };
        }
        opens
    }

    /// What looks at a sample for the state that is kept: it takes those that follow on some within the bound.
    pub fn look(&self, rules: &WatchRules) -> InnovationWatch {
        let suspect = if self.agrees < UNSUSPECTED { UNSUSPECTED } else { 0 };
        InnovationWatch { suspect, ..rules.settled() }
    }

    /// Takes notice of what was seen.
    pub fn looked(&mut self, look: &InnovationWatch) {
        if look.beyond > 0.0 {
            self.agrees = 0;
        } else if look.variance > 0.0 {
            self.agrees += 1;
        }
    }

    /// What becomes of the filter after a sample with an open gate; whether the numbers of the kept state are finite, and its means like those
    /// of the filter, is given.
    pub fn recovery(
        &mut self,
        rules: &WatchRules,
        watches: &[InnovationWatch],
        is_finite: bool,
        is_alike: bool,
    ) -> LossOutcome {
        let most = watches.iter().map(|watch| watch.open).max().unwrap_or(0);
        if self.is_kept(rules) {
            self.alike = if most == 0 && is_alike { self.alike + 1 } else { 0 };
            if self.agrees >= rules.agrees(watches.len()) && is_finite {
                self.age = 0;
                return LossOutcome::Kept;
            }
            if self.alike >= rules.agrees(watches.len()) {
                self.age = 0;
                return LossOutcome::None;
            }
            if most < rules.lost {
                self.age += 1;
                return if self.is_kept(rules) { LossOutcome::None } else { LossOutcome::GivenUp };
            }
        }
        if most >= rules.lost {
            return LossOutcome::Again;
        }
        if most == 0 {
            self.age = 0;
        }
        LossOutcome::None
    }

    /// Where a filter begins again: in turn with what is kept and as at the start.
    pub fn begins(&mut self, rules: &WatchRules, is_finite: bool) -> Beginning {
        if !(self.is_kept(rules) && is_finite) {
            self.age = 0;
            return Beginning::Unknown;
        }
        self.age += 1;
        self.tries += 1;
        if self.tries % 2 == 0 { Beginning::Start } else { Beginning::Kept }
    }
}
