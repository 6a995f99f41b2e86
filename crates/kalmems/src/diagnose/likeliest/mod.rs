//! The numbers of a device's table under which the recordings are the likeliest.

mod confirm;
mod informative;
mod judgement;
mod likelihood_search;
mod outcome;
mod prior;
mod traded;

use super::bench::{TestedRows, TrialBench};
use super::document::{document, keep_recordings, text};
use super::search::MOST_SIZES;
use super::suspect::{NumberRole, Suspect, WrittenNumber};
use super::{DiagnoseError, begin};
use crate::config::get;
use crate::config::{ConfigError, ConfigFault, Experiment, Key, RecordingRole};
use crate::identify::{Identification, IdentifyError};
use crate::progress::Progress;
use crate::rigs::Workbench;
use confirm::confirmed;
use judgement::NumberJudgement;
pub(super) use likelihood_search::LikelihoodSearch;
use outcome::LikelihoodOutcome;
pub(super) use prior::FactorPrior;
use toml::Value;

/// Rows after the settling times that are looked at, in all.
const ROWS: TestedRows = TestedRows(200_000);

/// The logarithm of a factor by which a number may be off, a third of how far a search may go.
const FARTHEST: f64 = 3.0;

/// Identifies the numbers that the experiment's `identify.parameters` names, of whatever device, and densities of `[estimate.process_noise]`
/// (`process_noise.frequency`), by the innovations of the first of its
/// filters whose innovations are white when it is right: all recordings of the role `training`, or, where there is none, all that move
/// the device, together.
///
/// Each number is sought by the logarithm of its factor θ: ln p of the innovations is maximised by Fisher's scoring
/// ([`fit::most_likely`](crate::fit::most_likely)), from the stated numbers or from those at which a filter arrives that has them as
/// states, whichever are likelier. A number that the file states with an uncertainty (`± 1 %`) has that as its prior distribution. Standard
/// errors and correlations are those of the information at the maximum; the interval of 95 % of a number that is known to less than 3 % is
/// e^{±1.96 sd} of it, that of another by the profile of the likelihood. A number that is not determined with its stated sign is tried with
/// the other one.
///
/// Together with them the size and the bandwidth of an input are sought that is modelled as a state which noise drives: what trades with them is not
/// determined. They are not put into the experiment.
///
/// Numbers whose errors hang together are put into the experiment all or not at all, and only where that can do no harm: the
/// estimate with them must not be worse on samples that did not determine them. Of what is not determined a recording is sought that would
/// determine it.
///
/// # Errors
///
/// A key that is no number of the device's table, a filter that cannot be run on the recordings, and recordings that cannot be read.
pub fn likeliest(
    workbench: &Workbench,
    experiment: &Experiment,
    progress: &dyn Progress,
) -> Result<Identification, IdentifyError> {
    let (prepared, filter) = prepared(workbench, experiment)?;
    let bench = TrialBench::of(workbench, &prepared, Some(&filter)).map_err(refused)?;
    let bench = bench.with_files(ROWS, progress).map_err(refused)?;
    let (base, _) = begin(&bench).map_err(refused)?;
    let bench = bench.behind_the_start(&base);
    let progress = &bench.stop.watching(progress);
    let (base, all) = begin(&bench).map_err(refused)?;
    let mut suspects = chosen(experiment, &bench, &all)?;
    let asked = suspects.len();
    let others = traded::traded(workbench, experiment, &all, &suspects);
    suspects.extend(others.into_iter().take(MOST_SIZES.saturating_sub(asked)));
    progress.begin("searching the likeliest numbers", 0);
    let prior = FactorPrior::of(experiment, &suspects)?;
    let sought = LikelihoodSearch { workbench, bench: &bench, base: &base, prior: &prior, progress };
    let nowhere = || IdentifyError::Unfit { recording: bench.filter_name.clone(), why: NOWHERE.to_owned() };
    let stopped = || progress.reached(0).is_break().then_some(IdentifyError::Interrupted);
    let found = sought.with_signs(&suspects);
    if let Some(stopped) = stopped() {
        return Err(stopped);
    }
    let (suspects, found) = found.ok_or_else(nowhere)?;
    let found = sought.with_undetermined_held(&suspects, found);
    progress.begin("profiles of the likelihood", 0);
    let ends = sought.intervals(&suspects, &found);
    let judgement = NumberJudgement::of(&sought, &suspects, &found, &ends);
    let judgement = match stopped() {
        Some(stopped) => return Err(stopped),
        None => judgement.ok_or_else(nowhere)?,
    };
    let outcome = LikelihoodOutcome { sought: &sought, suspects: &suspects, asked, found, ends, judgement };
    outcome.told(workbench, experiment, progress)
}

