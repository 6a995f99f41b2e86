//! What is said of the likeliest numbers, and the experiment with them.

use super::informative::informative;
use super::judgement::{NumberJudgement, NumberVerdict};
use super::likelihood_search::{DETERMINED, LikelihoodSearch};
use crate::config::{Experiment, KeyStep};
use crate::diagnose::paste::changed;
use crate::diagnose::report::{Edit, digits, rounded};
use crate::diagnose::search::MostLikelySizes;
use crate::diagnose::suspect::{NumberRole, Suspect};
use crate::diagnose::trial::{DiagnosisTrial, TrialBlocks};
use crate::identify::{Correlated, Identification, Identified, IdentifyError, TWO_SIDED, Undetermined};
use crate::inspect::quantity;
use crate::progress::Progress;
use crate::rigs::Workbench;
use crate::units;
use kalmems_core::Scalar;
use toml::Value;

/// What is to stand in the file for a number with this relative standard error.
fn with_uncertainty(value: Value, sd: f64) -> Value {
    let text = match value {
        Value::String(text) => text,
        other => other.to_string(),
    };
    let of_value = units::Value::parse(&text).ok().filter(|value| value.parts().1 == "%");
    let per_cent = 100.0 * sd * of_value.map_or(1.0, |value| value.si().abs());
    Value::String(format!("{text} ± {} %", digits(per_cent, 2)))
}

/// What was found.
pub(super) struct LikelihoodOutcome<'a> {
    pub(super) sought: &'a LikelihoodSearch<'a>,
    pub(super) suspects: &'a [Suspect],
    /// How many of these are asked for; the others are sought because these trade with them.
    pub(super) asked: usize,
    pub(super) found: MostLikelySizes,
    /// How far each size may be from its likeliest value to either side.
    pub(super) ends: Vec<[f64; 2]>,
    pub(super) judgement: NumberJudgement,
}

