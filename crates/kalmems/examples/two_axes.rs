//! Makes the picture and the tables of the book's chapter on two axes again.
//!
//!     cargo run --release --example two_axes

use kalmems::figures::{Axis, Figure, Panel, Series, SeriesRole};
use kalmems::progress::Silent;
use kalmems::results::{Metrics, Output, RunInfo, Work, summary_table, write_simulation};
use kalmems::rigs::published;
use kalmems::rigs::shared_scanner::two_axes::{BandPlan, PlannedDrive, TwoAxisHardware};
use kalmems::signal::fit_sine_at;
use kalmems::workflow;
use std::error::Error;
use std::f64::consts::TAU;
use std::ops::ControlFlow;
use std::path::Path;
use std::time::{Duration, SystemTime};

fn main() -> Result<(), Box<dyn Error>> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let folder = root.join("book/src/figures");
    let experiment = published().load(&root.join("examples/shared_scanner/two_axes.toml"))?;
    let hardware = TwoAxisHardware::of(&experiment)?;
    let rig = published().rig(&experiment)?;
    let simulation = rig.simulate(&experiment)?;

    let (mut time, mut signal) = (Vec::new(), Vec::new());
    simulation.run(&mut |sample| {
        time.push(sample.time_s);
        signal.extend(sample.recorded.get(1));
        ControlFlow::Continue(())
    })?;
    let drive = PlannedDrive { offset: 90.0, amplitude: [90.0, 70.0], frequency_hz: [31_350.0, 13_080.0] };
    let plan = BandPlan::of(&hardware.scanner, &drive, BandPlan::GUARD_HZ);
    let figure = lines(&plan, &time[10_000..], &signal[10_000..]);
    std::fs::write(folder.join("two_axes_lines.svg"), figure.to_svg())?;
    std::fs::write(folder.join("two_axes_plan.txt"), format!("{plan}\n"))?;

    let staged = tempfile::tempdir()?;
    let simulated = staged.path().join("simulated");
    let info = || RunInfo { started: SystemTime::UNIX_EPOCH, took: Duration::ZERO };
    let output =
        Output::begin(&simulated, &Work::of_file("simulate", experiment.path(), experiment.files()))?;
    write_simulation(&experiment, rig, simulation.as_ref(), &output, info, &Silent)?;
    output.commit()?;
    let outcome =
        workflow::estimate(published(), &published().load(&simulated.join("experiment.toml"))?, &Silent)?;
    let table = summary_table(&Metrics::of(&outcome), false).to_text();
    std::fs::write(folder.join("two_axes_errors.txt"), table.as_bytes())?;
    if let Some(path) = std::env::args().nth(1) {
        std::fs::write(path, figure.to_svg())?;
    }
    println!("{plan}\n{table}");
    Ok(())
}

/// The lines of V² as planned, and the spectrum of the simulated signal.
fn lines(plan: &BandPlan, time_s: &[f64], signal: &[f64]) -> Figure {
    let resonances = |axis: usize| {
        (1..=4_u8)
            .map(move |order| (2.0 * plan.resonance_hz[axis] / f64::from(order), 30.0))
            .collect::<Vec<_>>()
    };
    let frequency = || Axis::new("frequency", "Hz").between(0.0, 70e3);
    let mut square = Panel::new(frequency(), Axis::new("lines of V²", "V²").log());
    let in_square = plan.lines.iter().filter_map(|line| Some((line.frequency_hz, line.square_volts?)));
    for (k, (hz, height)) in in_square.enumerate() {
        // One entry of the legend for all of them.
        let label = if k == 0 { "lines of V²" } else { "" };
        square = square.with(Series::line(label, SeriesRole::Input, [(hz, 1.0), (hz, height)]));
    }
    let square = square
        .with(Series::points("2·f/n of x", SeriesRole::Reference, resonances(0)))
        .with(Series::points("2·f/n of y", SeriesRole::Model, resonances(1)));
    // Hann's window, so that a line stays where it is.
    let mean = signal.iter().sum::<f64>() / signal.len() as f64;
    let windowed: Vec<f64> = (signal.iter().enumerate())
        .map(|(i, y)| (y - mean) * (1.0 - (TAU * i as f64 / signal.len() as f64).cos()))
        .collect();
    let spectrum = (2..=1400_u16).map(|k| {
        let hz = 50.0 * f64::from(k);
        (hz, fit_sine_at(time_s, &windowed, hz).map_or(f64::NAN, |sine| sine.amplitude))
    });
    let signal = Panel::new(frequency(), Axis::new("signal", "V").log())
        .with(Series::line(
            "amplitude in the simulated signal",
            SeriesRole::Input,
            spectrum.collect::<Vec<_>>(),
        ))
        .sharing_x();
    let caption = "Top: the lines of the squared voltage, which modulate the stiffness of both axes, and the \
                   parametric resonances that they must keep away from. Bottom: the amplitude of each frequency in \
                   the simulated signal.";
    Figure::new("two_axes_lines", "Two drives on one electrode", caption).with(square).with(signal)
}
