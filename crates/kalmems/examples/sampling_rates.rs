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

/// Steps of the simulation in a cycle, and of one through contacts.
const FINE: u32 = 400;
const FINE_THROUGH_CONTACTS: u32 = 2000;

/// A ring whose two modes a turning rate couples, which is a state.
const RING: &str = r#"
name = "ring"
[device.equations]
states = { Omega = "rad/s", x = "m", vx = "m/s", y = "m", vy = "m/s" }
measure = { of_x = "gain*x in V", of_y = "gain*y in V" }
noise = { of_x = "4e-6[V^2]", of_y = "4e-6[V^2]", vx = "1e-10[m^2/s^3]", vy = "1e-10[m^2/s^3]", Omega = "216[rad^2/s^3]" }
parameters = { w = "47123.89 rad/s", Q = "2e5", split = "2e-5", kappa = "0.37", gain = "0.2 V/um" }
[device.equations.derivative]
Omega = "0"
x = "vx"
vx = "-w/Q*vx - w^2*(1 + split)*x + 4*kappa*Omega*vy"
y = "vy"
vy = "-w/Q*vy - w^2*(1 - split)*y - 4*kappa*Omega*vx"
[simulate]
duration = "0.2 s"
seed = 1
start = { Omega = "3 rad/s", x = "5 um", vx = "0 m/s", y = "0 m", vy = "0 m/s" }
drive = { prescribed = {} }
[estimate]
skip = "40 ms"
[[estimate.filter]]
name = "EKF"
method = "ekf"
start = { Omega = "3 rad/s", x = "5 um", vx = "0 m/s", y = "0 m", vy = "0 m/s" }
start_sd = { Omega = "1 rad/s", x = "10 nm", vx = "0.5 mm/s", y = "10 nm", vy = "0.5 mm/s" }
"#;

/// A switch whose plate snaps to its stop and bounces there.
const SWITCH: &str = r#"
name = "switch"
[device.equations]
states = { x = "m", v = "m/s" }
inputs = { drive = "V" }
interpolation = "hold"
let = { contact = "if(x > travel, 8000[N/m]*(x - travel), 0[N])" }
measure = { signal = "1[V/fF]*plate/(gap - x) in V" }
noise = { v = "1e-3[m^2/s^3]", signal = "0.09[V^2]" }
parameters = { w = "251327.412 rad/s", Q = "3", m = "2e-10 kg", gap = "2 um", travel = "1.2 um", plate = "1.7708e-19 F m" }
[device.equations.derivative]
x = "v"
v = "-w/Q*v - w^2*x + plate*drive^2/(2*m*(gap - x)^2) - contact/m"
[simulate]
duration = "2 ms"
seed = 1
start = { x = "0 m", v = "0 m/s" }
drive = { square = { low = "0 V", high = "22 V", frequency = "500 Hz", duty_cycle = "50 %" } }
[estimate]
skip = "20 us"
[[estimate.filter]]
name = "EKF"
method = "ekf"
start = { x = "0 m", v = "0 m/s" }
start_sd = { x = "1 nm", v = "1 mm/s" }
"#;

/// A stiffening resonator whose resonance is a state.
const STIFFENING: &str = r#"
name = "stiffening"
[device.equations]
states = { x = "m", v = "m/s", f0 = "Hz" }
inputs = { drive = "V" }
interpolation = "sine"
derivative = { x = "v", v = "force*drive - (2*pi*f0)^2*x - 2*pi*f0/50*v - cubic*x^3", f0 = "0" }
measure = { signal = "gain*x in V" }
noise = { signal = "4e-4[V^2]", v = "0.2[m^2/s^3]", f0 = "0.1[1/s^3]" }
parameters = { force = "1000 m/(s^2 V)", cubic = "7.895e20 1/(m^2 s^2)", gain = "1 V/um" }
[simulate]
duration = "50 ms"
seed = 1
start = { x = "1 um", v = "0 m/s", f0 = "20 kHz" }
drive = { sine = { offset = "0 V", amplitude = "0.3 V", frequency = "20.2 kHz" } }
[estimate]
skip = "10 ms"
[[estimate.filter]]
name = "EKF"
method = "ekf"
start = { x = "1 um", v = "0 m/s", f0 = "20 kHz" }
start_sd = { x = "0.1 um", v = "10 mm/s", f0 = "20 Hz" }
"#;

