//! What the innovations of one filter say of noises.

use super::FoundNoise;
use super::meaning::meaning;
use super::powers_of_ten::from_powers_of_ten;
use super::unknown::UnknownNoise;
use crate::config::{ConfigFault, Experiment, put};
use crate::diagnose::DiagnoseError;
use crate::diagnose::bench::TrialBench;
use crate::diagnose::likeliest::{FactorPrior, LikelihoodSearch};
use crate::diagnose::search::MostLikelySizes;
use crate::diagnose::suspect::Suspect;
use crate::diagnose::trial::{DiagnosisTrial, TrialBlocks};
use crate::identify::TWO_SIDED;
use crate::progress::Progress;
use crate::rigs::Workbench;
use kalmems_core::Scalar;
use std::f64::consts::LN_10;
use toml::Value;

/// Powers of ten by which the first guesses of readouts are changed where the filter cannot be run with them.
const OTHER_GUESSES: [f64; 7] = [1.0, 10.0, 0.1, 100.0, 0.01, 1e3, 1e4];

/// A noise of a readout that is known no better than to this, relative to itself, is not determined by the recording.
const DETERMINED: f64 = 0.3;

/// A density that is known no better than to this, in its logarithm, is held while the others are sought; how often, and the ln p below
/// which nothing is gained.
const UNSHOWN: f64 = 1.5;
const ROUNDS: usize = 4;
const NO_GAIN: f64 = 0.01;

/// Powers of ten above the likeliest in which the upper limit of a density is sought, and how near to it the search comes.
const MOST_POWERS: usize = 6;
const NEAR: f64 = 0.05;

/// What the innovations of one filter say of the noises.
pub(super) struct FilterNoiseEvidence {
    pub(super) filter: String,
    /// How many innovations there are.
    pub(super) innovations: usize,
    /// What was sought.
    pub(super) sought: Vec<UnknownNoise>,
    /// By the differences of neighbouring samples, and where the search began.
    base_guesses: Vec<f64>,
    guesses: Vec<f64>,
    pub(super) likeliest: MostLikelySizes,
    /// Σ ln p of all samples there, as densities: filters of any law and gate are compared by it.
    pub(super) density: f64,
    /// The logarithms of factors at which the interval of each ends; no lower end of a density that the recording does not show.
    ends: Vec<[f64; 2]>,
    rows: usize,
    base: DiagnosisTrial,
    interval_s: f64,
}

impl FilterNoiseEvidence {
    pub(super) fn of(
        workbench: &Workbench,
        mut bench: TrialBench,
        sought: Vec<UnknownNoise>,
        progress: &dyn Progress,
    ) -> Result<Self, DiagnoseError> {
        let stop = bench.stop.clone();
        let progress = stop.watching(progress);
        let of_readout = |one: &UnknownNoise| {
            if one.walk().is_some() { Ok(f64::NAN) } else { one.guess(workbench, &bench) }
        };
        let base_guesses: Vec<f64> = sought.iter().map(of_readout).collect::<Result<_, _>>()?;
        let stops = |bench: &TrialBench| DiagnoseError::Stops { filter: bench.filter_name.clone() };
        let begun = run(&mut bench, &sought, &base_guesses);
        let interrupted = || progress.reached(0).is_break();
        if interrupted() {
            return Err(DiagnoseError::Interrupted);
        }
        let (guesses, base) = begun.ok_or_else(|| stops(&bench))?;
        let suspects: Vec<Suspect> =
            sought.iter().zip(&guesses).map(|(one, guess)| one.suspect(*guess)).collect();
        let prior = FactorPrior::of(&bench.experiment, &suspects)?;
        let search =
            LikelihoodSearch { workbench, bench: &bench, base: &base, prior: &prior, progress: &progress };
        let likeliest = most_likely(&search, &suspects);
        let ends = likeliest.as_ref().map(|found| {
            let of = |place: usize| match sought[place].walk() {
                Some(_) => ends_of_walk(&search, &suspects, found, place),
                None => [-1.0, 1.0].map(|side| found.at[place] + side * TWO_SIDED * found.sd[place]),
            };
            (0..sought.len()).map(of).collect()
        });
        if interrupted() {
            return Err(DiagnoseError::Interrupted);
        }
        let (Some(likeliest), Some(ends)) = (likeliest, ends) else { return Err(stops(&bench)) };
        let density = search.run(&suspects, &likeliest.at).map_or(f64::NEG_INFINITY, |trial| trial.density());
        let (rows, long_s) = bench.extent();
        Ok(Self {
            innovations: base.innovations.value.len(),
            sought,
            base_guesses,
            guesses,
            likeliest,
            density,
            ends,
            rows,
            base,
            interval_s: long_s / rows.max(1) as f64,
            filter: bench.filter_name,
        })
    }

