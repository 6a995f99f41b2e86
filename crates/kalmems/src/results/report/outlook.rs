//! The pictures and files of what can be said of a device before a recording.

use super::figure_files::write_figure;
use super::inspection::draw;
use crate::config::Experiment;
use crate::outlook::{AmplitudeDeviations, AmplitudeResponse, AtFrequency, Outlook, SmallMotionGrowth};
use crate::results::{Output, OutputError, ResultWriteError, RunInfo, RunTiming};
use crate::simulate::{SteadyMotion, SweepPoint};
use kalmems_figures::{
    Axis, Figure, MapGrid, Page, PagePart, PageSection, Panel, ReportError, Series, SeriesRole,
};
use kalmems_models::constants::STANDARD_GRAVITY;
use serde::Serialize;
use sha2::{Digest, Sha256};
use std::fmt::Write as _;
use std::io;
use std::path::Path;

/// Facts that say how the device moves; the first of them that is known answers.
const MOTION: [&str; 5] = [
    "steady_deg_at_hz",
    "motion_rad_and_rad_per_s",
    "closed_loop_bandwidth_hz",
    "resonance_hz_quality_rad_per_s_per_v",
    "mode_hz_and_damping_ratio",
];

/// Facts that say how well the motion can be known; likewise.
const UNCERTAINTY: [&str; 3] = ["causal_wiener_mg", "standard_deviations_at_the_end", "one_sample_nm"];

/// What can be said of a device before a recording, with the answer first.
#[derive(Serialize)]
pub struct AnsweredOutlook<'a> {
    /// How the device moves, and how well that can be known; a sentence each.
    pub answer: Vec<&'a str>,
    /// All that can be said.
    #[serde(flatten)]
    pub outlook: &'a Outlook,
}

impl<'a> AnsweredOutlook<'a> {
    /// The answer is taken from the facts.
    pub fn of(outlook: &'a Outlook) -> Self {
        let first = |names: &[&str]| names.iter().find_map(|name| Some(outlook.fact(name)?.text.as_str()));
        let answer = [first(&MOTION), first(&UNCERTAINTY)].into_iter().flatten().collect();
        Self { answer, outlook }
    }

    /// In words.
    pub fn to_text(&self) -> String {
        let answer = self.answer.join("\n");
        let space = if answer.is_empty() { "" } else { "\n\n" };
        format!("{answer}{space}{}", self.outlook.to_text())
    }
}

/// The drive's frequency in Hz and the amplitude of the steady motion in deg; `None` without a steady motion.
fn operating_point(outlook: &Outlook) -> Option<[f64; 2]> {
    let [amplitude, frequency_hz] = *outlook.fact("steady_deg_at_hz")?.values.as_slice() else { return None };
    Some([frequency_hz, amplitude])
}

/// A point with a text, as what the experiment does.
fn operating(point: [f64; 2], text: String) -> Series {
    Series::written("the experiment's drive", SeriesRole::Input, [(point[0], point[1], text)])
}

/// Amplitude over frequency, the map of stability, and what the signal tells; those of them for which there are data.
pub fn outlook_figures(outlook: &Outlook) -> Vec<Figure> {
    let sweep = outlook.response.as_ref().map(|response| {
        Figure::new(
            "response",
            format!("{}: amplitude against frequency", outlook.experiment),
            "Sweeps are simulated, each frequency from the motion at the one before; the wide and the dashed line are by \
             harmonic balance. Where the two ways differ, the unstable motion lies between.",
        )
        .with(response_panel(response, operating_point(outlook)))
    });
    let map = outlook.start.as_ref().map(|start| {
        Figure::new(
            "stability",
            format!("{}: where a motion starts by itself", outlook.experiment),
            "The growth rate of a small motion about rest, by integration over one period of the drive; the waveform keeps \
             its shape over its size. The dashed lines are the tongue to first order in the pump depth.",
        )
        .with(stability_panel(start, operating_point(outlook)))
    });
    let tells = (!outlook.information.is_empty()).then(|| {
        Figure::new(
            "information",
            format!("{}: what the signal tells in 1 ms", outlook.experiment),
            "The least standard deviations from the signal alone, over the amplitude of a steady motion.",
        )
        .with(information_panel(&outlook.information))
    });
    let over_frequency = (!outlook.frequencies.is_empty()).then(|| {
        Figure::new(
            "frequencies",
            format!("{}: response and noise over frequency", outlook.experiment),
            "Top: the output for an acceleration, with the loop and without, and its phase. Then the loop gain, and by how \
             much the loop amplifies a disturbance. Bottom: what the noise looks like at the input, which no loop changes.",
        )
        .with(responses_panel(&outlook.frequencies))
        .with(phases_panel(&outlook.frequencies).sharing_x())
        .with(loop_panel(&outlook.frequencies).sharing_x())
        .with(noise_panel(&outlook.frequencies).sharing_x())
    });
    [sweep, map, tells, over_frequency].into_iter().flatten().collect()
}

