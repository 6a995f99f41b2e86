//! Devices that come from elsewhere: a rig that is registered, and the table that it reads.

use kalmems_engines::config::kinds::{Frequency, Ratio};
use kalmems_engines::config::{
    ConfigError, ConfigFault, DeviceDescription, DeviceKind, Experiment, Key, NotNegative, Positive, Quantity,
};
use kalmems_engines::estimate::EstimateError;
use kalmems_engines::outlook::Outlook;
use kalmems_engines::progress::Progress;
use kalmems_engines::recording::RecordingLayout;
use kalmems_engines::rig::{Estimator, Rig, Workbench};
use kalmems_engines::simulate::{SimulateError, Simulation};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// A fork that swings.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Fork {
    /// The frequency of its tines.
    frequency: Quantity<Frequency, Positive>,
    /// Their damping over the critical one.
    #[serde(default = "none")]
    damping_ratio: Quantity<Ratio, NotNegative>,
}

fn none() -> Quantity<Ratio, NotNegative> {
    Quantity::parse("0").unwrap()
}

impl DeviceDescription for Fork {
    const NAME: &'static str = "fork";
    const SUMMARY: &'static str = "A fork that swings.";

    fn check(&self) -> Result<(), (Key, String)> {
        if self.damping_ratio.si() < 1.0 {
            return Ok(());
        }
        Err((Key::from("device.fork.damping_ratio"), "so much damped, it does not swing".to_owned()))
    }
}

/// A rig for forks that are slower, or not slower, than 1 kHz.
struct ForkRig {
    slow: bool,
}

impl ForkRig {
    fn refused(experiment: &Experiment) -> ConfigError {
        experiment
            .error("device", ConfigFault::Value { why: "nothing but its table is read here".to_owned() })
    }
}

impl Rig for ForkRig {
    fn name(&self) -> &'static str {
        if self.slow { "slow_fork" } else { "fast_fork" }
    }

    fn device(&self) -> DeviceKind {
        DeviceKind::of::<Fork>()
    }

    fn claims(&self, experiment: &Experiment) -> Result<bool, ConfigError> {
        Ok((experiment.device::<Fork>()?.frequency.si() < 1e3) == self.slow)
    }

    fn wanted(&self, experiment: &Experiment) -> Result<Vec<usize>, ConfigError> {
        Err(Self::refused(experiment))
    }

    fn layout(&self, experiment: &Experiment, _: usize) -> Result<RecordingLayout, ConfigError> {
        Err(Self::refused(experiment))
    }

    fn estimator<'a>(
        &self,
        experiment: &'a Experiment,
        _: usize,
        _: &'a dyn Progress,
    ) -> Result<Box<dyn Estimator + 'a>, EstimateError> {
        Err(Self::refused(experiment).into())
    }

    fn outlook(&self, experiment: &Experiment) -> Result<Outlook, SimulateError> {
        Err(Self::refused(experiment).into())
    }

    fn simulate(&self, experiment: &Experiment) -> Result<Box<dyn Simulation>, SimulateError> {
        Err(Self::refused(experiment).into())
    }
}

const REST: &str = "\n[[recording]]\nrole = \"test\"\nfile = \"a.csv\"\nclock = { column = \"time_s\" }\nchannels = { signal = \"x_V\" }\n";

fn workbench() -> Workbench {
    Workbench::new().with(ForkRig { slow: true }).with(ForkRig { slow: false })
}

/// An experiment with this device table, from the third line of its file on.
fn parse(device: &str) -> Result<Experiment, ConfigError> {
    workbench().parse(&format!("name = \"a\"\n\n{device}{REST}"), Path::new("lab/fork.toml"))
}

fn message(device: &str) -> String {
    parse(device).unwrap_err().to_string()
}

