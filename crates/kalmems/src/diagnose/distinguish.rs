//! The recording that would tell causes apart which this one cannot.

use super::DiagnoseError;
use super::bench::TrialBench;
use super::cause::Cause;
use super::change::TrialChange;
use super::search::CauseSearch;
use super::suspect::Suspect;
use super::trial::{DiagnosisTrial, TrialBlocks};
use crate::config::put;
use crate::config::{Experiment, Key, written};
use crate::progress::{Progress, map_on_threads, processors};
use crate::rigs::Workbench;
use crate::simulate::{ComputedRecording, described};
use crate::units::Value as Quantity;
use serde::Serialize;
use toml::{Table, Value};

/// A recording that would tell causes apart.
#[derive(Clone, Debug, Serialize)]
pub struct Proposal {
    /// How it differs from the one that there is.
    pub what: String,
    /// By how much the first cause is likelier than the next in such a recording, if it is the true one, ln p.
    pub ahead: f64,
    /// The recording as a table `[simulate]`, to be tried.
    pub simulate: String,
}

/// What of a drive is varied.
const VARIED: [(&str, &[f64]); 6] = [
    ("amplitude", &[0.5, 0.8, 1.2]),
    ("voltage", &[0.8, 1.2]),
    ("high", &[0.8, 1.2]),
    ("frequency", &[0.97, 0.99, 1.01, 1.03]),
    ("rms", &[0.3, 3.0]),
    ("offset", &[0.8, 1.2]),
];

/// How much longer a recording is proposed.
const LONGER: f64 = 4.0;

/// ln p from which on two causes are told apart: a factor of a thousand.
const APART: f64 = 6.9;

/// The recording in which the first of these causes would be likeliest against all others; `None` where none of those that were tried
/// tells them apart, or none can be simulated.
pub(super) fn proposal(
    workbench: &Workbench,
    experiment: &Experiment,
    (bench, base): (&TrialBench, &DiagnosisTrial),
    causes: &[Vec<TrialChange>],
    progress: &dyn Progress,
) -> Result<Option<Proposal>, DiagnoseError> {
    let Some((first, others)) = causes.split_first() else { return Ok(None) };
    let there = SimulatedRecordings { workbench, experiment, bench };
    let Some(usual) = there.usual(base) else { return Ok(None) };
    let variations = variations(&usual);
    let work = (progress, "simulating other recordings");
    let tried = map_on_threads(work, processors(), (variations.len(), 1), |place, heard| {
        heard.reached(0).is_continue().then(|| {
            let (what, simulate) = variations.get(place)?;
            let ahead = there.ahead(simulate, (first, others))?;
            let table = Table::from_iter([("simulate".to_owned(), Value::Table(simulate.clone()))]);
            Some(Proposal { what: what.clone(), ahead, simulate: toml::to_string(&table).ok()? })
        })
    });
    let tried = tried.ok_or(DiagnoseError::Interrupted)?;
    let best = tried.into_iter().flatten().max_by(|a, b| a.ahead.total_cmp(&b.ahead));
    Ok(best.filter(|best| best.ahead > APART))
}

/// Recordings that there are not, simulated.
pub(super) struct SimulatedRecordings<'a> {
    pub(super) workbench: &'a Workbench,
    pub(super) experiment: &'a Experiment,
    pub(super) bench: &'a TrialBench<'a>,
}

