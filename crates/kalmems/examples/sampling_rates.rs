//! Makes the picture and the table of the book's chapter on steps: what one integration step from each sample to the next costs a filter, over the
//! samples in a cycle of the motion.
//!
//!     cargo run --release --example sampling_rates

use kalmems::config::Experiment;
use kalmems::figures::{Axis, Figure, Panel, Series, SeriesRole};
use kalmems::progress::Silent;
use kalmems::results::Metrics;
use kalmems::rigs::published;
use kalmems::simulate::{ComputedRecording, described};
use kalmems::workflow::estimate_computed;
use std::error::Error;
use std::fmt::Write as _;
use std::path::Path;
use toml::{Table, Value};

/// Samples in a cycle.
const PER_CYCLE: [u32; 8] = [10, 14, 20, 26, 32, 64, 128, 200];

/// Steps of the simulation in a cycle.
const FINE: u32 = 400;

/// A device of the examples, and what of its experiment is changed.
struct Case {
    name: &'static str,
    file: &'static str,
    /// A cycle of its motion, of a mass that is damped over the critical that of its spring alone.
    cycle_hz: f64,
    changed: &'static [(&'static str, &'static str)],
}

const CASES: [Case; 5] = [
    Case {
        name: "shared scanner",
        file: "shared_scanner/simulation.toml",
        cycle_hz: 15_675.0,
        changed: &[
            ("simulate.start", "{ angle = \"0.117 rad\", rate = \"12.8e3 rad/s\" }"),
            ("simulate.duration", "\"40 ms\""),
            ("estimate.skip", "\"15 ms\""),
            ("estimate.process_noise.angular_acceleration", "\"1e4 rad^2/s^3\""),
            ("filter.start", "{ angle = \"0.117 rad\", rate = \"12.8e3 rad/s\" }"),
            ("filter.start_sd", "{ angle = \"1e-3 rad\", rate = \"100 rad/s\" }"),
        ],
    },
    Case {
        name: "accelerometer",
        file: "accelerometer/simulation.toml",
        cycle_hz: 4472.0,
        changed: &[("simulate.duration", "\"0.2 s\"")],
    },
    Case {
        name: "comb resonator",
        file: "comb_resonator/simulation.toml",
        cycle_hz: 10e3,
        changed: &[("estimate.process_noise.v", "\"2e-9 m^2/s^3\"")],
    },
    Case {
        name: "thermal mirror",
        file: "thermal_mirror/experiment.toml",
        cycle_hz: 480.0,
        changed: &[(
            "simulate",
            "{ duration = \"1.5 s\", sampling_rate = \"1 Hz\", integration_rate = \"1 Hz\", seed = 1, start = {}, drive = { sine = \
             { offset = \"2.5 V\", amplitude = \"1.2 V\", frequency = \"10 Hz\" } } }",
        )],
    },
    Case {
        name: "vibrating gyroscope",
        file: "vibrating_gyroscope/experiment.toml",
        cycle_hz: 9995.0,
        changed: &[(
            "simulate",
            "{ duration = \"60 ms\", sampling_rate = \"1 Hz\", integration_rate = \"1 Hz\", seed = 1, start = { x = \"4 um\" }, drive = \
             { sine = { offset = \"0 V\", amplitude = \"0.8 V\", frequency = \"9995 Hz\" } } }",
        )],
    },
];

fn main() -> Result<(), Box<dyn Error>> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../book/src/figures");
    let mut panel = Panel::new(
        Axis::new("samples in a cycle", "").log(),
        Axis::new("error of single steps, in claimed sd", "").log(),
    );
    let mut table = String::from("| samples in a cycle |");
    let mut lines: Vec<String> = PER_CYCLE.iter().map(|n| format!("| {n} |")).collect();
    for case in &CASES {
        let _ = write!(table, " {} |", case.name);
        let mut points = Vec::new();
        for (per_cycle, line) in PER_CYCLE.into_iter().zip(&mut lines) {
            let error = case.error(f64::from(per_cycle))?;
            eprintln!("{}, {per_cycle} in a cycle: {error:?}", case.name);
            let _ = write!(line, " {} |", error.map_or_else(String::new, |error| format!("{error:.1e}")));
            points.extend(error.map(|error| (f64::from(per_cycle), error)));
        }
        panel = panel.with(Series::points(case.name, SeriesRole::Other, points.clone())).with(Series::line(
            "",
            SeriesRole::Other,
            points,
        ));
    }
    panel = panel.with(Series::level("a remark", SeriesRole::Bound, 0.05));
    let caption = "One step of the filter from each sample to the next; two are 16 times better.";
    let figure = Figure::new("sampling_rates", "What a sampling rate costs", caption).with(panel);
    std::fs::write(folder.join("sampling_rates.svg"), figure.to_svg())?;
    let _ = writeln!(table, "\n|---:|{}", "---:|".repeat(CASES.len()));
    table += &lines.join("\n");
    std::fs::write(folder.join("sampling_rates.md"), table + "\n")?;
    println!("written to {}", folder.display());
    Ok(())
}

impl Case {
    /// What the watch tells of a filter of one step, with so many samples in a cycle; nothing where its steps are exact, or the device is not simulated
    /// at that rate.
    fn error(&self, per_cycle: f64) -> Result<Option<f64>, Box<dyn Error>> {
        let experiment = self.experiment(per_cycle)?;
        let simulation = published().rig(&experiment)?.simulate(&experiment)?;
        let computed = ComputedRecording::of(simulation.as_ref(), &Silent)?;
        let told = described(&experiment, simulation.as_ref());
        let Ok(outcome) = estimate_computed(published(), &told, &computed, &Silent) else { return Ok(None) };
        let metrics = Metrics::of(&outcome);
        Ok(metrics.estimators().next().and_then(|one| Some(one.step_errors?.error)))
    }

    fn experiment(&self, per_cycle: f64) -> Result<Experiment, Box<dyn Error>> {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples").join(self.file);
        let mut document: Table = std::fs::read_to_string(&path)?.parse()?;
        document.remove("recording");
        document.remove("identify");
        let rate_hz = per_cycle * self.cycle_hz;
        let rate = |times: f64| format!("\"{:.6} Hz\"", rate_hz * times);
        let fine = (f64::from(FINE) / per_cycle).round();
        let stated = self.changed.iter().map(|(key, value)| (*key, (*value).to_owned()));
        let of_rate = [
            ("simulate.sampling_rate", rate(1.0)),
            ("simulate.integration_rate", rate(fine)),
            ("filter.steps", "1".to_owned()),
        ];
        let Some(Value::Array(filters)) =
            document.get_mut("estimate").and_then(|estimate| estimate.get_mut("filter"))
        else {
            return Err("no filter".into());
        };
        filters.truncate(1);
        for (key, value) in stated.chain(of_rate) {
            let parsed: Table = format!("x = {value}").parse()?;
            let Some(value) = parsed.get("x") else { continue };
            let (table, name) = key.rsplit_once('.').unwrap_or(("", key));
            let found = match table {
                "" => Some(&mut document),
                "filter" => document
                    .get_mut("estimate")
                    .and_then(|estimate| estimate.get_mut("filter")?.get_mut(0)?.as_table_mut()),
                dotted => dotted.split('.').try_fold(&mut document, |table, name| {
                    table.entry(name).or_insert_with(|| Value::Table(Table::new())).as_table_mut()
                }),
            };
            found.ok_or("no table")?.insert(name.to_owned(), value.clone());
        }
        Ok(published().parse(&toml::to_string(&document)?, &path)?)
    }
}