/// Both sweeps and the balance.
fn response_panel(response: &AmplitudeResponse, operating_at: Option<[f64; 2]>) -> Panel {
    let points = |sweep: &[SweepPoint]| -> Vec<(f64, f64)> {
        sweep.iter().map(|point| (point.drive_hz, point.amplitude.to_degrees())).collect()
    };
    let mut panel = Panel::new(Axis::new("drive frequency", "Hz"), Axis::new("amplitude", "deg"));
    let (mut named_stable, mut named_unstable) = (false, false);
    for run in response.balance.chunk_by(|a, b| a.is_stable == b.is_stable) {
        let line: Vec<(f64, f64)> = run
            .iter()
            .map(|motion: &SteadyMotion| (motion.drive_hz, motion.amplitude.to_degrees()))
            .collect();
        let stable = run.first().is_some_and(|motion| motion.is_stable);
        let (role, label, named) = if stable {
            (SeriesRole::Reference, "steady, by harmonic balance", &mut named_stable)
        } else {
            (SeriesRole::Bound, "steady but unstable, by harmonic balance", &mut named_unstable)
        };
        panel = panel.with(Series::line(if *named { "" } else { label }, role, line));
        *named = true;
    }
    let panel = panel
        .with(Series::line("simulated, sweeping down", SeriesRole::Estimate, points(&response.sweeps.down)))
        .with(Series::points("simulated, sweeping up", SeriesRole::Model, points(&response.sweeps.up)));
    let own = operating_at.map(|point| operating(point, format!("{:.2}°", point[1])));
    own.into_iter().fold(panel, Panel::with)
}

/// The map with the tongue over it.
fn stability_panel(start: &SmallMotionGrowth, operating_at: Option<[f64; 2]>) -> Panel {
    let volts: Vec<f64> = start.map.factor.iter().map(|factor| factor * start.peak_volts).collect();
    let edges =
        start.tongue_hz.iter().zip(&volts).filter_map(|(tongue, volts)| Some((tongue.as_ref()?, *volts)));
    // Down one side and up the other: one line.
    let edges: Vec<([f64; 2], f64)> = edges.map(|(edges, volts)| (*edges, volts)).collect();
    let low = edges.iter().rev().map(|(edges, volts)| (edges[0], *volts));
    let tongue: Vec<(f64, f64)> = low.chain(edges.iter().map(|(edges, volts)| (edges[1], *volts))).collect();
    let grid = MapGrid {
        x: start.map.drive_hz.clone(),
        y: volts,
        values: start.map.growth_rate.clone(),
        colours: Axis::new("growth rate", "1/s"),
        level: 0.0,
    };
    let panel = Panel::new(Axis::new("drive frequency", "Hz"), Axis::new("largest drive voltage", "V"))
        .with(Series::map("rest becomes unstable", grid))
        .with(Series::line("tongue to first order", SeriesRole::Bound, tongue));
    let text = format!("{:.0} V", start.peak_volts);
    panel.with(match operating_at {
        Some([frequency_hz, _]) => operating([frequency_hz, start.peak_volts], text),
        None => Series::level("the experiment's drive", SeriesRole::Input, start.peak_volts),
    })
}

/// A line over frequency.
fn over_frequency(
    label: &str,
    role: SeriesRole,
    frequencies: &[AtFrequency],
    of: impl Fn(&AtFrequency) -> Option<f64>,
) -> Series {
    let points = frequencies.iter().filter_map(|at| Some((at.frequency_hz, of(at)?)));
    Series::line(label, role, points)
}

fn frequency_axis() -> Axis {
    Axis::new("frequency", "Hz").log()
}

/// The output for what is measured.
fn responses_panel(frequencies: &[AtFrequency]) -> Panel {
    const PER_G: f64 = 1e3 * STANDARD_GRAVITY;
    let axis = Axis::new("output", "mV/g").log();
    with_and_without(frequencies, axis, |at| [at.response * PER_G, at.open_response * PER_G])
}

/// By how much it is late.
fn phases_panel(frequencies: &[AtFrequency]) -> Panel {
    with_and_without(frequencies, Axis::new("phase", "deg"), |at| {
        [at.phase.to_degrees(), at.open_phase.to_degrees()]
    })
}

/// Something with the loop, and without it where there is one.
fn with_and_without(frequencies: &[AtFrequency], axis: Axis, of: fn(&AtFrequency) -> [f64; 2]) -> Panel {
    let line = |label, role, place: usize| {
        over_frequency(label, role, frequencies, move |at| of(at).get(place).copied())
    };
    let mut panel = Panel::new(frequency_axis(), axis);
    if frequencies.iter().any(|at| at.loop_gain > 0.0) {
        panel = panel.with(line("without the loop", SeriesRole::Model, 1));
    }
    panel.with(line("output", SeriesRole::Estimate, 0))
}

/// The loop, where there is one.
fn loop_panel(frequencies: &[AtFrequency]) -> Panel {
    let of = |at: &AtFrequency| (at.loop_gain > 0.0).then_some(at.loop_gain);
    Panel::new(frequency_axis(), Axis::new("loop", "1").log())
        .with(over_frequency("loop gain", SeriesRole::Input, frequencies, of))
        .with(over_frequency("sensitivity", SeriesRole::Estimate, frequencies, |at| Some(at.sensitivity)))
        .with(Series::level("", SeriesRole::Bound, 1.0))
}

