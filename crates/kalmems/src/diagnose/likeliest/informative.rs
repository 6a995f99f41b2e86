//! The recording that would tell numbers which these do not.

use super::likelihood_search::{DETERMINED, LikelihoodSearch};
use crate::config::Experiment;
use crate::diagnose::distinguish::{SimulatedRecordings, variations};
use crate::diagnose::search::MostLikelySizes;
use crate::diagnose::suspect::Suspect;
use crate::progress::{Progress, map_on_threads, processors};
use toml::{Table, Value};

/// A recording that would tell more.
pub(super) struct Informative {
    /// How it differs from the one that there is.
    pub(super) what: String,
    /// The relative standard error that it would leave of each number.
    pub(super) sd: Vec<f64>,
    /// The recording as a table `[simulate]`, to be tried.
    pub(super) simulate: String,
}

/// A recording that improves less than this is not worth a name.
const BETTER: f64 = 0.7;

/// The recording by which the worst known of these numbers is known best, with all numbers sought in it together; `None` where none of those
/// that were tried tells more, or none can be simulated.
pub(super) fn informative(
    sought: &LikelihoodSearch,
    experiment: &Experiment,
    (suspects, found): (&[Suspect], &MostLikelySizes),
    untold: &[usize],
    progress: &dyn Progress,
) -> Option<Informative> {
    let there = SimulatedRecordings { workbench: sought.workbench, experiment, bench: sought.bench };
    let usual = there.usual(sought.base)?;
    let mut tried = vec![("as long as this one, made once more".to_owned(), usual.clone())];
    tried.extend(variations(&usual));
    let worst = |sd: &[f64]| untold.iter().map(|place| sd[*place]).fold(0.0, f64::max);
    let work = (progress, "simulating other recordings");
    let found_there = map_on_threads(work, processors(), (tried.len(), 1), |place, heard| {
        heard.reached(0).is_continue().then(|| {
            let (what, simulate) = tried.get(place)?;
            let sd = there.errors(simulate, suspects, &found.at)?;
            let table = Table::from_iter([("simulate".to_owned(), Value::Table(simulate.clone()))]);
            Some(Informative { what: what.clone(), sd, simulate: toml::to_string(&table).ok()? })
        })
    })?;
    let best = found_there.into_iter().flatten().min_by(|a, b| worst(&a.sd).total_cmp(&worst(&b.sd)))?;
    let now = worst(&found.sd);
    let is_better = worst(&best.sd) < BETTER * now && worst(&best.sd).is_finite();
    (is_better && (worst(&best.sd) < DETERMINED || !now.is_finite())).then_some(best)
}
