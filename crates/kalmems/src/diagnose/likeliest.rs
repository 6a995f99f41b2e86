//! The numbers of a device's table under which the recordings are the likeliest.

use super::bench::{Bench, Extent};
use super::cause::Cause;
use super::change::Change;
use super::paste::changed;
use super::report::{Edit, digits, rounded};
use super::search::{MOST_SIZES, MostLikelySizes, Search};
use super::suspect::{Suspect, What};
use super::trial::{Blocks, Trial};
use super::{DiagnoseError, TWO_SIDED, begin};
use crate::config::get;
use crate::config::{ConfigError, Experiment, Fault, Key, Role, Step};
use crate::identify::{Correlated, Identification, Identified, IdentifyError, Undetermined};
use crate::progress::Progress;
use crate::rigs::Workbench;
use crate::units;
use kalmems_core::Scalar;
use toml::{Table, Value};

/// Rows after the settling times that are looked at, in all.
const ROWS: Extent = Extent(200_000);

/// A number that is known no better than to this, relative to itself, is not determined by the recordings.
const DETERMINED: f64 = 0.3;

/// A correlation from which on what is found of one number hangs on the other.
const CONNECTED: f64 = 0.9;

/// The standard deviation, relative to a number, with which a filter has it as a state to find where a search begins.
const AS_STATE: &str = "10 %";

/// The logarithm of a factor by which a number may be off, a third of how far a search may go.
const FARTHEST: f64 = 3.0;

/// Searches of a dozen iterations each, and a gain of ln p below which there is no further one.
const SEARCHES: usize = 8;
const NO_GAIN: f64 = 0.01;

/// Identifies the numbers that the experiment's `identify.parameters` names, of whatever device, by the innovations of the first of its
/// filters whose innovations are white when it is right: all recordings of the role `training`, or, where there is none, all that move
/// the device, together.
///
/// Each number is sought by the logarithm of its factor θ: ln p of the innovations is maximised by Fisher's scoring
/// ([`fit::most_likely`](crate::fit::most_likely)), from the stated numbers or from those at which a filter arrives that has them as
/// states, whichever are likelier. Standard errors and correlations are those of the information at the maximum; 95 % intervals are
/// e^{±1.96 sd} of a number. What is not determined to 30 % is not put into the experiment, and neither is what hangs on it (correlation
/// above 0.9). A number that is not determined with its stated sign is tried with the other one.
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
    let bench = Bench::of(workbench, &prepared, Some(&filter)).map_err(refused)?;
    let bench = bench.with_files(ROWS, progress).map_err(refused)?;
    let progress = &bench.stop.watching(progress);
    let (base, all) = begin(workbench, &bench).map_err(refused)?;
    let suspects = chosen(experiment, &bench, &all)?;
    progress.begin("likelihood", 0);
    let found = with_signs(&bench, &base, &suspects, workbench);
    if progress.reached(0).is_break() {
        return Err(IdentifyError::Interrupted);
    }
    let (suspects, found) = found.ok_or_else(|| IdentifyError::Unfit {
        recording: bench.filter_name.clone(),
        why: NOWHERE.to_owned(),
    })?;
    let search = Search { bench: &bench, suspects: &suspects, base: &base };
    let cause = Cause::Numbers(found.at.iter().copied().enumerate().collect());
    let trial = search.run(&cause);
    let outcome = Outcome { bench: &bench, suspects: &suspects, base: &base, found, trial };
    outcome.told(workbench, experiment)
}

/// Identifies what an experiment asks for: the numbers that `identify.parameters` names ([`likeliest`]), or else what its device's rig
/// identifies.
pub fn identify(
    workbench: &Workbench,
    experiment: &Experiment,
    progress: &dyn Progress,
) -> Result<Identification, IdentifyError> {
    let names_numbers = experiment.identify.as_ref().is_some_and(|identify| !identify.parameters.is_empty());
    if names_numbers {
        likeliest(workbench, experiment, progress)
    } else {
        workbench.rig(experiment)?.identify(experiment, progress)
    }
}

const NOWHERE: &str = "the filter cannot be run beside the numbers of the experiment, so that no likelihood rises from there; `kalmems \
                       diagnose` looks further";