/// Noise at the input.
fn noise_panel(frequencies: &[AtFrequency]) -> Panel {
    let micro_g = 1e6 / STANDARD_GRAVITY;
    Panel::new(frequency_axis(), Axis::new("noise at the input", "µg/√Hz").log())
        .with(over_frequency("molecules", SeriesRole::Model, frequencies, |at| Some(at.brownian * micro_g)))
        .with(over_frequency("readout", SeriesRole::Measured, frequencies, |at| Some(at.readout? * micro_g)))
}

/// Standard deviations over the amplitude.
fn information_panel(information: &[AmplitudeDeviations]) -> Panel {
    let line = |of: fn(&AmplitudeDeviations) -> f64| -> Vec<(f64, f64)> {
        information.iter().map(|at| (at.amplitude.to_degrees(), of(at).to_degrees())).collect()
    };
    Panel::new(Axis::new("amplitude", "deg"), Axis::new("standard deviation", "deg").log())
        .with(Series::line("phase", SeriesRole::Estimate, line(|at| at.phase_sd)))
        .with(Series::line("amplitude, gain and offset known", SeriesRole::Input, line(|at| at.amplitude_sd)))
        .with(Series::line(
            "amplitude, gain and offset free",
            SeriesRole::Model,
            line(|at| at.amplitude_sd_free),
        ))
}

/// Draws all pictures, one below the other, to an SVG file; see [`write_picture`](crate::results::write_picture).
pub fn draw_outlook(outlook: &Outlook, path: &Path, force: bool) -> Result<(), OutputError> {
    let panels = outlook_figures(outlook).into_iter().flat_map(|figure| figure.panels);
    let figure = panels.fold(Figure::new("outlook", outlook.experiment.clone(), ""), Figure::with);
    draw(figure, path, force)
}

/// What can be said of a device before a recording, as a page: its text, which needs nothing else.
pub fn outlook_page(outlook: &Outlook, experiment: &Experiment) -> Result<String, ReportError> {
    let subtitle = experiment.description.clone().unwrap_or_default();
    let mut page =
        Page::new(format!("{}: what can be said before a recording", outlook.experiment), subtitle);
    let answer = AnsweredOutlook::of(outlook).answer;
    if !answer.is_empty() {
        let section = PageSection::new("Answer").part(PagePart::Verdict);
        page = page.with(answer.into_iter().fold(section, PageSection::paragraph));
    }
    let figures = outlook_figures(outlook);
    if !figures.is_empty() {
        page = page.with(figures.into_iter().fold(PageSection::new("Pictures"), PageSection::figure));
    }
    for topic in &outlook.topics {
        let facts = topic.facts.iter().map(|fact| fact.text.clone()).collect();
        page = page.with(PageSection::new(with_capital(topic.title)).part(PagePart::Evidence).list(facts));
    }
    let toml = experiment.to_toml().unwrap_or_else(|e| format!("cannot be written: {e}"));
    let beside =
        "The text is in `outlook.txt`, the numbers are in `outlook.json`, dates and durations in `run.toml`.";
    let made = PageSection::made("inspect", env!("CARGO_PKG_VERSION"), beside);
    page.with(made.preformatted("The experiment as it was understood", toml)).to_html()
}

fn with_capital(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or_else(String::new, |first| first.to_uppercase().chain(letters).collect())
}

/// Writes what is said, its numbers and its pictures into a result: `report.html`, `outlook.txt`, `outlook.json`, `figures/`, `run.toml`.
pub fn write_outlook(
    outlook: &Outlook,
    experiment: &Experiment,
    output: &Output,
    info: RunInfo,
) -> Result<(), ResultWriteError> {
    let text = experiment.to_toml().map_err(|e| failed(output.target(), io::Error::other(e)))?;
    let mut digest = String::new();
    for byte in Sha256::digest(&text).iter().take(6) {
        let _ = write!(digest, "{byte:02x}");
    }
    let input_id = format!("{}: outlook {digest}", experiment.name);
    let answered = AnsweredOutlook::of(outlook);
    output.write("outlook.txt", |w| w.write_all(answered.to_text().as_bytes()))?;
    output.write("outlook.json", |w| {
        serde_json::to_writer_pretty(&mut *w, &answered)?;
        writeln!(w)
    })?;
    let html = outlook_page(outlook, experiment)?;
    output.write("report.html", |w| w.write_all(html.as_bytes()))?;
    for figure in outlook_figures(outlook) {
        write_figure(output, &figure)?;
    }
    Ok(output.write_run(&input_id, || {
        let experiment = experiment.to_table().map_err(io::Error::other)?;
        Ok(OutlookRecord { timing: info.timing(), experiment })
    })?)
}

#[derive(Serialize)]
struct OutlookRecord {
    timing: RunTiming,
    experiment: toml::Table,
}

fn failed(path: &Path, source: io::Error) -> OutputError {
    OutputError::Io { path: path.to_owned(), source }
}
