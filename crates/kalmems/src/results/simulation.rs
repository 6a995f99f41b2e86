//! The files of a simulation.

use super::{Output, OutputError, RUN_FILE, RunInfo};
use crate::config::Experiment;
use crate::progress::Progress;
use crate::recording::Source;
use crate::simulate::{
    Channel, RECORDING, REFERENCE, Sample, SimulateError, Simulation, WhiteNoise, described,
};
use serde::Serialize;
use sha2::{Digest, Sha256};
use std::fmt::Write as _;
use std::io::{self, Write};
use std::ops::ControlFlow;
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
    /// What the run tells beside its samples, a line each.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub told: Vec<String>,
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

/// Runs a simulation and writes it into a result.
///
/// `recording.csv` has what a laboratory would have recorded and `reference.csv` the true motion; `experiment.toml`
/// is the experiment with this recording in the place of its own, ready to be estimated; `run.toml` says what it was
/// made from. Samples are written as they come.
pub fn write_simulation(
    experiment: &Experiment,
    simulation: &dyn Simulation,
    output: &Output,
    info: impl FnOnce() -> RunInfo,
    progress: &dyn Progress,
) -> Result<SimulationSummary, SimulationWriteError> {
    let input_id = input_id(experiment, simulation);
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
    let toml = described(experiment, simulation).to_toml().map_err(io::Error::other);
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
            experiment: experiment.to_table().map_err(io::Error::other)?,
        };
        w.write_all(toml::to_string(&run).map_err(io::Error::other)?.as_bytes())
    })?;
    let papers = simulation.papers();
    for paper in &papers.files {
        output.write(paper.name, |w| w.write_all(&paper.content))?;
    }
    let (samples, outlook, told) = (simulation.samples(), simulation.outlook(), papers.lines);
    Ok(SimulationSummary { samples, largest, outlook, told, seed })
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

/// Numbers are as short as they can be and still read back as the same bits; a cell without a sample is empty.
fn row(w: &mut dyn Write, sample: &Sample, values: &[f64]) -> io::Result<()> {
    write!(w, "{}", sample.time_s)?;
    for value in values {
        if value.is_nan() {
            write!(w, ",")?;
        } else {
            write!(w, ",{value}")?;
        }
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

#[derive(Serialize)]
struct Run<'a> {
    version: &'static str,
    command: &'static str,
    input_id: String,
    noise: Noise,
    timing: Timing,
    input: &'a [Source],
    experiment: toml::Table,
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
