//! The published devices, simulated, with filters that are told what is true.

use kalmems::config::Experiment;
use kalmems::progress::Silent;
use kalmems::results::{Metrics, number_check_of};
use kalmems::rigs::published;
use kalmems::simulate::{ComputedRecording, described};
use kalmems::workflow::estimate_computed;
use std::path::{Path, PathBuf};
use toml::{Table, Value};

/// A setting that differs from the example: the key, with dots, and its value as it stands in a file.
pub type Setting<'a> = (&'a str, String);

/// An example that simulates its device, and what of it is changed.
pub struct Device {
    pub name: &'static str,
    file: &'static str,
    changed: &'static [(&'static str, &'static str)],
    /// Tables that go.
    without: &'static [&'static str],
}

/// The scanner on its way, from which a filter has not to find its way first.
const SCANNER: &[(&str, &str)] = &[
    ("simulate.start", "{ angle = \"0.117 rad\", rate = \"12.8e3 rad/s\" }"),
    ("simulate.duration", "\"16 ms\""),
    ("estimate.skip", "\"8 ms\""),
    ("estimate.filter.0.start", "\"from_signal\""),
    ("estimate.filter.0.start_sd", "{ angle = \"0.15 rad\", rate = \"15e3 rad/s\" }"),
];

pub const DEVICES: [Device; 6] = [
    Device { name: "shared scanner", file: "shared_scanner/simulation.toml", changed: SCANNER, without: &[] },
    Device {
        name: "two axes",
        file: "shared_scanner/two_axes.toml",
        changed: &[("simulate.duration", "\"20 ms\"")],
        without: &["estimate.filter.1"],
    },
    Device {
        name: "threshold scanner",
        file: "threshold_scanner/simulation.toml",
        changed: &[("simulate.duration", "\"40 ms\"")],
        without: &["estimate.filter.0.states"],
    },
    Device { name: "accelerometer", file: "accelerometer/simulation.toml", changed: &[], without: &[] },
    Device {
        name: "micro-stage",
        file: "micro_stage/simulation.toml",
        changed: &[("simulate.duration", "\"12 ms\"")],
        without: &["simulate.stage", "device.micro_stage.piston"],
    },
    Device {
        name: "piston mirror",
        file: "piston_mirror/simulation.toml",
        changed: &[("simulate.duration", "\"0.6 s\"")],
        without: &[],
    },
];

/// A table, or a list by a number, below another.
fn below<'a>(value: &'a mut Value, key: &str) -> &'a mut Value {
    match value {
        Value::Array(list) => &mut list[key.parse::<usize>().unwrap()],
        Value::Table(table) => table.entry(key).or_insert_with(|| Value::Table(Table::new())),
        other => panic!("{key} below {other}"),
    }
}

/// Puts a value in its place, or takes what is there away.
pub fn put(document: &mut Value, key: &str, value: Option<&str>) {
    let (path, last) = key.rsplit_once('.').unwrap_or(("", key));
    let place = path.split('.').filter(|part| !part.is_empty()).fold(document, below);
    match (place, value) {
        (Value::Array(list), None) => drop(list.remove(last.parse().unwrap())),
        (Value::Table(table), None) => drop(table.remove(last)),
        (place, Some(text)) => {
            let parsed: Table =
                format!("x = {text}").parse().unwrap_or_else(|e| panic!("{key} = {text}: {e}"));
            *below(place, last) = parsed["x"].clone();
        }
        (place, None) => panic!("{key} in {place}"),
    }
}

impl Device {
    pub fn named(name: &str) -> &'static Self {
        DEVICES.iter().find(|device| device.name == name).unwrap()
    }

    /// The example's file.
    fn path(&self) -> PathBuf {
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples").join(self.file)
    }

    /// The text of an experiment with these settings.
    pub fn text(&self, settings: &[Setting]) -> String {
        self.text_without(settings, &[])
    }

    /// The same without what stands at these keys.
    fn text_without(&self, settings: &[Setting], without: &[&str]) -> String {
        let text = std::fs::read_to_string(self.path()).unwrap();
        let mut document = Value::Table(text.parse().unwrap());
        for key in self.without {
            put(&mut document, key, None);
        }
        for (key, value) in self.changed {
            put(&mut document, key, Some(value));
        }
        for (key, value) in settings {
            put(&mut document, key, Some(value));
        }
        for key in without {
            put(&mut document, key, None);
        }
        toml::to_string(&document).unwrap()
    }

    /// The experiment with these settings, and the noise of this seed.
    fn experiment(&self, settings: &[Setting], seed: u64) -> Experiment {
        let mut settings = settings.to_vec();
        settings.push(("simulate.seed", seed.to_string()));
        let text = self.text(&settings);
        published().parse(&text, &self.path()).unwrap_or_else(|e| panic!("{}: {e}", self.name))
    }

    /// What filters that are `told` different things are told of a recording of what is `true`, which both are where neither differs from
    /// the example, and that recording.
    pub fn recorded_by<const N: usize>(
        &self,
        real: &[Setting],
        told: [&[Setting]; N],
        seed: u64,
    ) -> ([Experiment; N], ComputedRecording) {
        let real = self.experiment(real, seed);
        let simulation =
            published().rig(&real).unwrap().simulate(&real).unwrap_or_else(|e| panic!("{}: {e}", self.name));
        let simulated = ComputedRecording::of(&*simulation, &Silent).unwrap();
        (told.map(|told| described(&self.experiment(told, seed), &*simulation)), simulated)
    }

    /// A recording of a device with these settings and without what stands at these keys, and the experiment of its filters.
    pub fn recorded_without(
        &self,
        settings: &[Setting],
        without: &[&str],
        seed: u64,
    ) -> (Experiment, ComputedRecording) {
        let mut settings = settings.to_vec();
        settings.push(("simulate.seed", seed.to_string()));
        let text = self.text_without(&settings, without);
        let experiment =
            published().parse(&text, &self.path()).unwrap_or_else(|e| panic!("{}: {e}", self.name));
        let simulation = published().rig(&experiment).unwrap().simulate(&experiment).unwrap();
        let simulated = ComputedRecording::of(&*simulation, &Silent).unwrap();
        (described(&experiment, &*simulation), simulated)
    }

    /// The same of filters that are told one thing.
    pub fn recorded(&self, real: &[Setting], told: &[Setting], seed: u64) -> (Experiment, ComputedRecording) {
        let ([told], simulated) = self.recorded_by(real, [told], seed);
        (told, simulated)
    }

    /// What those filters make of it, with all that their verdict rests on; `None` where the recording is refused.
    pub fn judged(&self, real: &[Setting], told: &[Setting], seed: u64) -> Option<Metrics> {
        let (told, simulated) = self.recorded(real, told, seed);
        let outcome = estimate_computed(published(), &told, &simulated, &Silent).ok()?;
        let metrics = Metrics::of(&outcome);
        let numbers = number_check_of(published(), (&outcome, &metrics), &Silent).unwrap();
        Some(metrics.with_numbers(numbers))
    }

    /// The figures of several filters that are told different things, on one recording; without a check of their numbers.
    pub fn estimated_by<const N: usize>(
        &self,
        real: &[Setting],
        told: [&[Setting]; N],
        seed: u64,
    ) -> [Option<Metrics>; N] {
        let (told, simulated) = self.recorded_by(real, told, seed);
        told.map(|told| {
            estimate_computed(published(), &told, &simulated, &Silent)
                .ok()
                .map(|outcome| Metrics::of(&outcome))
        })
    }
}
