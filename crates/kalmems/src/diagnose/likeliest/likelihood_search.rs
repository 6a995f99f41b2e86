//! The sizes that make the innovations of all recordings the likeliest, and how far from there they may be.

use super::prior::FactorPrior;
use crate::config::Key;
use crate::diagnose::bench::{TestedRows, TrialBench};
use crate::diagnose::cause::Cause;
use crate::diagnose::change::TrialChange;
use crate::diagnose::search::{CauseSearch, MostLikelySizes, most_likely_sizes};
use crate::diagnose::suspect::{NumberRole, Suspect};
use crate::diagnose::trial::{DiagnosisTrial, TrialBlocks};
use crate::identify::{TWO_SIDED, likelihood_half_width};
use crate::progress::Progress;
use crate::rigs::Workbench;
use kalmems_core::Scalar;
use std::convert::Infallible;
use toml::Value;

/// What is sought with.
pub(in crate::diagnose) struct LikelihoodSearch<'a> {
    pub(in crate::diagnose) workbench: &'a Workbench,
    pub(in crate::diagnose) bench: &'a TrialBench<'a>,
    /// The run of the experiment as it is.
    pub(in crate::diagnose) base: &'a DiagnosisTrial,
    pub(in crate::diagnose) prior: &'a FactorPrior,
    /// Asked before each run whether the work is to stop: runs that follow are none then.
    pub(in crate::diagnose) progress: &'a dyn Progress,
}

/// A number that is known no better than to this, relative to itself, is not determined by the recordings.
pub(super) const DETERMINED: f64 = 0.3;

/// Below this standard error, relative to a number, its likelihood is Gaussian as far as an interval goes.
const GAUSSIAN: f64 = 0.03;

/// The part by which √(2·fall) of ln p may differ from what a standard error says at the end of an interval, to be trusted.
const UNLIKE_GAUSSIAN: f64 = 0.25;

/// What a sign has to gain in ln p to be another than the stated one.
const OTHER_SIGN: f64 = 5.0;

/// What another start has to be likelier in ln p than what was found, and how often a search begins again from one.
const OTHER_MAXIMUM: f64 = 5.0;
const MOST_JUMPS: usize = 3;

/// ln p by which another maximum has to be less likely for a number to be the one that is found, and the standard errors from which on it is looked
/// for, with the factor from one distance to the next and how many there are.
const SECOND_MAXIMUM: f64 = 20.0;
const NEAREST: f64 = 3.0;
/// The standard errors within which two maxima are one: its parabola falls by 50 over so many, and what makes it rough, such as a sample that is
/// rejected or not, makes no other value.
const ONE_MAXIMUM: f64 = 10.0;
const FARTHER: f64 = 1.5;
const DISTANCES: i32 = 24;

/// The parts of a recording at its beginning from which a search grows to all of it.
const BEGINNINGS: [usize; 4] = [16, 8, 4, 2];

/// The standard deviation, relative to a number, with which a filter has it as a state to find where a search begins.
const AS_STATE: &str = "10 %";

/// Searches of a dozen iterations each, and a gain of ln p below which there is no further one.
const SEARCHES: usize = 8;
const NO_GAIN: f64 = 0.01;

/// How far from its likeliest value a logarithm may go in a profile.
const ROOM: f64 = 3.0;

