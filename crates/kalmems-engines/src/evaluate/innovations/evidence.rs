//! What the innovations look like, as pictures show it: from the sums that the tests are computed from.

use super::{InnovationRecord, normal_tail};
use statrs::distribution::{ContinuousCDF, Gamma};

/// Groups of frequencies, equally spaced in the logarithm.
const GROUPS: usize = 160;

/// The largest |z| that has a bin of its own, and the bins of a unit.
const FARTHEST: f64 = 8.0;
const PER_UNIT: f64 = 4.0;

/// What the normalised innovations z of a filter look like: of one that is right they are white and normal, with variance 1.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct InnovationEvidence {
    /// How many there were.
    pub count: f64,
    /// Their spectrum, 1 throughout of a filter that is right; nothing of too few.
    pub spectrum: Vec<SpectrumGroup>,
    /// Their correlation with the innovation 1, 2 and so on updates before, and within which ± 95 of 100 lie of a filter that is
    /// right.
    pub autocorrelation: Vec<[f64; 2]>,
    /// Over the cycle of each axis's motion.
    pub cycles: Vec<CycleEvidence>,
    /// How they are distributed.
    pub histogram: InnovationHistogram,
}

/// The spectrum in a group of neighbouring frequencies.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpectrumGroup {
    /// The middle of the group in Hz.
    pub frequency_hz: f64,
    /// The mean of its ordinates.
    pub level: f64,
    /// The largest of them.
    pub largest: f64,
    /// Where 95 of 100 means lie of a filter that is right.
    pub expected: [f64; 2],
}

/// Innovations over the cycle of a motion.
#[derive(Clone, Debug, PartialEq)]
pub struct CycleEvidence {
    /// The frequency of the motion in Hz.
    pub frequency_hz: f64,
    /// Part by part of the cycle: the phase in degrees, how many there were, the mean of z and that of z².
    pub parts: Vec<[f64; 4]>,
}

/// Counts of z in bins of equal width; what lies further out is in the outermost ones.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct InnovationHistogram {
    counts: Vec<f64>,
}

impl InnovationHistogram {
    /// Takes an innovation in.
    #[inline]
    pub(super) fn take(&mut self, z: f64) {
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a small whole number
        if self.counts.is_empty() {
            self.counts = vec![0.0; (2.0 * FARTHEST * PER_UNIT) as usize];
        }
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a cast saturates
        let bin = ((z + FARTHEST) * PER_UNIT) as usize;
        let last = self.counts.len() - 1;
        self.counts[bin.min(last)] += 1.0;
    }

    /// The ends of each bin, its share of all, and the share of a normal distribution.
    pub fn shares(&self) -> impl Iterator<Item = [f64; 4]> + '_ {
        let all: f64 = self.counts.iter().sum();
        let last = self.counts.len().saturating_sub(1);
        self.counts.iter().enumerate().map(move |(i, count)| {
            let from = i as f64 / PER_UNIT - FARTHEST;
            let to = from + 1.0 / PER_UNIT;
            // The outermost hold what lies further out.
            let below = if i == 0 { 1.0 } else { normal_tail(from) };
            let above = if i == last { 0.0 } else { normal_tail(to) };
            [from, to, count / all, below - above]
        })
    }
}

impl InnovationRecord {
    /// What they look like.
    pub fn evidence(&self) -> InnovationEvidence {
        let interval_s = (self.last_s - self.first_s) / (self.moments.count - 1.0).max(1.0);
        let spectrum = self.spectrum.spectrum();
        let groups = spectrum.iter().flat_map(|spectrum| spectrum.groups(GROUPS)).map(|group| {
            let law = Gamma::new(group.count, 1.0);
            let end = |p: f64| law.as_ref().map_or(f64::NAN, |law| law.inverse_cdf(p) / group.count);
            SpectrumGroup {
                frequency_hz: group.frequency / interval_s,
                level: group.mean,
                largest: group.largest,
                expected: [end(0.025), end(0.975)],
            }
        });
        InnovationEvidence {
            count: self.moments.count,
            spectrum: groups.collect(),
            autocorrelation: spectrum
                .iter()
                .flat_map(super::spectrum::InnovationSpectrum::autocorrelation)
                .collect(),
            cycles: self.cycles.iter().map(super::cycle::InnovationCycle::evidence).collect(),
            histogram: self.histogram.clone(),
        }
    }
}
