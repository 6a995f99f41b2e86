/// The median of chi squared with one degree of freedom.
const MEDIAN: f32 = 0.454_936_4;
/// How much the followed median is moved by a sample.
const UP: f32 = 1.015_747_7;
const DOWN: f32 = 0.984_496_4;
/// The share of samples beyond the bound from which on all are taken, and below which they are not.
const OPENS: f32 = 0.125;
const CLOSES: f32 = 0.0625;
/// How suspect a rejection makes the samples behind it, and at most.
const SUSPECT: u32 = 2;
const MOST_SUSPECT: u32 = 16;
/// The median of a filter whose innovations are twice as large as it says.
const OVERCONFIDENT: f32 = 4.0 * MEDIAN;

/// How innovations are watched.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WatchRules {
    /// The largest normalised innovation squared of a sample that is one of the signal.
    pub largest_nis: f32,
    /// Whether a sample beyond the bound is left out.
    pub rejects: bool,
    /// Samples from the start on of which none is left out.
    pub settling: u32,
    /// The part of a mean that a sample is.
    pub forgets: f32,
    /// How many more samples are beyond the bound than within before a filter that has lost its signal begins again.
    pub lost: u32,
}

/// How a filter stands to a measurement. Where several hold, the first one of starting, lost, overconfident, saturated, left out and sign unsure is said.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SignalStatus {
    /// It settles, up to the end of the settling time: every sample is taken.
    Starting,
    /// The last sample was taken, and samples are as near as the filter says.
    Following,
    /// The last sample was not taken: it is missing, or none of the signal.
    LeftOut,
    /// Samples are more than twice as far from their predictions as the filter says: its variances are not to be trusted.
    Overconfident,
    /// As following, but the filter has lost what it knew of the motion, and the signal is the same for another one, such as the mirrored.
    SignUnsure,
    /// An eighth of the last samples and more were none of the signal, and all are taken until less than a sixteenth are, or the state that was kept from
    /// before predicts the signal again: the means are not to be trusted.
    Lost,
    /// The last sample was at an end of the range of its instrument: a gap.
    Saturated,
}

/// What the corrections by a measurement saw.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InnovationWatch {
    /// Measured minus predicted, in standard deviations of the noise.
    pub residual: f32,
    /// The variance of that by the filter.
    pub variance: f32,
    /// The normalised innovation squared; its mean is 1 of a filter that is right.
    pub nis: f32,
    /// The mean of those that were taken last.
    pub mean_nis: f32,
    /// What follows their median; 0.455 of a filter that is right.
    pub median: f32,
    /// The share of the last samples that were beyond the bound.
    pub beyond: f32,
    /// Samples since the last that was taken.
    pub since: u32,
    /// Samples from the start on, up to the end of the settling time.
    pub seen: u32,
    /// How suspect the next sample is.
    pub suspect: u32,
    /// 0, or, where too many samples were beyond the bound and all are taken, 1 and how many more were beyond it since then than within.
    pub open: u32,
}

impl InnovationWatch {
    /// Before the first sample.
    pub const NEW: Self = Self {
        residual: 0.0,
        variance: 0.0,
        nis: 0.0,
        mean_nis: 1.0,
        median: MEDIAN,
        beyond: 0.0,
        since: 0,
        seen: 0,
        suspect: 0,
        open: 0,
    };

    /// Takes notice of an innovation in standard deviations of the noise and of its variance; whether the sample is taken.
    #[inline(always)]
    pub fn believes(&mut self, rules: &WatchRules, residual: f32, variance: f32) -> bool {
        let nis = residual * residual / variance;
        let settles = self.seen < rules.settling;
        // At the end of the settling time the share is that of its last quarter.
        let early = if settles { 4.0 / (4.0 + self.seen as f32) } else { 0.0 };
        if settles {
            self.seen += 1;
        }
        if !(variance > 0.0 && nis - nis == 0.0) {
            self.since = self.since.saturating_add(1);
            return false;
        }
        let forgets = if early > rules.forgets { early } else { rules.forgets };
        let bound = if self.median > MEDIAN { rules.largest_nis * (self.median / MEDIAN) } else { rules.largest_nis };
        let is_beyond = nis > bound;
        let taken = !rules.rejects || settles || self.open > 0 || (self.suspect <= SUSPECT && !is_beyond);
        self.residual = residual;
        self.variance = variance;
        self.nis = nis;
        self.beyond += ((if is_beyond { 1.0 } else { 0.0 }) - self.beyond) * forgets;
        let opens = self.beyond > (if self.open > 0 { CLOSES } else { OPENS });
        self.open = if !opens {
            0
        } else if settles || (self.open < 2 && nis <= rules.largest_nis) {
            1
        } else if nis > rules.largest_nis {
            self.open.saturating_add(1)
        } else {
            self.open - 1
        };
        self.suspect = if opens {
            0
        } else if is_beyond {
            if self.suspect + SUSPECT < MOST_SUSPECT { self.suspect + SUSPECT } else { MOST_SUSPECT }
        } else {
            self.suspect.saturating_sub(1)
        };
        if !taken {
            self.since = self.since.saturating_add(1);
            return false;
        }
        self.since = 0;
        self.mean_nis += (nis - self.mean_nis) * forgets;
        self.median *= if nis > self.median { UP } else { DOWN };
        if self.median < 0.25 * MEDIAN {
            self.median = 0.25 * MEDIAN;
        }
        true
    }

    /// How the filter stands to the measurement.
    pub fn status(&self, rules: &WatchRules) -> SignalStatus {
        if self.seen < rules.settling {
            SignalStatus::Starting
        } else if self.open > 0 {
            SignalStatus::Lost
        } else if self.median > OVERCONFIDENT {
            SignalStatus::Overconfident
        } else if self.since > 0 {
            SignalStatus::LeftOut
        } else {
            SignalStatus::Following
        }
    }
}