impl SimulatedRecordings<'_> {
    /// The recording that there is, as a simulation: what the file says, or else its drive and the motion as it was estimated.
    pub(super) fn usual(&self, base: &DiagnosisTrial) -> Option<Table> {
        if self.experiment.simulate.is_some() {
            let whole: Table = self.experiment.to_toml().ok()?.parse().ok()?;
            return whole.get("simulate")?.as_table().cloned();
        }
        let (_, duration_s) = self.bench.extent();
        let (drive, rate_hz) = (base.drive?, self.bench.rate_hz());
        let sine = Table::from_iter([
            ("offset".to_owned(), written(drive.offset, "V")),
            ("amplitude".to_owned(), written(drive.amplitude, "V")),
            ("frequency".to_owned(), written(drive.frequency_hz, "Hz")),
        ]);
        // The start has the states of the motion, or none where it is at rest.
        let starts = [base.start.as_slice(), &[]].map(|states| {
            let each = states.iter().map(|(name, unit, value)| ((*name).to_owned(), written(*value, unit)));
            each.collect::<Table>()
        });
        starts.into_iter().find_map(|start| {
            let simulate = Table::from_iter([
                ("duration".to_owned(), written(duration_s, "s")),
                ("sampling_rate".to_owned(), written(rate_hz, "Hz")),
                ("integration_rate".to_owned(), written(10.0 * rate_hz, "Hz")),
                ("start".to_owned(), Value::Table(start)),
                (
                    "drive".to_owned(),
                    Value::Table(Table::from_iter([("sine".to_owned(), Value::Table(sine.clone()))])),
                ),
            ]);
            let changed = self.with_simulation(&simulate, &[])?;
            self.workbench.rig(&changed).ok()?.simulate(&changed).ok()?;
            Some(simulate)
        })
    }

    /// The experiment without its recordings, with a simulation and with changes of its device.
    fn with_simulation(&self, simulate: &Table, changes: &[TrialChange]) -> Option<Experiment> {
        let mut document = self.bench.document.clone();
        document.remove("recording");
        document.remove("identify");
        document.insert("simulate".to_owned(), Value::Table(simulate.clone()));
        for change in changes {
            change.write(&mut document).ok()?;
        }
        self.workbench.parse(&toml::to_string(&document).ok()?, self.experiment.path()).ok()
    }

    /// A bench with the simulated recording of a device with these changes; its filter is told the device as it is stated.
    fn bench(&self, simulate: &Table, changes: &[TrialChange]) -> Option<TrialBench<'_>> {
        let real = self.with_simulation(simulate, changes)?;
        let simulation = self.workbench.rig(&real).ok()?.simulate(&real).ok()?;
        let simulated = ComputedRecording::of(&*simulation, &self.bench.stop).ok()?;
        let told = described(&self.with_simulation(simulate, &[])?, &*simulation);
        let mut there = TrialBench::of(self.workbench, &told, None).ok()?;
        there.stop = self.bench.stop.clone();
        let rig = self.workbench.rig(&there.experiment).ok()?;
        let index = *rig.wanted(&there.experiment).ok()?.first()?;
        let recording = simulated.recorded(&rig.layout(&there.experiment, index).ok()?).ok()?;
        there.with_recording(recording).ok()
    }

    /// By how much the first cause is likelier than the next one in a simulated recording of a device that has it, ln p.
    fn ahead(&self, simulate: &Table, (first, others): (&[TrialChange], &[Vec<TrialChange>])) -> Option<f64> {
        let there = self.bench(simulate, first)?;
        let likelihood = |changes: &[TrialChange]| Some(there.run(changes)?.innovations.log_likelihood());
        let own = likelihood(first)?;
        let next = others.iter().filter_map(|changes| likelihood(changes)).fold(f64::NEG_INFINITY, f64::max);
        Some(own - next).filter(|ahead| ahead.is_finite())
    }

    /// The relative standard errors with which the simulated recording of a device with these sizes would tell them all together.
    pub(super) fn errors(&self, simulate: &Table, suspects: &[Suspect], sizes: &[f64]) -> Option<Vec<f64>> {
        let cause = Cause::Numbers(sizes.iter().copied().enumerate().collect());
        let there = self.bench(simulate, &cause.changes(suspects)?)?;
        let base = there.run(&cause.changes(suspects)?)?;
        let search = CauseSearch { bench: &there, suspects, base: &base };
        Some(search.most_likely(&cause, TrialBlocks::All)?.sd)
    }
}

/// Recordings that differ from a simulated one in one thing each.
pub(super) fn variations(usual: &Table) -> Vec<(String, Table)> {
    let mut all = Vec::new();
    let mut vary = |key: Key, text: &str, factors: &[f64], name: &str| {
        let Ok(value) = Quantity::parse(text) else { return };
        let (number, unit) = value.parts();
        let Some(number) = number.parse::<f64>().ok().filter(|number| *number != 0.0) else { return };
        for factor in factors {
            let mut varied = usual.clone();
            // The digits that a factor of two of them leaves.
            let number: f64 = format!("{:.7e}", number * factor).parse().unwrap_or(number * factor);
            if put(&mut varied, &key, written(number, unit)).is_ok() {
                let text_now = format!("{number} {unit}");
                all.push((format!("the drive's {name} {} instead of {text}", text_now.trim()), varied));
            }
        }
    };
    if let Some(Value::Table(drive)) = usual.get("drive") {
        for (kind, table) in drive {
            let Value::Table(table) = table else { continue };
            for (name, factors) in VARIED {
                if let Some(Value::String(text)) = table.get(name) {
                    vary(Key::from("drive").child(kind).child(name), text, factors, name);
                }
            }
        }
    }
    if let Some(Value::String(text)) = usual.get("duration")
        && let Ok(value) = Quantity::parse(text)
    {
        let mut longer = usual.clone();
        longer.insert("duration".to_owned(), written(LONGER * value.si(), "s"));
        all.push((format!("{LONGER} times as long"), longer));
    }
    all
}