/// Identifies what an experiment asks for: the numbers that `identify.parameters` names ([`likeliest`]), or else what its device's rig
/// identifies. Where the estimate would become worse with what was found, the numbers of the experiment stay, and the identification says so.
pub fn identify(
    workbench: &Workbench,
    experiment: &Experiment,
    progress: &dyn Progress,
) -> Result<Identification, IdentifyError> {
    let names_numbers = experiment.identify.as_ref().is_some_and(|identify| !identify.parameters.is_empty());
    if names_numbers {
        likeliest(workbench, experiment, progress)
    } else {
        let found = workbench.rig(experiment)?.identify(experiment, progress)?;
        confirmed(workbench, experiment, found, progress)
    }
}

const NOWHERE: &str = "the filter cannot be run beside the numbers of the experiment, so that no likelihood rises from there; `kalmems \
                       diagnose` looks further";

fn refused(error: DiagnoseError) -> IdentifyError {
    match error {
        DiagnoseError::Config(error) => error.into(),
        DiagnoseError::Read(error) => error.into(),
        DiagnoseError::Interrupted => IdentifyError::Interrupted,
        DiagnoseError::Stops { ref filter } | DiagnoseError::NoNoise { ref filter } => {
            IdentifyError::Unfit { recording: filter.clone(), why: error.to_string() }
        }
    }
}

/// Roles of recordings in which a device moves as its equations say.
const MOVES: [RecordingRole; 4] =
    [RecordingRole::Test, RecordingRole::SteadyState, RecordingRole::RingDown, RecordingRole::Sweep];

/// The experiment with the recordings that count as such to be estimated, and its first filter that is judged, none of whose states is
/// a parameter; and the name of that filter.
fn prepared(workbench: &Workbench, experiment: &Experiment) -> Result<(Experiment, String), IdentifyError> {
    let mut document = document(experiment)?;
    let trains = experiment.recordings.iter().any(|recording| recording.role == RecordingRole::Training);
    let counts =
        |role: RecordingRole| if trains { role == RecordingRole::Training } else { MOVES.contains(&role) };
    let is_described = document.contains_key("recording");
    if keep_recordings(&mut document, experiment, counts) == 0 && is_described {
        let why = "no recording has the role `training`, `test`, `steady_state`, `ring_down` or `sweep`; parameters are identified \
                   from those";
        return Err(experiment.error("recording", ConfigFault::Value { why: why.to_owned() }).into());
    }
    if let Some(Value::Array(recordings)) = document.get_mut("recording") {
        for recording in recordings.iter_mut().filter_map(Value::as_table_mut) {
            recording.insert("role".to_owned(), Value::String(RecordingRole::Test.key().to_owned()));
        }
    }
    let mut chosen = String::new();
    if let Some(Value::Array(filters)) = document.get_mut("estimate").and_then(|e| e.get_mut("filter")) {
        let judged = experiment.estimate.iter().flat_map(|estimate| &estimate.filters);
        let place = judged.clone().position(|filter| super::bench::is_judged(filter.method));
        if let Some(filter) = place.and_then(|place| filters.get_mut(place)).and_then(Value::as_table_mut) {
            filter.remove("states");
            filter.get("name").and_then(Value::as_str).unwrap_or_default().clone_into(&mut chosen);
        }
    }
    if chosen.is_empty() {
        let why =
            "no filter has innovations that are white when it is right; add one with `method = \"ekf\"`";
        return Err(experiment.error("estimate.filter", ConfigFault::Value { why: why.to_owned() }).into());
    }
    Ok((workbench.parse(&text(&document, experiment)?, experiment.path())?, chosen))
}

