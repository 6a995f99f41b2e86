//! A part of a study.

use super::StudyError;
use std::fmt;
use std::str::FromStr;

/// One of several equal parts of a study, for as many machines: every n-th run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shard {
    part: u64,
    of: u64,
}

impl Shard {
    /// All of it.
    pub const WHOLE: Self = Self { part: 1, of: 1 };

    /// Part `part` of `of`, counted from 1.
    pub fn new(part: u64, of: u64) -> Option<Self> {
        (1 <= part && part <= of).then_some(Self { part, of })
    }

    /// Whether it is all.
    pub fn is_whole(self) -> bool {
        self.of == 1
    }

    /// How many parts there are.
    pub(super) fn of(self) -> u64 {
        self.of
    }

    /// Whether a run belongs to it.
    pub(super) fn has(self, run: u64) -> bool {
        run % self.of == self.part - 1
    }

    /// How many of so many runs belong to it.
    pub(super) fn share(self, runs: u64) -> u64 {
        runs / self.of + u64::from(runs % self.of >= self.part)
    }
}

impl fmt::Display for Shard {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.part, self.of)
    }
}

impl FromStr for Shard {
    type Err = StudyError;

    /// From `2/3`.
    fn from_str(text: &str) -> Result<Self, StudyError> {
        let numbers =
            text.split_once('/').and_then(|(part, of)| Some((part.parse().ok()?, of.parse().ok()?)));
        numbers
            .and_then(|(part, of)| Self::new(part, of))
            .ok_or_else(|| StudyError::Shard { found: text.to_owned() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_run_is_in_exactly_one() {
        for of in 1..=5 {
            let shards: Vec<Shard> = (1..=of).filter_map(|part| Shard::new(part, of)).collect();
            for runs in 0..20 {
                assert!((0..runs).all(|run| shards.iter().filter(|s| s.has(run)).count() == 1));
                for shard in &shards {
                    assert_eq!(shard.share(runs), (0..runs).filter(|run| shard.has(*run)).count() as u64);
                }
            }
        }
    }

    #[test]
    fn is_written_as_it_is_read() {
        assert_eq!("2/3".parse::<Shard>().unwrap().to_string(), "2/3");
        for wrong in ["0/3", "4/3", "1", "a/b", "1/0", "-1/2", ""] {
            assert!(wrong.parse::<Shard>().is_err(), "{wrong}");
        }
    }
}
