//! The files of a regulated run.

use super::report::{RegulationReport, RegulationWindow};
use crate::simulate::{RunFile, SimulationFiles};
use kalmems_figures::{Axis, Figure, Panel, Series, SeriesRole};
use std::fmt::Write as _;

/// What is written beside recording and truth, and what is said.
pub fn of(report: &RegulationReport) -> SimulationFiles {
    let json = serde_json::to_string_pretty(report).unwrap_or_default() + "\n";
    let mut files = vec![
        RunFile { name: "regulation.csv", content: windows(report).into_bytes() },
        RunFile { name: "regulation.json", content: json.into_bytes() },
    ];
    if report.trigger.is_some() {
        files.push(RunFile { name: "trigger.csv", content: events(report).into_bytes() });
    }
    SimulationFiles { files, figures: vec![figure(report)], lines: lines(report) }
}

fn windows(report: &RegulationReport) -> String {
    let mut text = String::from(
        "time_s,amplitude_rad,phase_rad,estimated_amplitude_rad,estimated_phase_rad,drive_Hz,voltage_V,temperature_K,\
         stiffness_1,damping_1,gain_1,offset_V,estimated_stiffness_1,estimated_damping_1,estimated_gain_1,\
         estimated_offset_V\n",
    );
    for window in &report.windows {
        let RegulationWindow { time_s, amplitude, phase, estimated_amplitude, estimated_phase, .. } = window;
        let RegulationWindow { drive_hz, voltage, temperature_k, .. } = window;
        let _ = write!(text, "{time_s},{amplitude},{phase},{estimated_amplitude},{estimated_phase}");
        let _ = write!(text, ",{drive_hz},{voltage},{temperature_k}");
        for value in window.true_parameters.iter().chain(&window.estimated_parameters) {
            if value.is_finite() {
                let _ = write!(text, ",{value}");
            } else {
                text.push(',');
            }
        }
        text.push('\n');
    }
    text
}

fn events(report: &RegulationReport) -> String {
    let mut text = String::from("told_s,after_s,sd_s,error_s\n");
    for event in &report.events {
        let _ = writeln!(text, "{},{},{},{}", event.told_s, event.after_s, event.sd_s, event.error_s);
    }
    text
}

fn lines(report: &RegulationReport) -> Vec<String> {
    let mut lines = Vec::new();
    match (report.regulated_from_s, &report.worst) {
        (Some(from_s), Some(worst)) => lines.push(format!(
            "regulated from {:.1} ms on; from there the true amplitude is off by {:.3} % at most ({:.3} % rms), the true phase \
             by {:.3} deg ({:.3} deg rms)",
            1e3 * from_s,
            100.0 * worst.amplitude,
            100.0 * worst.amplitude_rms,
            worst.phase.to_degrees(),
            worst.phase_rms.to_degrees()
        )),
        _ => lines.push("the motion was never regulated".to_owned()),
    }
    if let Some(from_s) = report.held_from_s {
        lines.push(format!("frequency and voltage are held from {:.1} ms on", 1e3 * from_s));
    }
    if report.sweeps_again + report.losses > 0 {
        lines.push(format!(
            "{} sweeps began again; the filter lost the motion {} times",
            report.sweeps_again, report.losses
        ));
    }
    if let Some(trigger) = &report.trigger {
        lines.push(format!(
            "{} trigger events: {:.2} ns rms off, mean {:.2} ns, (error/sd)^2 {:.2} on average; {} marks untold",
            trigger.events,
            1e9 * trigger.rms_s,
            1e9 * trigger.mean_s,
            trigger.nees,
            report.marks_missed
        ));
    }
    lines
}

/// Amplitude, phase and commands over time.
pub fn figure(report: &RegulationReport) -> Figure {
    let of = |value: &dyn Fn(&RegulationWindow) -> f64| -> Vec<(f64, f64)> {
        report.windows.iter().map(|window| (window.time_s, value(window))).collect()
    };
    let degrees = |value: &dyn Fn(&RegulationWindow) -> f64| of(&|window| value(window).to_degrees());
    let time = || Axis::new("time", "s");
    let panel = |label: &str, unit: &str| Panel::new(time(), Axis::new(label, unit));
    Figure::new("regulation", "", "")
        .with(
            panel("amplitude", "deg")
                .with(Series::line("true", SeriesRole::Reference, degrees(&|w| w.amplitude)))
                .with(Series::line("as regulated", SeriesRole::Estimate, degrees(&|w| w.estimated_amplitude)))
                .with(Series::level("wanted", SeriesRole::Bound, report.wanted_amplitude.to_degrees())),
        )
        .with(
            panel("phase", "deg")
                .sharing_x()
                .with(Series::line("", SeriesRole::Reference, degrees(&|w| w.phase)))
                .with(Series::line("", SeriesRole::Estimate, degrees(&|w| w.estimated_phase)))
                .with(Series::level("", SeriesRole::Bound, report.wanted_phase.to_degrees())),
        )
        .with(panel("drive", "Hz").sharing_x().with(Series::line("", SeriesRole::Input, of(&|w| w.drive_hz))))
        .with(panel("voltage", "V").sharing_x().with(Series::line("", SeriesRole::Input, of(&|w| w.voltage))))
        .with(panel("temperature", "K").sharing_x().with(Series::line(
            "",
            SeriesRole::Other,
            of(&|w| w.temperature_k),
        )))
}