/// The numbers that the experiment names, among all that may be wrong.
fn chosen(experiment: &Experiment, bench: &TrialBench, all: &[Suspect]) -> Result<Vec<Suspect>, ConfigError> {
    let named = experiment.identify.iter().flat_map(|identify| &identify.parameters);
    let named: Vec<&String> = named.collect();
    let at = || Key::from("identify").child("parameters");
    if named.len() > MOST_SIZES {
        let why = format!("these are {} numbers; at most {MOST_SIZES} are identified together", named.len());
        return Err(experiment.error(at(), ConfigFault::Value { why }));
    }
    let device = Key::from("device").child(experiment.device_name());
    let single =
        |suspect: &&Suspect| matches!(&suspect.what, NumberRole::Factor(numbers) if numbers.len() == 1);
    let key_of = |suspect: &Suspect| match &suspect.what {
        NumberRole::Factor(numbers) => numbers.first().map(|number| number.key.clone()),
        _ => None,
    };
    let mut suspects: Vec<Suspect> = Vec::new();
    for name in named {
        if let Some(density) = name.strip_prefix(PROCESS_NOISE) {
            let found = process_noise(density, bench)
                .map_err(|why| experiment.error(at(), ConfigFault::Value { why }))?;
            suspects.push(found);
            continue;
        }
        let below = |name: &str| name.split('.').fold(device.clone(), Key::child);
        let keys = [below(name), below(&format!("parameters.{name}"))];
        // By the name that is printed as well: a number of a list has its place there, `coefficients[0]`.
        let is_named = |suspect: &&Suspect| {
            suspect.name() == *name || key_of(suspect).is_some_and(|own| keys.contains(&own))
        };
        let found = all.iter().filter(single).find(is_named);
        let Some(found) = found else {
            if keys.iter().any(|key| get(&bench.document, key).is_some()) {
                let why = format!(
                    "`{name}` is 0 or no number with a unit; expected a number of the device's table that is not 0: its logarithm is sought"
                );
                return Err(experiment.error(at(), ConfigFault::Value { why }));
            }
            let known: Vec<String> = all.iter().filter(single).map(Suspect::name).collect();
            return Err(
                experiment.error(at(), ConfigFault::unknown_word(name, known.iter().map(String::as_str)))
            );
        };
        if suspects.iter().any(|other| key_of(other) == key_of(found)) {
            let why = format!("`{name}` is named twice; a number is sought once");
            return Err(experiment.error(at(), ConfigFault::Value { why }));
        }
        // Here a number may be wrong by more than is tried in a diagnosis: a noise is often known by its power of ten alone.
        let sizes = found.sizes.iter().copied().chain([FARTHEST, -FARTHEST]).collect();
        suspects.push(Suspect { sizes, ..found.clone() });
    }
    Ok(suspects)
}

/// What the name of a process-noise density begins with.
const PROCESS_NOISE: &str = "process_noise.";

/// A density of the table `estimate.process_noise`, which all filters share.
fn process_noise(density: &str, bench: &TrialBench) -> Result<Suspect, String> {
    let shared = Key::from("estimate").child("process_noise");
    let own = Key::from("estimate").child("filter").index(0).child("process_noise").child(density);
    if get(&bench.document, &own).is_some() {
        return Err(format!(
            "the filter `{}` has a `{density}` of its own; state it in `[estimate.process_noise]` alone",
            bench.filter_name
        ));
    }
    let key = shared.child(density);
    let number = get(&bench.document, &key).and_then(|value| WrittenNumber::of(&key, value));
    let number = number.ok_or_else(|| {
        format!("`{PROCESS_NOISE}{density}` is no density above 0 of the table `[estimate.process_noise]`; expected one that is stated there")
    })?;
    let sizes = [0.7, -0.7, FARTHEST, -FARTHEST].to_vec();
    Ok(Suspect { what: NumberRole::Factor(vec![number]), sizes })
}