fn refused(error: DiagnoseError) -> IdentifyError {
    match error {
        DiagnoseError::Config(error) => error.into(),
        DiagnoseError::Read(error) => error.into(),
        DiagnoseError::Interrupted => IdentifyError::Interrupted,
        DiagnoseError::Stops { ref filter } => {
            IdentifyError::Unfit { recording: filter.clone(), why: error.to_string() }
        }
    }
}

/// Roles of recordings in which a device moves as its equations say.
const MOVES: [Role; 4] = [Role::Test, Role::SteadyState, Role::RingDown, Role::Sweep];

/// The experiment with the recordings that count as such to be estimated, and its first filter that is judged, none of whose states is
/// a parameter; and the name of that filter.
fn prepared(workbench: &Workbench, experiment: &Experiment) -> Result<(Experiment, String), IdentifyError> {
    let unwritten = |why: String| experiment.error(Key::default(), Fault::Value { why });
    let text = experiment.to_toml().map_err(|e| unwritten(e.to_string()))?;
    let mut document: Table = text.parse().map_err(|e: toml::de::Error| unwritten(e.to_string()))?;
    let trains = experiment.recordings.iter().any(|recording| recording.role == Role::Training);
    let counts = |role: Role| if trains { role == Role::Training } else { MOVES.contains(&role) };
    let mut roles = experiment.recordings.iter().map(|recording| recording.role);
    if let Some(Value::Array(recordings)) = document.get_mut("recording") {
        recordings.retain(|_| roles.next().is_some_and(counts));
        for recording in recordings.iter_mut().filter_map(Value::as_table_mut) {
            recording.insert("role".to_owned(), Value::String(Role::Test.key().to_owned()));
        }
        if recordings.is_empty() {
            let why = "no recording has the role `training`, `test`, `steady_state`, `ring_down` or `sweep`; parameters are identified \
                       from those";
            return Err(experiment.error("recording", Fault::Value { why: why.to_owned() }).into());
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
        return Err(experiment.error("estimate.filter", Fault::Value { why: why.to_owned() }).into());
    }
    let text = toml::to_string(&document).map_err(|e| unwritten(e.to_string()))?;
    Ok((workbench.parse(&text, experiment.path())?, chosen))
}

/// The numbers that the experiment names, among all that may be wrong.
fn chosen(experiment: &Experiment, bench: &Bench, all: &[Suspect]) -> Result<Vec<Suspect>, ConfigError> {
    let named = experiment.identify.iter().flat_map(|identify| &identify.parameters);
    let named: Vec<&String> = named.collect();
    let at = || Key::from("identify").child("parameters");
    if named.len() > MOST_SIZES {
        let why = format!("these are {} numbers; at most {MOST_SIZES} are identified together", named.len());
        return Err(experiment.error(at(), Fault::Value { why }));
    }
    let device = Key::from("device").child(experiment.device_name());
    let single = |suspect: &&Suspect| matches!(&suspect.what, What::Factor(numbers) if numbers.len() == 1);
    let key_of = |suspect: &Suspect| match &suspect.what {
        What::Factor(numbers) => numbers.first().map(|number| number.key.clone()),
        _ => None,
    };
    let mut suspects: Vec<Suspect> = Vec::new();
    for name in named {
        let below = |name: &str| name.split('.').fold(device.clone(), Key::child);
        let keys = [below(name), below(&format!("parameters.{name}"))];
        let found =
            all.iter().filter(single).find(|suspect| key_of(suspect).is_some_and(|own| keys.contains(&own)));
        let Some(found) = found else {
            if keys.iter().any(|key| get(&bench.document, key).is_some()) {
                let why = format!(
                    "`{name}` is 0 or no number with a unit; expected a number of the device's table that is not 0: its logarithm is sought"
                );
                return Err(experiment.error(at(), Fault::Value { why }));
            }
            let known: Vec<String> = all.iter().filter(single).map(Suspect::name).collect();
            return Err(experiment.error(at(), Fault::unknown_word(name, known.iter().map(String::as_str))));
        };
        if suspects.iter().any(|other| key_of(other) == key_of(found)) {
            let why = format!("`{name}` is named twice; a number is sought once");
            return Err(experiment.error(at(), Fault::Value { why }));
        }
        // Here a number may be wrong by more than is tried in a diagnosis: a noise is often known by its power of ten alone.
        let sizes = found.sizes.iter().copied().chain([FARTHEST, -FARTHEST]).collect();
        suspects.push(Suspect { sizes, ..found.clone() });
    }
    Ok(suspects)
}

/// What a sign has to gain in ln p to be another than the stated one.
const OTHER_SIGN: f64 = 5.0;

/// The sizes that make all innovations the likeliest, and the numbers with the signs under which they do: a number that the recordings
/// do not determine with its stated sign is tried with the other.
fn with_signs(
    bench: &Bench,
    base: &Trial,
    suspects: &[Suspect],
    workbench: &Workbench,
) -> Option<(Vec<Suspect>, MostLikelySizes)> {
    let of = |suspects: &[Suspect]| most_likely(&Search { bench, suspects, base }, workbench, base);
    let (mut suspects, mut best) = (suspects.to_vec(), of(suspects)?);
    for place in 0..suspects.len() {
        let is_determined = best.sd.get(place).is_some_and(|sd| *sd < DETERMINED);
        if is_determined {
            continue;
        }
        let mut other = suspects.clone();
        if let Some(What::Factor(numbers)) = other.get_mut(place).map(|suspect| &mut suspect.what) {
            for number in numbers {
                number.written = -number.written;
            }
        }
        if let Some(found) = of(&other)
            && found.log_likelihood > best.log_likelihood + OTHER_SIGN
        {
            (suspects, best) = (other, found);
        }
    }
    Some((suspects, best))
}

/// The sizes that make all innovations the likeliest, from the better of two starts.
fn most_likely(search: &Search, workbench: &Workbench, base: &Trial) -> Option<MostLikelySizes> {
    let zeros = vec![0.0; search.suspects.len()];
    let likelihood = |sizes: &[f64]| -> f64 {
        let cause = Cause::Numbers(sizes.iter().copied().enumerate().collect());
        let found = search.run(&cause).map(|trial| trial.log_likelihood(Blocks::All));
        found.filter(|l| l.is_finite()).unwrap_or(f64::NEG_INFINITY)
    };
    let as_states =
        as_states(search, workbench).filter(|sizes| likelihood(sizes) > base.log_likelihood(Blocks::All));
    let start = as_states.unwrap_or(zeros);
    let from = |sizes: &[f64]| {
        let cause = Cause::Numbers(sizes.iter().copied().enumerate().collect());
        search.most_likely(&cause, Blocks::All)
    };
    let mut best = from(&start)?;
    for _ in 1..SEARCHES {
        let Some(next) = from(&best.at) else { break };
        let gained = next.log_likelihood - best.log_likelihood;
        best = next;
        if gained < NO_GAIN {
            break;
        }
    }
    Some(best)
}

/// The numbers at which the filter arrives that has them as states, as logarithms of factors; `None` where one of them cannot be a
/// state.
fn as_states(search: &Search, workbench: &Workbench) -> Option<Vec<f64>> {
    let bench = search.bench;
    let rig = workbench.rig(&bench.experiment).ok()?;
    let known = rig.parameters(&bench.experiment);
    let filter = Key::from("estimate").child("filter").index(0).child("states");
    let mut changes = Vec::new();
    let mut names = Vec::new();
    for suspect in search.suspects {
        let name = suspect.name();
        let parameter = known.iter().find(|parameter| parameter.written == [(name.as_str(), 1)])?;
        let key = filter.clone().child(parameter.name).child("start_sd");
        changes.push(Change::Key(key, Value::String(AS_STATE.to_owned())));
        names.push(parameter.name);
    }
    let trial = bench.run(&changes)?;
    let at_end = |name: &&str| trial.at_end.iter().find(|(own, _)| own == name).map(|(_, value)| *value);
    let factor = |deviation: f64| (deviation > -0.9).then(|| Scalar::ln(1.0 + deviation));
    names.iter().map(|name| at_end(name).and_then(factor)).collect()
}

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
struct Outcome<'a> {
    bench: &'a Bench<'a>,
    suspects: &'a [Suspect],
    base: &'a Trial,
    found: MostLikelySizes,
    /// The run with what was found.
    trial: Option<Trial>,
}

