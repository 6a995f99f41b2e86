//! Columns that repeat another one: two names of one channel, or one that was wired twice.

use super::FindingKind as Kind;
use super::findings::{FindingPlace, Findings};
use super::plan::TargetColumn;

/// Rows that tell it, at least.
const LEAST: usize = 16;
/// Rows that tell it while more are to come: two channels that hardly move may be equal for a while.
const LEAST_SO_FAR: usize = 256;

/// Two columns that have been the same until now.
struct EqualColumns {
    /// Their places among the targets, the later one first.
    places: [usize; 2],
    /// Whether each value of one is that of the other, and whether it is that with the other sign.
    is_same: bool,
    is_negative: bool,
    /// Whether it was told while the rows came.
    is_told: bool,
}

/// All pairs of columns that are the same as far as they are known.
pub(super) struct Repeats {
    pairs: Vec<EqualColumns>,
    /// Of each column its first value, and whether there has been another.
    seen: Vec<(f64, bool)>,
    line: usize,
    rows: usize,
}

impl Repeats {
    /// Of these columns, by whether each is looked at.
    pub(super) fn new(looked_at: &[bool]) -> Self {
        let is = |place: &usize| looked_at.get(*place).copied().unwrap_or(false);
        let places = || (0..looked_at.len()).filter(is);
        let pair = |places| EqualColumns { places, is_same: true, is_negative: true, is_told: false };
        Self {
            pairs: places()
                .flat_map(|a| places().filter(move |b| *b < a).map(move |b| pair([a, b])))
                .collect(),
            seen: vec![(f64::NAN, false); looked_at.len()],
            line: 0,
            rows: 0,
        }
    }

    /// Takes the values of so many new rows of all columns, the last ones that they have; the first of them stands on this line.
    pub(super) fn take(&mut self, targets: &[TargetColumn], rows: usize, line: usize) {
        if self.pairs.is_empty() || rows == 0 {
            return;
        }
        if self.rows == 0 {
            self.line = line;
        }
        self.rows += rows;
        let fresh = |place: usize| {
            let values = targets.get(place).map_or(&[][..], |target| target.values.as_slice());
            values.get(values.len().saturating_sub(rows)..).unwrap_or_default()
        };
        self.pairs.retain_mut(|pair| {
            let [one, other] = pair.places.map(fresh);
            let equal =
                |sign: f64| one.iter().zip(other).all(|(a, b)| *a == sign * b || (a.is_nan() && b.is_nan()));
            pair.is_same &= equal(1.0);
            pair.is_negative &= equal(-1.0);
            pair.is_same || pair.is_negative
        });
        for pair in &self.pairs {
            let place = pair.places[0];
            if let Some((first, varies)) = self.seen.get_mut(place).filter(|(_, varies)| !varies) {
                for value in fresh(place).iter().filter(|value| value.is_finite()) {
                    if first.is_nan() {
                        *first = *value;
                    }
                    *varies |= value != first;
                }
            }
        }
    }

    /// Gives the pairs that are equal so far, each once.
    pub(super) fn tell_news(&mut self, targets: &[TargetColumn], names: &[String], findings: &mut Findings) {
        if self.rows < LEAST_SO_FAR {
            return;
        }
        for pair in &mut self.pairs {
            if !pair.is_told && self.seen.get(pair.places[0]).is_some_and(|(_, varies)| *varies) {
                pair.is_told = true;
                pair.tell((targets, names), self.line, findings);
            }
        }
    }

    /// The end of the recording.
    pub(super) fn finish(self, targets: &[TargetColumn], names: &[String], findings: &mut Findings) {
        if self.rows < LEAST {
            return;
        }
        for pair in self.pairs {
            if self.seen.get(pair.places[0]).is_some_and(|(_, varies)| *varies) {
                pair.tell((targets, names), self.line, findings);
            }
        }
    }
}

impl EqualColumns {
    /// Of both it is told: which one is right is not known.
    fn tell(&self, (targets, names): (&[TargetColumn], &[String]), line: usize, findings: &mut Findings) {
        let [Some(one), Some(other)] = self.places.map(|place| targets.get(place)) else { return };
        let sign = if self.is_same { "" } else { " with the other sign" };
        for [of, as_in] in [[one, other], [other, one]] {
            let name = names.get(as_in.index).map_or("", String::as_str);
            let place = FindingPlace { column: Some(of.index), segment: None, line };
            findings.add(Kind::Repeats, place, || format!("repeats column `{name}`{sign} in every row"));
        }
    }
}
