//! Makes the pictures and the table of the book's chapter on regulation again.
//!
//!     cargo run --release --example regulation

use kalmems::figures::{Axis, Figure, Panel, Series, SeriesRole};
use kalmems::rigs::published;
use kalmems::rigs::shared_scanner::regulation::{RegulatedSimulation, RegulationReport, RegulationWindow};
use std::error::Error;
use std::fmt::Write as _;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

/// Seeds of the table, for each direction of the temperature.
const SEEDS: u32 = 8;

fn main() -> Result<(), Box<dyn Error>> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let folder = root.join("book/src/figures");
    let path = root.join("examples/shared_scanner/regulate.toml");
    let text = std::fs::read_to_string(&path)?;

    let mut design = String::new();
    let mut table = String::from(
        "| change | seed | amplitude, largest | rms | phase, largest | rms | trigger, rms | mean | (error/σ)² |\n\
         |---:|---:|---:|---:|---:|---:|---:|---:|---:|\n",
    );
    let mut cooled = None;
    for change in ["-20 K", "20 K"] {
        for seed in 1..=SEEDS {
            let changed = text.replacen("seed = 1", &format!("seed = {seed}"), 1).replacen(
                "\"-20 K\"",
                &format!("\"{change}\""),
                1,
            );
            let (simulation, report) = run(&changed, &path)?;
            let (Some(worst), Some(trigger)) = (report.worst, report.trigger) else {
                return Err("a motion was not regulated".into());
            };
            let _ = writeln!(
                table,
                "| {change} | {seed} | {:.3} % | {:.3} % | {:.3}° | {:.3}° | {:.1} ns | {:.1} ns | {:.2} |",
                100.0 * worst.amplitude,
                100.0 * worst.amplitude_rms,
                worst.phase.to_degrees(),
                worst.phase_rms.to_degrees(),
                1e9 * trigger.rms_s,
                1e9 * trigger.mean_s,
                trigger.nees
            );
            if cooled.is_none() {
                design = simulation.regulation().to_string() + "\n";
                cooled = Some(report);
            }
        }
    }
    let cooled = cooled.ok_or("no run")?;
    let mut held = Vec::new();
    for (change, name) in [("-20 K", "held, -20 K"), ("-30 K", "held, -30 K"), ("20 K", "held, +20 K")] {
        let changed =
            text.replacen("# hold_from", "hold_from", 1).replacen("\"-20 K\"", &format!("\"{change}\""), 1);
        held.push((name, run(&changed, &path)?.1));
    }
    std::fs::write(folder.join("regulation_design.txt"), design)?;
    std::fs::write(folder.join("regulation_seeds.md"), table)?;
    for figure in [with_and_without(&cooled, &held), commands(&cooled)] {
        std::fs::write(folder.join(format!("{}.svg", figure.id)), figure.to_svg())?;
        if let Some(pictures) = std::env::args_os().nth(1).map(PathBuf::from) {
            std::fs::write(pictures.join(format!("{}.svg", figure.id)), figure.to_svg())?;
        }
    }
    println!("written to {}", folder.display());
    Ok(())
}

fn run(text: &str, path: &Path) -> Result<(RegulatedSimulation, RegulationReport), Box<dyn Error>> {
    let simulation = RegulatedSimulation::of(&published().parse(text, path)?)?;
    let report = simulation.regulate(&mut |_| ControlFlow::Continue(()))?;
    Ok((simulation, report))
}

/// A value of each window.
fn over(report: &RegulationReport, value: impl Fn(&RegulationWindow) -> f64) -> Vec<(f64, f64)> {
    report.windows.iter().map(|window| (window.time_s, value(window))).collect()
}

fn panel(label: &str, unit: &str) -> Panel {
    Panel::new(Axis::new("time", "s"), Axis::new(label, unit))
}

/// The true motion from rest over the ramp, regulated and with held commands.
fn with_and_without(cooled: &RegulationReport, held: &[(&str, RegulationReport)]) -> Figure {
    let amplitude = |report| over(report, |window| window.amplitude.to_degrees());
    // At rest, before the start and after a drop, there is no phase.
    let phase = |report: &RegulationReport| {
        let moving = report.windows.iter().filter(|window| window.amplitude > 0.02);
        moving.map(|window| (window.time_s, window.phase.to_degrees())).collect::<Vec<_>>()
    };
    let regulated = "regulated, -20 K";
    let mut first =
        panel("true amplitude", "deg").with(Series::line(regulated, SeriesRole::Estimate, amplitude(cooled)));
    let mut second = panel("true phase", "deg").sharing_x().with(Series::line(
        regulated,
        SeriesRole::Estimate,
        phase(cooled),
    ));
    for (name, report) in held {
        first = first.with(Series::line(*name, SeriesRole::Other, amplitude(report)));
        second = second.with(Series::line(*name, SeriesRole::Other, phase(report)));
    }
    Figure::new("regulation_held", "", "").with(first).with(second)
}

/// Errors and commands of the regulated run, and how the filter follows the gain.
fn commands(cooled: &RegulationReport) -> Figure {
    let from_s = cooled.regulated_from_s.unwrap_or(0.0);
    let mut regulated = cooled.clone();
    regulated.windows.retain(|window| window.time_s > from_s);
    let of = |value: &dyn Fn(&RegulationWindow) -> f64| over(&regulated, value);
    let level = |value| Series::level("", SeriesRole::Bound, value);
    Figure::new("regulation_commands", "", "")
        .with(
            panel("amplitude error", "%")
                .with(Series::line(
                    "true motion",
                    SeriesRole::Reference,
                    of(&|w| 100.0 * (w.amplitude / cooled.wanted_amplitude - 1.0)),
                ))
                .with(Series::level("wanted bounds", SeriesRole::Bound, 0.5))
                .with(level(-0.5)),
        )
        .with(
            panel("phase error", "deg")
                .sharing_x()
                .with(Series::line(
                    "",
                    SeriesRole::Reference,
                    of(&|w| (w.phase - cooled.wanted_phase).to_degrees()),
                ))
                .with(level(0.1))
                .with(level(-0.1)),
        )
        .with(panel("drive", "Hz").sharing_x().with(Series::line("", SeriesRole::Input, of(&|w| w.drive_hz))))
        .with(panel("voltage", "V").sharing_x().with(Series::line("", SeriesRole::Input, of(&|w| w.voltage))))
        .with(
            panel("gain", "%")
                .sharing_x()
                .with(Series::line("", SeriesRole::Reference, of(&|w| 100.0 * w.true_parameters[2])))
                .with(Series::line(
                    "filter",
                    SeriesRole::Estimate,
                    of(&|w| 100.0 * w.estimated_parameters[2]),
                )),
        )
}