impl LikelihoodOutcome<'_> {
    /// Whether the innovations contradict a number that is determined.
    fn is_contradicted(&self, place: usize) -> bool {
        self.judgement.verdicts[place] == NumberVerdict::Contradicted
    }

    /// The standard error of which the interval is one of 95 %.
    fn spread(&self, place: usize) -> f64 {
        let [below, above] = self.ends(place);
        0.5 * (below + above) / TWO_SIDED
    }

    /// How far a size may be from its likeliest value to either side: nobody knows where the innovations contradict it.
    fn ends(&self, place: usize) -> [f64; 2] {
        let is_nothing = matches!(
            self.judgement.verdicts[place],
            NumberVerdict::Contradicted | NumberVerdict::NoMaximum | NumberVerdict::SecondMaximum
        );
        if is_nothing { [f64::INFINITY; 2] } else { self.ends[place] }
    }

    fn name(&self, place: usize) -> String {
        self.suspects[place].name()
    }

    /// Why a number keeps what the experiment says; none of one that is written.
    fn why_not(&self, place: usize) -> Option<String> {
        Some(match self.judgement.verdicts[place] {
            NumberVerdict::Written => return None,
            NumberVerdict::NoMaximum => {
                "the search ended where the likelihood still rises, at the end of what is tried or of what the filter can be run with, so that \
                 neither the value nor a standard error means anything"
                    .to_owned()
            }
            NumberVerdict::SecondMaximum => {
                "another value of it is nearly as likely (ln p less than 20 below): state it so closely that only one of both is left, or record another \
                 motion"
                    .to_owned()
            }
            NumberVerdict::Untold if self.spread(place).is_finite() => format!(
                "the recordings determine it to {} % only, and no number is written that is known to less than {} %",
                digits(100.0 * self.spread(place), 2),
                digits(100.0 * DETERMINED, 2)
            ),
            NumberVerdict::Untold => "the recordings do not determine it: its likelihood has no maximum on one side".to_owned(),
            NumberVerdict::HangsOn(other) => format!(
                "its value depends on `{}`, which the recordings do not determine: with another value of that number it would be \
                 another",
                self.name(other)
            ),
            NumberVerdict::Agrees => format!(
                "the recordings agree with the value of the experiment, and determine it to {} % only: the estimate would not become better",
                digits(100.0 * self.spread(place), 2)
            ),
            NumberVerdict::NotConfirmed => {
                "with the value that one half of the recordings determines, the other half is less likely than before: the equations of the device \
                 lack something, and `kalmems diagnose` looks for what"
                    .to_owned()
            }
            NumberVerdict::LosesMotion => {
                "with it the filter loses the motion for longer than with the value of the experiment: another number is wrong, and `kalmems \
                 diagnose` looks for which"
                    .to_owned()
            }
            NumberVerdict::Contradicted => {
                "the innovations contradict what was found, so that neither the value nor a standard error can be relied on (see the warning); of a device whose equations are known to lack something `despite_innovations = true` in `[identify]` \
                 writes the values without an uncertainty"
                    .to_owned()
            }
        })
    }

    pub(super) fn told(
        &self,
        workbench: &Workbench,
        experiment: &Experiment,
        progress: &dyn Progress,
    ) -> Result<Identification, IdentifyError> {
        let materials = self.sought.bench.materials();
        let place = match materials.as_slice() {
            [one] => one.name.clone(),
            all => format!("{} recordings", all.len()),
        };
        let mut found = Identification {
            worst_pairs: self.worst_pair(&place).into_iter().collect(),
            materials,
            ..Identification::begun(workbench.rig(experiment)?.name(), experiment)
        };
        let despite = experiment.identify.as_ref().is_some_and(|identify| identify.despite_innovations);
        let (mut text, mut written) = (experiment.text().to_owned(), Vec::new());
        for (index, suspect) in self.suspects.iter().enumerate() {
            if index >= self.asked {
                continue;
            }
            let NumberRole::Factor(numbers) = &suspect.what else { continue };
            let (Some(number), Some(size)) = (numbers.first(), self.found.at.get(index)) else { continue };
            let (sd, [below, above]) = (self.spread(index), self.ends(index));
            let unit = units::Unit::parse(if number.unit.is_empty() { "1" } else { &number.unit });
            let unit = unit.unwrap_or(units::Unit::ONE);
            let stated = number.written * unit.factor();
            let value = stated * Scalar::exp(*size);
            let mut interval = [-below, above].map(|by| value * Scalar::exp(by));
            // The end of a search is no value; what the innovations contradict is one that cannot be relied on.
            let is_found = sd.is_finite() || self.is_contradicted(index);
            let value = if is_found { value } else { f64::NAN };
            interval.sort_by(f64::total_cmp);
            found.parameters.push(Identified {
                name: suspect.name(),
                stated: Some(stated),
                value,
                standard_error: (value * sd).abs(),
                interval,
                unit: units::name(&units::si_text(&number.unit)),
                recording: place.clone(),
            });
            let is_accepted = despite && self.is_contradicted(index);
            if let Some(why) = self.why_not(index).filter(|_| !is_accepted) {
                let why = format!("{why}; the experiment keeps what it says");
                found.undetermined.push(Undetermined { what: suspect.name(), why });
                continue;
            }
            // A value without an uncertainty has the digits that the likelihood alone gives it.
            let known = [sd, self.found.sd[index]].into_iter().find(|sd| sd.is_finite());
            let value = rounded(&number.times(Scalar::exp(*size)), known);
            let of_process = |step: &KeyStep| matches!(step, KeyStep::Name(name) if name == "process_noise");
            let is_noise =
                suspect.is_noise_in(&self.sought.bench.document) || number.key.steps().iter().any(of_process);
            let is_exact = is_noise || is_accepted;
            let to = if is_exact { value } else { with_uncertainty(value, sd) }.to_string();
            if !is_exact {
                written.push(index);
            }
            let edit = Edit { key: number.key.to_string(), to, ..Edit::default() };
            text = changed(&text, &edit).unwrap_or(text);
        }
        self.say(&mut found, &place);
        self.propose(&mut found, experiment, progress);
        found.experiment = workbench.parse(&text, experiment.path())?;
        let names: Vec<String> = written.iter().map(|index| self.suspects[*index].name()).collect();
        let between = |i: usize, j: usize| {
            let own = f64::from(u8::from(i == j));
            self.found.correlation.get(i).and_then(|row| row.get(j)).copied().unwrap_or(own)
        };
        let correlation: Vec<Vec<f64>> =
            written.iter().map(|i| written.iter().map(|j| between(*i, *j)).collect()).collect();
        found.experiment.set_correlations(&names, &correlation);
        Ok(found)
    }

    fn worst_pair(&self, place: &str) -> Option<Correlated> {
        let pairs = (0..self.suspects.len()).flat_map(|j| (0..j).map(move |i| (i, j)));
        let of = |(i, j): (usize, usize)| self.found.correlation.get(i).and_then(|row| row.get(j)).copied();
        let worst =
            pairs.filter_map(|pair| Some((pair, of(pair)?))).max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()));
        worst.filter(|(_, correlation)| *correlation != 0.0).map(|((i, j), correlation)| Correlated {
            names: [self.suspects[i].name(), self.suspects[j].name()],
            correlation,
            recording: place.to_owned(),
        })
    }

    fn say(&self, found: &mut Identification, place: &str) {
        let (rows, long_s) = self.sought.bench.extent();
        let others: Vec<String> =
            (self.asked..self.suspects.len()).map(|index| format!("`{}`", self.name(index))).collect();
        if !others.is_empty() {
            found.notes.push(format!(
                "{place}: {} of an input that nobody recorded were sought together with the others, which trade with them; they keep what the experiment says",
                others.join(" and ")
            ));
        }
        let gained = self.found.log_likelihood - self.sought.base.log_likelihood(TrialBlocks::All);
        found.notes.push(format!(
            "{place}: the log-likelihood of the innovations of `{}` rose by {} over {rows} rows, {}",
            self.sought.bench.filter_name,
            quantity(digits(gained, 3), ""),
            quantity(long_s, "s")
        ));
        for (place, suspect) in self.suspects.iter().enumerate() {
            if let Some(sd) = self.sought.prior.deviation(place) {
                found.notes.push(format!(
                    "`{}`: the experiment states it to {} %, which enters as its prior distribution",
                    suspect.name(),
                    digits(100.0 * sd, 2)
                ));
            }
        }
        if let (Some(moves), Some(remains)) = (&self.judgement.moves, self.judgement.remains) {
            let base = self.sought.base;
            let shown = |value: f64| quantity(digits(value, 2), base.answer_unit);
            found.notes.push(format!(
                "{place}: with the identified numbers the estimate of `{}` changes by {} rms; their standard errors change it by {}, and the \
                 filter claims a standard deviation of {}",
                base.answer_name,
                shown(moves.rms),
                shown(remains),
                shown(moves.claimed)
            ));
        }
        let is_right = self.judgement.trial.as_ref().is_some_and(DiagnosisTrial::passes);
        if !is_right {
            found.warnings.push(format!("{place}: {}", self.contradiction()));
        }
    }

    /// What the run with all that was found shows to be wrong.
    fn contradiction(&self) -> String {
        let failing: Vec<String> = (self.judgement.trial.iter().flat_map(DiagnosisTrial::failing))
            .map(crate::evaluate::TestResult::in_short)
            .collect();
        if failing.is_empty() {
            return "with these numbers the filter does not hold the motion; nothing here can be trusted"
                .to_owned();
        }
        format!(
            "with these numbers the innovations still show what a filter that is right does not ({}): the device has more to it, another number is \
             wrong, or the search ended beside the right values; `kalmems diagnose` looks for what is wrong",
            failing.join(", ")
        )
    }

    /// Adds the recording that would tell what these do not.
    fn propose(&self, found: &mut Identification, experiment: &Experiment, progress: &dyn Progress) {
        let verdicts = self.judgement.verdicts.iter().enumerate();
        let untold =
            verdicts.filter(|(_, verdict)| matches!(verdict, NumberVerdict::Untold | NumberVerdict::Agrees));
        let untold: Vec<usize> = untold.map(|(place, _)| place).collect();
        if untold.is_empty() {
            return;
        }
        let numbers = (self.suspects, &self.found);
        if let Some(there) = informative(self.sought, experiment, numbers, &untold, progress) {
            let each = untold
                .iter()
                .map(|place| format!("`{}` to {} %", self.name(*place), digits(100.0 * there.sd[*place], 2)));
            found.notes.push(format!(
                "another recording would determine {} ({}); as a table, to be tried with `kalmems simulate`:\n\n{}",
                each.collect::<Vec<_>>().join(", "),
                there.what,
                there.simulate.trim_end()
            ));
        }
    }
}
