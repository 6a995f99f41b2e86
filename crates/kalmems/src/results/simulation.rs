//! The files of a simulation.

use super::{Output, OutputError, RUN_FILE, RunInfo};
use crate::config::{Channels, Clock, Experiment, Name, Recording, Reference, Role};
use crate::estimate::Progress;
use crate::recording::Source;
use crate::simulate::{Channel, Sample, SimulateError, Simulation, WhiteNoise};
use serde::Serialize;
use sha2::{Digest, Sha256};
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::io::{self, Write};
use std::ops::ControlFlow;
use std::path::Path;
use std::time::UNIX_EPOCH;

/// What was simulated.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SimulationSummary {
    /// Samples written.
    pub samples: u64,
    /// The largest magnitude of the first true channel, in its SI unit.
    pub largest: f64,
    /// What could be said before, such as that the device cannot oscillate at this drive.
    pub outlook: Option<String>,
    /// The seed of the noise.
    pub seed: u64,
}

/// Why a simulation is not there.
#[derive(Debug, thiserror::Error)]
pub enum SimulationWriteError {
    /// It cannot be simulated.
    #[error(transparent)]
    Simulate(#[from] SimulateError),
    /// It cannot be written.
    #[error(transparent)]
    Output(#[from] OutputError),
}

const RECORDING: &str = "recording.csv";
const REFERENCE: &str = "reference.csv";

/// Runs a simulation and writes it to a folder.
///
/// `recording.csv` has what a laboratory would have recorded and `reference.csv` the true motion; `experiment.toml`
/// is the experiment with this recording in the place of its own, ready to be estimated; `run.toml` says what it was
/// made from. Samples are written as they come.
pub fn write_simulation(
    experiment: &Experiment,
    simulation: &dyn Simulation,
    target: &Path,
    force: bool,
    info: impl FnOnce() -> RunInfo,
    progress: &dyn Progress,
) -> Result<SimulationSummary, SimulationWriteError> {
    let input_id = input_id(experiment, simulation);
    let output = Output::prepare(target, &input_id, force)?;
    progress.begin("simulating", simulation.samples());
    let mut largest = 0.0_f64;
    let mut ended = Ok(());
    let mut nested = Ok(());
    output.write(RECORDING, |recording| {
        nested = output.write(REFERENCE, |reference| {
            header(recording, simulation.recorded())?;
            header(reference, simulation.truth())?;
            let (mut done, mut written) = (0, Ok(()));
            ended = simulation.run(&mut |sample| {
                largest = largest.max(sample.truth.first().map_or(0.0, |x| x.abs()));
                written = row(recording, sample, sample.recorded)
                    .and_then(|()| row(reference, sample, sample.truth));
                done += 1;
                let look = done % PULSE == 0 && progress.reached(done).is_break();
                if look || written.is_err() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
            });
            written
        });
        Ok(())
    })?;
    nested?;
    ended?;
    let toml = simulated(experiment, simulation).to_toml().map_err(io::Error::other);
    output.write("experiment.toml", |w| w.write_all(toml?.as_bytes()))?;
    let seed = experiment.simulate.as_ref().map_or(0, |simulate| simulate.seed);
    output.write(RUN_FILE, |w| {
        let info = info();
        let run = Run {
            version: env!("CARGO_PKG_VERSION"),
            command: "simulate",
            input_id,
            noise: Noise { generator: WhiteNoise::NAME, seed, stream: 0 },
            timing: Timing {
                started_unix_s: info.started.duration_since(UNIX_EPOCH).map_or(0, |d| d.as_secs()),
                took_s: info.took.as_secs_f64(),
            },
            input: simulation.sources(),
            experiment: toml::Value::try_from(experiment).map_err(io::Error::other)?,
        };
        w.write_all(toml::to_string(&run).map_err(io::Error::other)?.as_bytes())
    })?;
    output.commit()?;
    Ok(SimulationSummary { samples: simulation.samples(), largest, outlook: simulation.outlook(), seed })
}

/// Samples between two looks at whether to go on.
const PULSE: u64 = 10_000;

fn header(w: &mut dyn Write, channels: &[Channel]) -> io::Result<()> {
    write!(w, "time_s")?;
    for channel in channels {
        write!(w, ",{}", channel.column)?;
    }
    writeln!(w)
}

/// Numbers are as short as they can be and still read back as the same bits.
fn row(w: &mut dyn Write, sample: &Sample, values: &[f64]) -> io::Result<()> {
    write!(w, "{}", sample.time_s)?;
    for value in values {
        write!(w, ",{value}")?;
    }
    writeln!(w)
}

/// What tells one input from another: the experiment's name and a digest of all it says, drive files included.
fn input_id(experiment: &Experiment, simulation: &dyn Simulation) -> String {
    let mut hash = Sha256::new();
    hash.update(experiment.to_toml().unwrap_or_default());
    for source in simulation.sources() {
        hash.update(&source.sha256);
    }
    let mut digest = String::new();
    for byte in hash.finalize().iter().take(6) {
        let _ = write!(digest, "{byte:02x}");
    }
    format!("{}: simulation {digest}", experiment.name)
}

/// The experiment with the simulated recording instead of its own.
fn simulated(experiment: &Experiment, simulation: &dyn Simulation) -> Experiment {
    let named = |channels: &[Channel]| {
        let names: BTreeMap<String, String> =
            channels.iter().map(|c| (c.meaning.to_owned(), c.column.to_owned())).collect();
        Channels::try_from(names).ok()
    };
    let mut simulated = experiment.clone();
    // Its estimate shall not take the place of that of the real recording.
    if let Ok(name) = Name::try_from(format!("{}-simulated", experiment.name)) {
        simulated.name = name;
    }
    simulated.simulate = None;
    simulated.recordings = named(simulation.recorded())
        .map(|channels| Recording {
            name: None,
            role: Role::Test,
            file: RECORDING.into(),
            segments: None,
            clock: Clock::Column { column: "time_s".to_owned() },
            channels,
            reference: named(simulation.truth()).map(|truth| Reference::of(REFERENCE.into(), truth)),
        })
        .into_iter()
        .collect();
    simulated
}

#[derive(Serialize)]
struct Run<'a> {
    version: &'static str,
    command: &'static str,
    input_id: String,
    noise: Noise,
    timing: Timing,
    input: &'a [Source],
    experiment: toml::Value,
}

#[derive(Serialize)]
struct Noise {
    generator: &'static str,
    seed: u64,
    stream: u64,
}

#[derive(Serialize)]
struct Timing {
    started_unix_s: u64,
    took_s: f64,
}
