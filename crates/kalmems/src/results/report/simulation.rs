//! The files of a simulation.

use crate::config::Experiment;
use crate::inspect::quantity;
use crate::progress::Progress;
use crate::recording::RecordingSource;
use crate::results::{Output, OutputError, RunInfo, RunTiming, way_from};
use crate::rigs::Rig;
use crate::simulate::{
    IntegrationError, RECORDING, REFERENCE, SimulateError, SimulatedColumn, SimulatedSample, Simulation,
    WhiteNoise, described,
};
use crate::units::ColumnHeader;
use kalmems_figures::{
    Axis, Figure, NoticeSeverity, Page, PagePart, PageSection, Panel, ReportError, Series, SeriesRole, Track,
};
use serde::Serialize;
use sha2::{Digest, Sha256};
use std::fmt::Write as _;
use std::io::{self, Write};
use std::ops::ControlFlow;

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
    /// What integration steps of half the length change; not there where nothing depends on them.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub integration: Option<IntegrationError>,
    /// The seed of the noise.
    pub seed: u64,
}

impl SimulationSummary {
    /// What the integration steps change, in words, and what to write where that shows.
    pub fn integration_sentence(&self) -> Option<String> {
        let IntegrationError { column, largest, in_noise_sd, samples } = self.integration.as_ref()?;
        let unit = ColumnHeader::parse(column).unit_text;
        let change = match in_noise_sd {
            Some(sds) => format!("{sds:.1e} standard deviations of the noise of a sample"),
            None => quantity(*largest, &unit),
        };
        let remedy = if self.integration.as_ref().is_some_and(IntegrationError::is_remarkable) {
            "; raise `simulate.integration_rate`"
        } else {
            ""
        };
        Some(format!(
            "integration steps of half the length change `{column}` by at most {change} over the first {samples} samples{remedy}"
        ))
    }
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
    /// The report cannot be made.
    #[error(transparent)]
    Report(#[from] ReportError),
}

/// Runs a simulation and writes it into a result.
///
/// `recording.csv` has what a laboratory would have recorded and `reference.csv` the true motion; `experiment.toml`
/// is the experiment with this recording instead of its own, ready to be estimated; `run.toml` says what it was
/// made from; `report.html` shows it. Samples are written as they come. The rig, which made the simulation, simulates the beginning again in
/// steps of half the length, to say what these change.
pub fn write_simulation(
    experiment: &Experiment,
    rig: &dyn Rig,
    simulation: &dyn Simulation,
    output: &Output,
    info: impl FnOnce() -> RunInfo,
    progress: &dyn Progress,
) -> Result<SimulationSummary, SimulationWriteError> {
    let input_id = input_id(experiment, simulation);
    let start = simulation.begin()?;
    let integration = IntegrationError::of(experiment, &start, &|other| rig.simulate(other))?;
    progress.begin("simulating", simulation.samples());
    let mut largest = 0.0_f64;
    let (mut recorded, mut truth) =
        (Track::new(simulation.recorded().len()), Track::new(simulation.truth().len()));
    let mut ended = Ok(());
    let mut nested = Ok(());
    output.write(RECORDING, |recording| {
        nested = output.write(REFERENCE, |reference| {
            header(recording, simulation.recorded())?;
            header(reference, simulation.truth())?;
            let (mut done, mut written) = (0, Ok(()));
            ended = simulation.run_from(&start, &mut |sample| {
                largest = largest.max(sample.truth.first().map_or(0.0, |x| x.abs()));
                written = row(recording, sample, sample.recorded)
                    .and_then(|()| row(reference, sample, sample.truth));
                recorded.push(sample.time_s, sample.recorded);
                truth.push(sample.time_s, sample.truth);
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
    // Files that the device names, such as a measured curve, are read from where they are.
    let moved = experiment.with_files(&|file| {
        let there = experiment.resolve(file);
        way_from(output.target(), &there).unwrap_or(there)
    });
    let toml = described(&moved, simulation).to_toml().map_err(io::Error::other);
    output.write("experiment.toml", |w| w.write_all(toml?.as_bytes()))?;
    let seed = experiment.simulate.as_ref().map_or(0, |simulate| simulate.seed);
    output.write_run(&input_id, || {
        Ok(SimulationRecord {
            noise: NoiseSeedRecord { generator: WhiteNoise::NAME, seed, stream: 0 },
            timing: info().timing(),
            input: simulation.sources(),
            experiment: experiment.to_table().map_err(io::Error::other)?,
        })
    })?;
    let written = simulation.files();
    for paper in &written.files {
        output.write(paper.name, |w| w.write_all(&paper.content))?;
    }
    for figure in &written.figures {
        output.write(&format!("{}.svg", figure.id), |w| w.write_all(figure.to_svg().as_bytes()))?;
    }
    let (samples, outlook, told) = (simulation.samples(), simulation.outlook(), written.lines);
    let summary = SimulationSummary { samples, largest, outlook, told, integration, seed };
    let html = simulation_page(experiment, simulation, &summary, [&recorded, &truth])?;
    output.write("report.html", |w| w.write_all(html.as_bytes()))?;
    Ok(summary)
}

/// What was simulated as a page, with all that passed through the tracks of what is recorded and of what is true.
fn simulation_page(
    experiment: &Experiment,
    simulation: &dyn Simulation,
    summary: &SimulationSummary,
    [recorded, truth]: [&Track; 2],
) -> Result<String, ReportError> {
    let SimulationSummary { samples, outlook, told, seed, .. } = summary;
    let text =
        format!("Simulated, and no recording of a device: {samples} samples, with noise of the seed {seed}.");
    let mut verdict =
        PageSection::new("What was simulated").part(PagePart::Verdict).notice(NoticeSeverity::Note, text);
    for line in outlook.iter().chain(told) {
        verdict = verdict.paragraph(line.as_str());
    }
    if let Some(sentence) = summary.integration_sentence() {
        verdict = verdict.paragraph(format!("Integration: {sentence}."));
    }
    let figure = |id: &str, title: &str, caption: &str, role, channels: &[SimulatedColumn], track: &Track| {
        let panels = channels.iter().enumerate().map(|(place, channel)| {
            let (label, unit) = labelled(channel.column);
            let panel = Panel::new(Axis::new("time", "s"), Axis::new(label, unit));
            let panel = panel.with(Series::of_track("", role, track, [place, place]));
            if place > 0 { panel.sharing_x() } else { panel }
        });
        panels.fold(Figure::new(id, title, caption), Figure::with)
    };
    let motion = PageSection::new("Recording and motion")
        .figure(figure(
            "recording",
            "What a laboratory would have recorded",
            "The simulated recording, noise included.",
            SeriesRole::Measured,
            simulation.recorded(),
            recorded,
        ))
        .figure(figure(
            "truth",
            "What is true",
            "The simulated motion without noise, as the reference has it.",
            SeriesRole::Reference,
            simulation.truth(),
            truth,
        ));
    let toml = experiment.to_toml().unwrap_or_else(|e| format!("cannot be written: {e}"));
    let beside = "The samples are in `recording.csv` and `reference.csv`; `experiment.toml` estimates from them; dates and durations \
                  are in `run.toml`.";
    let made = PageSection::made("simulate", env!("CARGO_PKG_VERSION"), beside);
    let subtitle = experiment.description.clone().unwrap_or_default();
    Page::new(format!("{}: simulated", experiment.name), subtitle)
        .with(verdict)
        .with(motion)
        .with(made.preformatted("The experiment as it was understood", toml))
        .to_html()
}

/// The name of a column in words, and its unit as people write it: `accel_m_per_s2` as "accel" and "m/s^2".
fn labelled(column: &str) -> (String, String) {
    let unit = ColumnHeader::parse(column).unit_text;
    let name = column.strip_suffix(&unit).map_or(column, |name| name.trim_end_matches('_'));
    let unit = unit.replace("_per_", "/").replace('_', " ").replace("s2", "s^2").replace("s3", "s^3");
    (name.replace('_', " "), unit)
}

/// Samples between two looks at whether to go on.
const PULSE: u64 = 10_000;

fn header(w: &mut dyn Write, channels: &[SimulatedColumn]) -> io::Result<()> {
    write!(w, "time_s")?;
    for channel in channels {
        write!(w, ",{}", channel.column)?;
    }
    writeln!(w)
}

/// Numbers are as short as they can be and still read back as the same bits; a cell without a sample is empty.
fn row(w: &mut dyn Write, sample: &SimulatedSample, values: &[f64]) -> io::Result<()> {
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
struct SimulationRecord<'a> {
    noise: NoiseSeedRecord,
    timing: RunTiming,
    input: &'a [RecordingSource],
    experiment: toml::Table,
}

#[derive(Serialize)]
struct NoiseSeedRecord {
    generator: &'static str,
    seed: u64,
    stream: u64,
}

#[cfg(test)]
mod tests {
    use super::labelled;

    #[test]
    fn a_column_has_words_and_a_unit_that_people_write() {
        for (column, name, unit) in [
            ("cap_V", "cap", "V"),
            ("rate_rad_per_s", "rate", "rad/s"),
            ("acceleration_m_per_s2", "acceleration", "m/s^2"),
            ("near_end_velocity_m_per_s", "near end velocity", "m/s"),
        ] {
            assert_eq!(labelled(column), (name.to_owned(), unit.to_owned()));
        }
    }
}