/// Where the experiment of a device stands.
enum CaseSource {
    /// In a file of the examples.
    Example(&'static str),
    Text(&'static str),
}

/// A device, and what of its experiment is changed.
struct Case {
    name: &'static str,
    source: CaseSource,
    /// A cycle of its motion, of a mass that is damped over the critical that of its spring alone.
    cycle_hz: f64,
    fine: u32,
    changed: &'static [(&'static str, &'static str)],
}

const CASES: [Case; 8] = [
    Case {
        name: "shared scanner",
        source: CaseSource::Example("shared_scanner/simulation.toml"),
        cycle_hz: 15_675.0,
        fine: FINE,
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
        source: CaseSource::Example("accelerometer/simulation.toml"),
        cycle_hz: 4472.0,
        fine: FINE,
        changed: &[("simulate.duration", "\"0.2 s\"")],
    },
    Case {
        name: "comb resonator",
        source: CaseSource::Example("comb_resonator/simulation.toml"),
        cycle_hz: 10e3,
        fine: FINE,
        changed: &[("estimate.process_noise.v", "\"2e-9 m^2/s^3\"")],
    },
    Case {
        name: "thermal mirror",
        source: CaseSource::Example("thermal_mirror/experiment.toml"),
        cycle_hz: 480.0,
        fine: FINE,
        changed: &[(
            "simulate",
            "{ duration = \"1.5 s\", sampling_rate = \"1 Hz\", integration_rate = \"1 Hz\", seed = 1, start = {}, drive = { sine = \
             { offset = \"2.5 V\", amplitude = \"1.2 V\", frequency = \"10 Hz\" } } }",
        )],
    },
    Case {
        name: "vibrating gyroscope",
        source: CaseSource::Example("vibrating_gyroscope/experiment.toml"),
        cycle_hz: 9995.0,
        fine: FINE,
        changed: &[(
            "simulate",
            "{ duration = \"60 ms\", sampling_rate = \"1 Hz\", integration_rate = \"1 Hz\", seed = 1, start = { x = \"4 um\" }, drive = \
             { sine = { offset = \"0 V\", amplitude = \"0.8 V\", frequency = \"9995 Hz\" } } }",
        )],
    },
    Case {
        name: "ring gyroscope",
        source: CaseSource::Text(RING),
        cycle_hz: 7500.0,
        fine: FINE,
        changed: &[],
    },
    Case {
        name: "contact switch",
        source: CaseSource::Text(SWITCH),
        cycle_hz: 40e3,
        fine: FINE_THROUGH_CONTACTS,
        changed: &[],
    },
    Case {
        name: "stiffening resonator, resonance a state",
        source: CaseSource::Text(STIFFENING),
        cycle_hz: 20e3,
        fine: FINE,
        changed: &[],
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
    let caption = "One step of the filter from each sample to the next, through contacts up to 64; twice as many are 16 times better.";
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
        let examples = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples");
        let (path, text) = match self.source {
            CaseSource::Example(file) => (examples.join(file), std::fs::read_to_string(examples.join(file))?),
            CaseSource::Text(text) => (examples.join("experiment.toml"), text.to_owned()),
        };
        let mut document: Table = text.parse()?;
        document.remove("recording");
        document.remove("identify");
        let rate_hz = per_cycle * self.cycle_hz;
        let rate = |times: f64| format!("\"{:.6} Hz\"", rate_hz * times);
        let fine = (f64::from(self.fine) / per_cycle).round();
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