impl LikelihoodSearch<'_> {
    pub(super) fn search<'b>(&'b self, suspects: &'b [Suspect]) -> CauseSearch<'b> {
        CauseSearch { bench: self.bench, suspects, base: self.base }
    }

    /// Whether the work is to stop, of which the runs hear.
    fn stops(&self) -> bool {
        self.progress.reached(0).is_break()
    }

    /// The run with these sizes.
    pub(in crate::diagnose) fn run(&self, suspects: &[Suspect], sizes: &[f64]) -> Option<DiagnosisTrial> {
        if self.stops() {
            return None;
        }
        self.search(suspects).run(&Cause::Numbers(sizes.iter().copied().enumerate().collect()))
    }

    /// ln p of the innovations of some blocks with these sizes, and of what is stated of the numbers.
    fn log_likelihood(&self, suspects: &[Suspect], sizes: &[f64], blocks: TrialBlocks) -> Option<f64> {
        if self.stops() {
            return None;
        }
        let cause = Cause::Numbers(sizes.iter().copied().enumerate().collect());
        let mut innovations = self.search(suspects).run_unjudged(&cause)?.part(blocks);
        self.prior.append(&mut innovations, sizes);
        Some(innovations.log_likelihood()).filter(|likelihood| likelihood.is_finite())
    }

    /// The sizes that make all innovations the likeliest, and the numbers with the signs under which they do: a number that the recordings
    /// do not determine with its stated sign is tried with the other, and so is each where the innovations show that something is wrong.
    pub(super) fn with_signs(&self, suspects: &[Suspect]) -> Option<(Vec<Suspect>, MostLikelySizes)> {
        let (mut suspects, mut best) = (suspects.to_vec(), self.most_likely(suspects)?);
        for place in 0..suspects.len() {
            let is_determined = best.sd.get(place).is_some_and(|sd| *sd < DETERMINED);
            if is_determined && self.run(&suspects, &best.at).is_some_and(|trial| trial.passes()) {
                continue;
            }
            let mut other = suspects.clone();
            if let Some(NumberRole::Factor(numbers)) = other.get_mut(place).map(|suspect| &mut suspect.what) {
                for number in numbers {
                    number.written = -number.written;
                }
            }
            // A number that has gone to nothing has no sign to be kept: beside a wrong one the others would be off.
            let least = if is_determined { OTHER_SIGN } else { 0.0 };
            if let Some(found) = self.most_likely(&other)
                && found.log_likelihood > best.log_likelihood + least
            {
                (suspects, best) = (other, found);
            }
        }
        Some((suspects, best))
    }

    /// The sizes that make all innovations the likeliest, from the better of two starts.
    fn most_likely(&self, suspects: &[Suspect]) -> Option<MostLikelySizes> {
        let zeros = vec![0.0; suspects.len()];
        let likelihood = |sizes: &[f64]| {
            self.log_likelihood(suspects, sizes, TrialBlocks::All).unwrap_or(f64::NEG_INFINITY)
        };
        let as_states = self.as_states(suspects).filter(|sizes| likelihood(sizes) > likelihood(&zeros));
        let mut best = self.most_likely_from(suspects, &as_states.unwrap_or(zeros))?;
        // Where a search ends beside the largest likelihood, the innovations show it.
        let passes =
            |found: &MostLikelySizes| self.run(suspects, &found.at).is_none_or(|trial| trial.passes());
        if !passes(&best)
            && let Some(grown) = self.grown(suspects)
            && grown.log_likelihood > best.log_likelihood
        {
            best = grown;
        }
        for _ in 0..MOST_JUMPS {
            if passes(&best) {
                break;
            }
            let Some(farther) = self.farther(suspects, &best, &likelihood) else { break };
            best = farther;
        }
        Some(best)
    }

    /// The likeliest sizes of the beginnings of the recordings, one after the other, each from those of the shorter one, and then of all of
    /// them.
    ///
    /// With a frequency that is wrong a filter falls out of step with the motion in the course of a recording, and its likelihood has a maximum
    /// wherever it falls into step again. Over a beginning it keeps in step, and what that determines keeps it in step over a longer one. What
    /// a beginning does not determine stays as it was. The free decays of a seismometer without its magnet are found by it alone
    /// (`free_decays_of_a_seismometer_give_what_least_squares_gives`).
    fn grown(&self, suspects: &[Suspect]) -> Option<MostLikelySizes> {
        let mut at = vec![0.0; suspects.len()];
        let rows = self.bench.longest();
        for part in BEGINNINGS {
            let bench = self.bench.shortened(TestedRows(rows / part));
            let Some(base) = bench.run_unjudged(&[]) else { continue };
            let short = LikelihoodSearch { bench: &bench, base: &base, ..*self };
            let mut free = vec![true; suspects.len()];
            let Some(mut found) = short.refit_blocks(suspects, &at, &free, TrialBlocks::All) else {
                continue;
            };
            let determined: Vec<bool> = found.sd.iter().map(|sd| *sd < DETERMINED).collect();
            if determined.contains(&false) {
                free = determined;
                let Some(again) = short.refit_blocks(suspects, &at, &free, TrialBlocks::All) else {
                    continue;
                };
                found = again;
            }
            at = found.at;
        }
        self.most_likely_from(suspects, &at)
    }

    /// The likeliest sizes from a start that differs from those that were found by one of a number's own sizes, where that start is likelier.
    fn farther(
        &self,
        suspects: &[Suspect],
        found: &MostLikelySizes,
        likelihood: &dyn Fn(&[f64]) -> f64,
    ) -> Option<MostLikelySizes> {
        let moved = |place: usize, by: f64| {
            let mut at = found.at.clone();
            at[place] += by;
            at
        };
        let starts = suspects.iter().enumerate().flat_map(|(place, suspect)| {
            suspect.sizes.iter().map(move |size| moved(place, *size)).collect::<Vec<_>>()
        });
        let tried = starts.map(|at| (likelihood(&at), at));
        let (height, start) = tried.max_by(|(a, _), (b, _)| a.total_cmp(b))?;
        if height < found.log_likelihood + OTHER_MAXIMUM {
            return None;
        }
        self.most_likely_from(suspects, &start).filter(|there| there.log_likelihood > found.log_likelihood)
    }

    /// Where a search ended beside a maximum along numbers that the recordings do not determine: these held where it ended, with no standard error, and
    /// the others at their maximum. Whether those depend on what is held is judged later.
    pub(super) fn with_undetermined_held(
        &self,
        suspects: &[Suspect],
        found: MostLikelySizes,
    ) -> MostLikelySizes {
        let free: Vec<bool> = found.sd.iter().map(|sd| *sd < DETERMINED).collect();
        if !found.is_no_maximum() || !free.contains(&true) || !free.contains(&false) {
            return found;
        }
        let held = self.refit_blocks(suspects, &found.at, &free, TrialBlocks::All);
        let Some(mut held) = held.filter(|held| !held.is_no_maximum()) else { return found };
        for (sd, _) in held.sd.iter_mut().zip(&free).filter(|(_, free)| !**free) {
            *sd = f64::INFINITY;
        }
        held
    }

    /// The same from these sizes.
    pub(in crate::diagnose) fn most_likely_from(
        &self,
        suspects: &[Suspect],
        start: &[f64],
    ) -> Option<MostLikelySizes> {
        let all = vec![true; suspects.len()];
        let mut best = self.refit_blocks(suspects, start, &all, TrialBlocks::All)?;
        for _ in 1..SEARCHES {
            let Some(next) = self.refit_blocks(suspects, &best.at, &all, TrialBlocks::All) else { break };
            let gained = next.log_likelihood - best.log_likelihood;
            best = next;
            if gained < NO_GAIN {
                break;
            }
        }
        Some(best)
    }

    /// The same of some blocks from given sizes, of which those that are not free stay as they are, with no error of their own.
    pub(in crate::diagnose) fn refit_blocks(
        &self,
        suspects: &[Suspect],
        start: &[f64],
        free: &[bool],
        blocks: TrialBlocks,
    ) -> Option<MostLikelySizes> {
        let search = self.search(suspects);
        let places: Vec<usize> = (0..suspects.len()).filter(|place| free[*place]).collect();
        let whole = |own: &[f64]| {
            let mut sizes = start.to_vec();
            places.iter().zip(own).for_each(|(place, size)| sizes[*place] = *size);
            sizes
        };
        let innovations = |sizes: &[f64]| {
            let cause = Cause::Numbers(sizes.iter().copied().enumerate().collect());
            let mut found = (!self.stops()).then(|| search.innovations(&cause, sizes, blocks))??;
            self.prior.append(&mut found, sizes);
            Some(found)
        };
        if places.is_empty() {
            let log_likelihood = innovations(start)?.log_likelihood();
            let none = vec![0.0; start.len()];
            let correlation = vec![none.clone(); start.len()];
            return Some(MostLikelySizes {
                at: start.to_vec(),
                sd: none,
                correlation,
                log_likelihood,
                promised: 0.0,
            });
        }
        let of_free: Vec<f64> = places.iter().map(|place| start[*place]).collect();
        let steps: Vec<f64> = places.iter().map(|place| search.step(*place)).collect();
        let (found, _) = most_likely_sizes(&of_free, &steps, &mut |own| innovations(&whole(own)))?;
        let mut sd = vec![0.0; start.len()];
        let mut correlation = vec![vec![0.0; start.len()]; start.len()];
        for (i, place) in places.iter().enumerate() {
            sd[*place] = found.sd[i];
            for (j, other) in places.iter().enumerate() {
                correlation[*place][*other] = found.correlation[i][j];
            }
        }
        let (log_likelihood, promised) = (found.log_likelihood, found.promised);
        Some(MostLikelySizes { at: whole(&found.at), sd, correlation, log_likelihood, promised })
    }

    /// The numbers at which the filter arrives that has them as states, as logarithms of factors; `None` where one of them cannot be a
    /// state.
    fn as_states(&self, suspects: &[Suspect]) -> Option<Vec<f64>> {
        let rig = self.workbench.rig(&self.bench.experiment).ok()?;
        let known = rig.parameters(&self.bench.experiment);
        let filter = Key::from("estimate").child("filter").index(0).child("states");
        let mut changes = Vec::new();
        let mut names = Vec::new();
        for suspect in suspects {
            let name = suspect.name();
            let parameter = known.iter().find(|parameter| parameter.written == [(name.as_str(), 1)])?;
            let key = filter.clone().child(parameter.name).child("start_sd");
            changes.push(TrialChange::Key(key, Value::String(AS_STATE.to_owned())));
            names.push(parameter.name);
        }
        let trial = self.bench.run_unjudged(&changes)?;
        let at_end = |name: &&str| trial.at_end.iter().find(|(own, _)| own == name).map(|(_, value)| *value);
        let factor = |deviation: f64| (deviation > -0.9).then(|| Scalar::ln(1.0 + deviation));
        names.iter().map(|name| at_end(name).and_then(factor)).collect()
    }

    /// How far each size may be from its likeliest value to either side, of 95 %: by its standard error where that is small, else by the
    /// profile of the likelihood. Infinite where nothing sets an end.
    pub(super) fn intervals(&self, suspects: &[Suspect], found: &MostLikelySizes) -> Vec<[f64; 2]> {
        (0..suspects.len()).map(|place| self.interval(suspects, found, place)).collect()
    }

    /// The same of one size.
    pub(in crate::diagnose) fn interval(
        &self,
        suspects: &[Suspect],
        found: &MostLikelySizes,
        place: usize,
    ) -> [f64; 2] {
        let sd = found.sd[place];
        if !sd.is_finite() {
            return [f64::INFINITY; 2];
        }
        if sd < GAUSSIAN {
            let falls =
                [-1.0, 1.0].map(|side: f64| self.fall_along(suspects, found, (place, side * TWO_SIDED * sd)));
            // What is likelier so far away was no maximum.
            if falls.iter().any(|fall| *fall < -OTHER_SIGN) {
                return [f64::INFINITY; 2];
            }
            let agrees =
                |fall: &f64| ((2.0 * fall).max(0.0).sqrt() / TWO_SIDED - 1.0).abs() < UNLIKE_GAUSSIAN;
            if falls.iter().all(agrees) {
                return [TWO_SIDED * sd; 2];
            }
        }
        [-1.0, 1.0].map(|side: f64| {
            let fallen = &mut |distance: f64| {
                Ok::<f64, Infallible>(self.fallen(suspects, found, (place, side * distance)))
            };
            // The end of the search is no end of the interval; rounding does not lead beyond it.
            let tried = (1.0 - 1e-9) * (suspects[place].furthest() - side * found.at[place]);
            let Ok(end) = likelihood_half_width(sd, ROOM.min(tried.max(0.0)), fallen);
            end
        })
    }

    /// The sizes with one so far from its likeliest value, and the others where their correlations with it put them.
    fn along(suspects: &[Suspect], found: &MostLikelySizes, (place, by): (usize, f64)) -> Vec<f64> {
        let along = |i: usize| {
            let slope = found.correlation[i][place] * found.sd[i] / found.sd[place];
            if i == place {
                by
            } else if slope.is_finite() && found.sd[i] < ROOM {
                // What is not determined stays where it is.
                by * slope
            } else {
                0.0
            }
        };
        (0..suspects.len()).map(|i| found.at[i] + along(i)).collect()
    }

    /// Another maximum along a number that is nearly as likely: where ln p, with the others moved as their correlations say, rises again with the distance,
    /// a search begins anew. A maximum that is narrower than the distances are apart is not seen.
    pub(super) fn second_maximum(
        &self,
        suspects: &[Suspect],
        found: &MostLikelySizes,
        place: usize,
    ) -> Option<MostLikelySizes> {
        let sd = found.sd[place];
        let sides = [-1.0, 1.0].into_iter().filter(|_| sd.is_finite());
        let other = |side: f64| {
            let mut before = f64::NEG_INFINITY;
            for step in 0..DISTANCES {
                let by = (NEAREST * sd * FARTHER.powi(step)).min(ROOM);
                let fall = self.fall_along(suspects, found, (place, side * by));
                if fall.is_finite() && fall < before {
                    let start = Self::along(suspects, found, (place, side * by));
                    let there = self.most_likely_from(suspects, &start);
                    let is_other = |there: &MostLikelySizes| {
                        !there.is_no_maximum()
                            && (there.at[place] - found.at[place]).abs() > ONE_MAXIMUM * sd
                            && there.log_likelihood > found.log_likelihood - SECOND_MAXIMUM
                    };
                    if let Some(there) = there.filter(is_other) {
                        return Some(there);
                    }
                }
                before = fall;
                if by >= ROOM {
                    break;
                }
            }
            None
        };
        sides.into_iter().find_map(other)
    }

    /// By how much ln p falls there: ½·(distance/sd)² where the standard error is that of the likelihood. Infinite where there is no filter.
    fn fall_along(&self, suspects: &[Suspect], found: &MostLikelySizes, moved: (usize, f64)) -> f64 {
        let there = self.log_likelihood(suspects, &Self::along(suspects, found, moved), TrialBlocks::All);
        there.map_or(f64::INFINITY, |there| found.log_likelihood - there)
    }

    /// √(2·fall) of ln p with a size so far from its likeliest value and all others as likely as they can be; infinite where there is no
    /// filter.
    pub(in crate::diagnose) fn fallen(
        &self,
        suspects: &[Suspect],
        found: &MostLikelySizes,
        (place, by): (usize, f64),
    ) -> f64 {
        let start = Self::along(suspects, found, (place, by));
        let free: Vec<bool> = (0..suspects.len()).map(|i| i != place).collect();
        let there = self.refit_blocks(suspects, &start, &free, TrialBlocks::All);
        there.map_or(f64::INFINITY, |there| {
            (2.0 * (found.log_likelihood - there.log_likelihood)).max(0.0).sqrt()
        })
    }
}