    /// What is to stand in the file for a noise, and what there is to say of it.
    ///
    /// Of a density that the recording does not show this is the upper end of its interval: the claims of a filter that has it are not
    /// too small for any density that the recording allows.
    ///
    /// # Errors
    /// A noise that the recording does not determine.
    pub(super) fn noise(&self, raw: &Experiment, place: usize) -> Result<(Value, FoundNoise), DiagnoseError> {
        let (one, ends) = (&self.sought[place], self.ends[place]);
        let (at, sd) = (self.likeliest.at[place], self.likeliest.sd[place]);
        let undetermined = match one.walk() {
            Some(_) => !ends[1].is_finite(),
            None => sd.is_nan() || sd >= DETERMINED,
        };
        if undetermined {
            let why = "the recording does not determine it: the innovations are as likely with another; state it, or find it from a \
                       recording without motion";
            return Err(raw.error(one.key.clone(), ConfigFault::Value { why: why.to_owned() }).into());
        }
        let is_shown = one.walk().is_none() || ends[0].is_finite();
        let (at, sd) = if is_shown { (at, sd) } else { (ends[1], 1.0) };
        let number = self.guesses[place] * Scalar::exp(at);
        let value = one.rounded(number, sd);
        let found = FoundNoise {
            key: one.key.to_string(),
            written: value.as_str().map_or_else(|| value.to_string(), str::to_owned),
            interval: ends.map(|end| Scalar::exp(end - at)),
            of_neighbours: one.walk().is_none().then(|| number / self.base_guesses[place]),
            filter: self.filter.clone(),
            rows: self.rows,
            meaning: one.walk().map(|walk| meaning(walk, number, self.interval_s, &self.base)),
        };
        Ok((value, found))
    }
}

/// The likeliest sizes. A density that the innovations do not determine makes Fisher's steps useless for the others; these are then
/// sought with it held at the power of ten where it began, and all of them from there again.
fn most_likely(search: &LikelihoodSearch, suspects: &[Suspect]) -> Option<MostLikelySizes> {
    let mut best = search.most_likely_from(suspects, &vec![0.0; suspects.len()])?;
    for _ in 0..ROUNDS {
        let free: Vec<bool> = best.sd.iter().map(|sd| *sd < UNSHOWN).collect();
        if free.iter().all(|free| *free) {
            break;
        }
        let start: Vec<f64> =
            best.at.iter().zip(&free).map(|(at, free)| if *free { *at } else { 0.0 }).collect();
        let Some(held) = search.refit_blocks(suspects, &start, &free, TrialBlocks::All) else { break };
        let again = search.most_likely_from(suspects, &held.at);
        let gained = |found: &MostLikelySizes| found.log_likelihood > best.log_likelihood + NO_GAIN;
        match again.filter(gained) {
            Some(found) => best = found,
            None => break,
        }
    }
    Some(best)
}

/// Where the interval of a density ends, as logarithms of factors: by the profile of the likelihood. Where no lower end is known to a
/// factor of twenty, there is none.
fn ends_of_walk(
    search: &LikelihoodSearch,
    suspects: &[Suspect],
    found: &MostLikelySizes,
    place: usize,
) -> [f64; 2] {
    let at = found.at[place];
    let [below, above] = search.interval(suspects, found, place);
    if below.is_finite() && above.is_finite() {
        return [at - below, at + above];
    }
    // The likeliest may be any number that is small enough; the search began within a power of ten of what is as likely.
    let fallen = |size: f64| search.fallen(suspects, found, (place, size - at));
    let mut outside = at.max(0.0);
    let mut inside = at;
    for _ in 0..MOST_POWERS {
        if fallen(outside) > TWO_SIDED {
            break;
        }
        inside = outside;
        outside += LN_10;
    }
    if fallen(outside) <= TWO_SIDED {
        return [f64::NEG_INFINITY, f64::INFINITY];
    }
    while outside - inside > NEAR {
        let middle = 0.5 * (inside + outside);
        if fallen(middle) > TWO_SIDED {
            outside = middle;
        } else {
            inside = middle;
        }
    }
    [if below.is_finite() { at - below } else { f64::NEG_INFINITY }, outside]
}

/// Puts guesses into the bench, larger or smaller ones of readouts where the filter cannot be run with them, and runs it.
fn run(
    bench: &mut TrialBench,
    sought: &[UnknownNoise],
    guesses: &[f64],
) -> Option<(Vec<f64>, DiagnosisTrial)> {
    for factor in OTHER_GUESSES {
        let guesses: Vec<f64> = guesses.iter().map(|guess| guess * factor).collect();
        let Some(guesses) = from_powers_of_ten(bench, sought, guesses) else { continue };
        for (one, guess) in sought.iter().zip(&guesses) {
            put(&mut bench.document, &one.key_in_bench(), one.written(*guess)).ok()?;
        }
        if let Some(trial) = bench.run_unjudged(&[]) {
            return Some((guesses, trial));
        }
    }
    None
}