#[test]
fn the_table_of_a_registered_device_is_read_with_its_units_and_its_rig_found() {
    for (frequency, rig) in [("440 Hz", "slow_fork"), ("32.768 kHz", "fast_fork")] {
        let experiment = parse(&format!("[device.fork]\nfrequency = \"{frequency}\"\n")).unwrap();
        assert_eq!(experiment.device_name(), "fork");
        assert_eq!(experiment.device::<Fork>().unwrap().frequency.text(), frequency);
        assert_eq!(workbench().rig(&experiment).unwrap().name(), rig);
    }
}

#[test]
fn faults_of_the_table_name_line_and_key_and_say_what_to_write() {
    insta::assert_snapshot!(message("[device.fork]\nfrequenzy = \"1 kHz\"\n"), @"lab/fork.toml:4: device.fork.frequenzy: unknown key `frequenzy`; did you mean `frequency`? known keys: frequency, damping_ratio");
    insta::assert_snapshot!(message("[device.fork]\nfrequency = \"1 km\"\n"), @"lab/fork.toml:4: device.fork.frequency: `1 km` has the dimension m; expected a frequency (1/s), such as `15.5 kHz`");
    insta::assert_snapshot!(message("[device.fork]\ndamping_ratio = \"1 %\"\n"), @r#"lab/fork.toml:3: device.fork.frequency: the key is missing; write `frequency = "15.5 kHz"`"#);
    insta::assert_snapshot!(message("[device.fork]\nfrequency = \"1 kHz\"\ndamping_ratio = \"2\"\n"), @"lab/fork.toml:5: device.fork.damping_ratio: so much damped, it does not swing");
}

#[test]
fn a_device_that_no_rig_reads_is_refused_with_those_that_there_are() {
    insta::assert_snapshot!(message("[device.forc]\nfrequency = \"1 kHz\"\n"), @"lab/fork.toml:3: device.forc: unknown key `forc`; did you mean `fork`? known keys: fork");
    insta::assert_snapshot!(message("device = \"fork\"\n"), @"lab/fork.toml:3: device: found the text `fork`; expected a table, not its name alone; add one of the tables `[device.fork]`");
    insta::assert_snapshot!(message(""), @"lab/fork.toml: device: the key is missing; add one of the tables `[device.fork]`");
    insta::assert_snapshot!(message("[device.fork]\nfrequency = \"1 kHz\"\n[device.spoon]\n"), @"lab/fork.toml:3: device: found 2 (fork, spoon); expected exactly one of: fork");
    // Without a workbench it stays as it is written.
    let text = format!("name = \"a\"\n[device.spoon]\nlength = 3\n{REST}");
    let experiment = Experiment::parse(&text, Path::new("spoon.toml")).unwrap();
    assert_eq!(experiment.device_name(), "spoon");
    assert!(experiment.to_toml().unwrap().contains("[device.spoon]\nlength = 3\n"));
}

#[test]
fn a_device_that_is_replaced_is_written_out_and_read_again() {
    let mut experiment = parse("[device.fork]\nfrequency = \"440 Hz\"\n").unwrap();
    // Defaults are written out.
    assert!(
        experiment
            .to_toml()
            .unwrap()
            .contains("[device.fork]\nfrequency = \"440 Hz\"\ndamping_ratio = \"0\"\n")
    );
    let fork = Fork { frequency: Quantity::parse("442 Hz").unwrap(), damping_ratio: none() };
    experiment.set_device(fork.clone());
    assert_eq!(*experiment.device::<Fork>().unwrap(), fork);
    let again = workbench().parse(&experiment.to_toml().unwrap(), Path::new("again.toml")).unwrap();
    assert_eq!(again, experiment);
    assert_eq!(again.device::<Fork>().unwrap().frequency.si(), 442.0);
}

#[test]
fn the_schema_knows_the_registered_devices_and_no_others() {
    let schema = workbench().schema();
    let kinds = schema["properties"]["device"]["oneOf"].as_array().unwrap();
    assert_eq!(kinds.len(), 1, "{kinds:?}");
    assert!(kinds[0]["properties"]["fork"].is_object());
    assert!(schema["$defs"]["Fork"]["properties"]["frequency"].is_object(), "{schema:#}");
}