impl Outcome<'_> {
    /// Whether the recordings tell a number, and whether what they tell of it hangs on none that they do not.
    fn is_told(&self, place: usize) -> bool {
        let determined = |place: usize| self.found.sd.get(place).is_some_and(|sd| *sd < DETERMINED);
        let hangs = |other: usize| {
            let row = self.found.correlation.get(place);
            row.and_then(|row| row.get(other)).is_some_and(|correlation| correlation.abs() > CONNECTED)
        };
        determined(place) && (0..self.suspects.len()).all(|other| determined(other) || !hangs(other))
    }

    fn told(&self, workbench: &Workbench, experiment: &Experiment) -> Result<Identification, IdentifyError> {
        let materials = self.bench.materials();
        let place = match materials.as_slice() {
            [one] => one.name.clone(),
            all => format!("{} recordings", all.len()),
        };
        let mut found = Identification {
            rig: workbench.rig(experiment)?.name(),
            parameters: Vec::new(),
            undetermined: Vec::new(),
            worst_pairs: self.worst_pair(&place).into_iter().collect(),
            warnings: Vec::new(),
            notes: Vec::new(),
            figures: Vec::new(),
            experiment: experiment.clone(),
            materials,
        };
        let (mut text, mut written) = (experiment.text().to_owned(), Vec::new());
        for (index, suspect) in self.suspects.iter().enumerate() {
            let What::Factor(numbers) = &suspect.what else { continue };
            let (Some(number), Some(size), Some(sd)) =
                (numbers.first(), self.found.at.get(index), self.found.sd.get(index))
            else {
                continue;
            };
            let unit = units::Unit::parse(if number.unit.is_empty() { "1" } else { &number.unit });
            let unit = unit.unwrap_or(units::Unit::ONE);
            let value = number.written * unit.factor() * Scalar::exp(*size);
            let mut interval = [-1.0, 1.0].map(|side| value * Scalar::exp(side * TWO_SIDED * sd));
            interval.sort_by(f64::total_cmp);
            let dimension = unit.dimension().to_string();
            found.parameters.push(Identified {
                name: suspect.name(),
                value,
                standard_error: (value * sd).abs(),
                interval,
                unit: if dimension == "1" { "" } else { units::name(&dimension) },
                recording: place.clone(),
            });
            if !self.is_told(index) {
                let why = "the recordings do not determine it, or what they tell of it hangs on another that they do not determine; the \
                           experiment keeps what it says. Record another amplitude, frequency or free decay, or leave it out of \
                           `identify.parameters` where it is known";
                found.undetermined.push(Undetermined { what: suspect.name(), why: why.to_owned() });
                continue;
            }
            let value = rounded(&number.times(Scalar::exp(*size)), Some(*sd));
            let is_noise = number
                .key
                .steps()
                .iter()
                .any(|step| matches!(step, Step::Name(name) if name.starts_with("noise")));
            let to = if is_noise { value } else { with_uncertainty(value, *sd) }.to_string();
            if !is_noise {
                written.push(index);
            }
            let edit = Edit { key: number.key.to_string(), from: None, to, sd: None };
            text = changed(&text, &edit).unwrap_or(text);
        }
        self.say(&mut found, &place);
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
        let (rows, long_s) = self.bench.extent();
        let gained = self.found.log_likelihood - self.base.log_likelihood(Blocks::All);
        found.notes.push(format!(
            "{place}: ln p of the innovations of `{}` rose by {gained:.1} over {rows} rows, {long_s:.4} s",
            self.bench.filter_name
        ));
        let failing: Vec<String> =
            self.trial.iter().flat_map(Trial::failing).map(crate::evaluate::TestResult::in_short).collect();
        if !failing.is_empty() {
            found.warnings.push(format!(
                "{place}: with these numbers the innovations still show what a filter that is right does not ({}): the device has more to \
                 it, and the standard errors are too small; `kalmems diagnose` looks for what is wrong",
                failing.join(", ")
            ));
        } else if self.trial.as_ref().is_none_or(|trial| !trial.passes()) {
            found.warnings.push(format!(
                "{place}: with these numbers the filter does not hold the motion; nothing here can be trusted"
            ));
        }
    }
}
