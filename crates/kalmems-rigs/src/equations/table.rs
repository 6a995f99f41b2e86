//! What an operator writes of a device of their own: the table `[device.equations]`.

use super::correction::CorrectionTable;
use super::curve::CurveTable;
use super::feedthrough::FeedthroughTable;
use super::instrument::InstrumentTable;
use super::interpolation::Interpolations;
use super::number::NumberText;
use super::ordered::{OfElement, Ordered};
use super::oscillation::OscillationTable;
use super::range::RangeTable;
use super::sine::SineTable;
use super::threshold::PassedThreshold;
use crate::config::kinds::Frequency;
use crate::config::{ConfigError, ConfigFault, DeviceDescription, Experiment, Key, Positive, Quantity};
use kalmems_equations::{
    CurvePoints, Description, Device, EquationError, Follower, NamedText, ResetText, TextPlace,
    VectorElement, vector_elements,
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::sync::{Arc, OnceLock};

/// A device as differential equations with units.
///
/// The order of states, inputs, parameters and measurements is that of the file.
#[derive(Clone, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct EquationsTable {
    /// The states with their units, such as `angle = "rad"`; the first is what the device is for.
    pub states: Ordered<String>,
    /// The inputs with their units, such as `V = "V"`: each is a channel of a recording.
    #[serde(default, skip_serializing_if = "Ordered::is_empty")]
    pub inputs: Ordered<String>,
    /// How an input goes between two samples, `cubic`, `linear`, `hold`, `mean`, `sine` or `band_limited`: one word for all inputs,
    /// or one for each by its name; `cubic` if left out.
    #[serde(default, skip_serializing_if = "Interpolations::is_left_out")]
    pub interpolation: Interpolations,
    /// The parameters with value and unit, such as `k = "3 N/m"`.
    #[serde(default, skip_serializing_if = "Ordered::is_empty")]
    pub parameters: Ordered<NumberText>,
    /// Curves through points, as functions of one argument, and surfaces through points on a grid, as functions of two.
    #[serde(default, skip_serializing_if = "Ordered::is_empty")]
    pub tables: Ordered<CurveTable>,
    /// Functions with their arguments, such as `"plate(x, gap)" = "area/(gap - x)"`.
    #[serde(default, skip_serializing_if = "Ordered::is_empty")]
    pub functions: Ordered<String>,
    /// Named expressions.
    #[serde(default, rename = "let", skip_serializing_if = "Ordered::is_empty")]
    pub lets: Ordered<String>,
    /// The rate of each state.
    pub derivative: Ordered<String>,
    /// States that follow an expression through one pole.
    #[serde(default, skip_serializing_if = "Ordered::is_empty")]
    pub lag: Ordered<LagTable>,
    /// Expressions a while ago.
    #[serde(default, skip_serializing_if = "Ordered::is_empty")]
    pub delay: Ordered<DelayTable>,
    /// What is measured, each with its unit: `signal = "gain*x in V"`. Each is a channel of a recording.
    pub measure: Ordered<String>,
    /// What follows from states, inputs and parameters and is wanted as an answer too, each with its unit: `position = "rest + a*cos(phase) in m"`. A
    /// reference may know it.
    #[serde(default, skip_serializing_if = "Ordered::is_empty")]
    pub quantities: Ordered<String>,
    /// The variance of a sample of each measurement, and the power density of the noise of a state's rate. The program finds the variance of a
    /// measurement from the recording where it is left out, as with `from_recording`.
    #[serde(default, skip_serializing_if = "Ordered::is_empty")]
    pub noise: Ordered<String>,
    /// The bandwidth of a measurement before it is sampled, whose noise is stated as a density: what lies beyond half the sampling rate is folded
    /// into the samples.
    #[serde(default, skip_serializing_if = "Ordered::is_empty")]
    pub bandwidth: Ordered<Quantity<Frequency, Positive>>,
    /// Between which values a quantity is described; outside of them an estimate is named, and a simulation ends.
    #[serde(default, skip_serializing_if = "Ordered::is_empty")]
    pub range: Ordered<RangeTable>,
    /// Instruments that show a quantity, such as a position detector: a simulation records them.
    #[serde(default, skip_serializing_if = "Ordered::is_empty")]
    pub instruments: Ordered<InstrumentTable>,
    /// Expressions that are zero where something happens.
    #[serde(default, skip_serializing_if = "Ordered::is_empty")]
    pub events: Ordered<String>,
    /// What happens to states at once where an expression passes zero, such as
    /// `bounce = { falls = "x - stop", set = { v = "-restitution*v" } }`.
    #[serde(default, skip_serializing_if = "Ordered::is_empty")]
    pub when: Ordered<ResetTable>,
    /// States that are angles of a swing, each with the state that is its rate, such as `angle = "rate"`. A reference is compared in amplitude, phase and
    /// peaks, and with these states alone.
    #[serde(default, skip_serializing_if = "Ordered::is_empty")]
    pub angles: Ordered<String>,
    /// The period of a state that comes round, such as `phase = "2*pi"`.
    #[serde(default, skip_serializing_if = "Ordered::is_empty")]
    pub cyclic: Ordered<String>,
    /// What an input makes of the signals beside the motion, which is taken off before filters take them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub feedthrough: Option<FeedthroughTable>,
    /// What estimates of states were found to be wrong by, such as `v = { scale = "1.002", bias = "1 mm/s" }`: they are corrected by it.
    #[serde(default, skip_serializing_if = "Ordered::is_empty")]
    pub correction: Ordered<CorrectionTable>,
    /// The state or the quantity that the device is for, by which it is judged; the first state if left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub main: Option<String>,
    /// The energy of the device, by which `kalmems inspect` checks the equations.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub energy: Option<String>,
    /// Which state oscillates under a sinusoidal drive, and the line of the signal that shows it: for the method `lock_in`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub oscillation: Option<OscillationTable>,
    /// A quantity that moves as a sine whose amplitude, frequency, phase and rest are states: by it a filter starts from the signal.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sine: Option<SineTable>,
    /// Where each parameter stands in the table that these equations were made from, where they were, with the power of it there.
    #[serde(skip)]
    pub keys: Option<ParameterKeys>,
    /// What the noise of a state's rate is called in the table that these equations were made from, where that is not the state's name.
    #[serde(skip)]
    pub noise_keys: Vec<(&'static str, &'static str)>,
    /// What filters call the measurements that correct them in the table that these equations were made from, where they have other names there.
    #[serde(skip)]
    pub channel_keys: Vec<(String, String)>,
    /// The event that the keys of a threshold are of, where the table that these equations were made from has such keys.
    #[serde(skip)]
    pub threshold: Option<PassedThreshold>,
    /// The amplitude in rad of its angle from which a stream tells zero phases, where the table that these equations were made from has one.
    #[serde(skip)]
    pub least_amplitude: Option<f64>,
    /// The low-passes of its readout, where the table that these equations were made from has a key for them.
    #[serde(skip)]
    pub demodulator: Option<Demodulator>,
    /// Whether a start from the signal says itself how good it is, so that `start_sd` is for stated starts alone.
    #[serde(skip)]
    pub start_tells_itself: bool,
    #[serde(skip)]
    read: OnceLock<Arc<Device>>,
}

/// Where a parameter of this name stands in a device's own table, with the power of it there.
pub type ParameterKeys = fn(&str) -> Vec<(&'static str, i32)>;

/// A state that follows an expression through one pole.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LagTable {
    /// What it follows, with its unit: `gain*C in V`.
    pub of: String,
    /// Its time constant.
    pub time: String,
}

/// What happens to states at once where an expression of states and parameters passes zero: one of `rises`, `falls` and `crosses`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ResetTable {
    /// The expression, where it happens as that passes zero from below.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rises: Option<String>,
    /// The same from above.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub falls: Option<String>,
    /// The same from either side.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub crosses: Option<String>,
    /// What the states are then, by the states and parameters before.
    pub set: BTreeMap<String, String>,
}

/// An expression a while ago.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DelayTable {
    /// What it is late behind, with its unit.
    pub of: String,
    /// How late it is.
    pub time: String,
    /// The order of Padé's approximation, 1 or 2; 2 if left out.
    #[serde(default = "second")]
    #[schemars(range(min = 1, max = 2))]
    pub order: u8,
}

impl OfElement for LagTable {
    fn of_element(&self, element: &VectorElement) -> Result<Self, String> {
        Ok(Self { of: self.of.of_element(element)?, time: self.time.of_element(element)? })
    }
}

impl OfElement for DelayTable {
    fn of_element(&self, element: &VectorElement) -> Result<Self, String> {
        Ok(Self { of: self.of.of_element(element)?, time: self.time.of_element(element)?, order: self.order })
    }
}

impl ResetTable {
    /// What the equations read of it.
    fn text(&self, name: &str) -> ResetText {
        let table = format!("when.{name}");
        let of = |key: &str, text: &Option<String>| {
            text.as_ref().map(|text| NamedText { name: name.to_owned(), ..NamedText::new(&table, key, text) })
        };
        let table_of_set = format!("{table}.set");
        let mut set = Vec::new();
        for (key, text) in &self.set {
            let written = NamedText::new(&table_of_set, key, text);
            // What is no vector is refused as a name that no state has, and a text as it is read.
            let name_alone = |_| vec![VectorElement { name: key.clone(), index: None }];
            for element in vector_elements(key).unwrap_or_else(name_alone) {
                let text = text.of_element(&element).unwrap_or_else(|_| text.clone());
                set.push(NamedText { name: element.name, text, place: written.place.clone() });
            }
        }
        let place = TextPlace { key: table.clone(), offset: None };
        let (rises, falls) = (of("rises", &self.rises), of("falls", &self.falls));
        ResetText { name: name.to_owned(), place, rises, falls, crosses: of("crosses", &self.crosses), set }
    }
}

impl OfElement for ResetTable {
    fn of_element(&self, element: &VectorElement) -> Result<Self, String> {
        let part = |text: &Option<String>| text.as_ref().map(|text| text.of_element(element)).transpose();
        let one =
            |(name, text): (&String, &String)| Ok((name.of_element(element)?, text.of_element(element)?));
        let set = self.set.iter().map(one).collect::<Result<_, String>>()?;
        Ok(Self { rises: part(&self.rises)?, falls: part(&self.falls)?, crosses: part(&self.crosses)?, set })
    }
}

fn second() -> u8 {
    2
}

impl DeviceDescription for EquationsTable {
    const NAME: &'static str = "equations";
    const SUMMARY: &'static str = "A device of one's own, as differential equations with units.";

    fn check(&self) -> Result<(), (Key, String)> {
        for (name, number) in self.parameters.iter() {
            let key = || Key::from("device").child(Self::NAME).child("parameters").child(name);
            number.nominal().map_err(|why| (key(), why))?;
        }
        for (name, table) in self.tables.iter() {
            let at = || Key::from("device").child(Self::NAME).child("tables").child(name).child("z");
            table.check_rows().map_err(|why| (at(), why))?;
        }
        if let Some(name) = self.interpolation.names().find(|name| self.inputs.get(name).is_none()) {
            let known: Vec<String> = self.inputs.iter().map(|(name, _)| format!("`{name}`")).collect();
            let known = if known.is_empty() { "none".to_owned() } else { known.join(", ") };
            let why = format!("`{name}` is not an input; the inputs of the device are {known}");
            let at = Key::from("device").child(Self::NAME).child("interpolation");
            return Err((at.child(name), why));
        }
        // With files the points are read where the experiment's folder is known.
        if self.tables.iter().any(|(_, table)| table.file.is_some()) {
            return Ok(());
        }
        let device = self.device_in(&mut |table| table.points_here());
        device.map(|_| ()).map_err(|error| (key_of(&error), message(&error)))
    }
}

/// The low-passes of a readout that some filters follow as states, those with `demodulator = true`.
#[derive(Clone, Debug)]
pub struct Demodulator {
    /// The same device with them; `None` where its table states none.
    pub device: Option<Arc<EquationsTable>>,
    /// What to write if there are none.
    pub remedy: &'static str,
}

impl EquationsTable {
    /// The table of an experiment, and the device, its equations checked.
    pub fn of(experiment: &Experiment) -> Result<(Arc<Self>, Arc<Device>), ConfigError> {
        let table = experiment.device_in_terms_of::<Self>()?;
        let device = table.device(experiment)?;
        Ok((table, device))
    }

    /// The same, from which no device has been read.
    #[must_use]
    pub fn without_device(&self) -> Self {
        Self { read: OnceLock::new(), ..self.clone() }
    }

    /// The device of a table of an experiment, its equations checked.
    pub fn device(&self, experiment: &Experiment) -> Result<Arc<Device>, ConfigError> {
        let mut unread = None;
        let device = self.device_in(&mut |curve| {
            curve.points_of(experiment).unwrap_or_else(|error| {
                unread.get_or_insert(error);
                curve.points_here()
            })
        });
        if let Some(error) = unread {
            return Err(error);
        }
        device.map_err(|error| refused(experiment, &error))
    }

    fn device_in(
        &self,
        points: &mut dyn FnMut(&CurveTable) -> CurvePoints,
    ) -> Result<Arc<Device>, EquationError> {
        if let Some(device) = self.read.get() {
            return Ok(Arc::clone(device));
        }
        let device = Arc::new(Device::of(&self.description(points)?)?);
        Ok(Arc::clone(self.read.get_or_init(|| device)))
    }

    /// What the equations are read from.
    fn description(
        &self,
        points: &mut dyn FnMut(&CurveTable) -> CurvePoints,
    ) -> Result<Description, EquationError> {
        let entries = |table: &str, texts: &Ordered<String>| -> Vec<NamedText> {
            texts.iter().map(|(name, text)| NamedText::new(table, name, text)).collect()
        };
        let part = |table: &str, name: &str, key: &str, text: &str| NamedText {
            name: name.to_owned(),
            ..NamedText::new(&format!("{table}.{name}"), key, text)
        };
        let follower = |table: &str, name: &str, [of, time]: [&str; 2], order| Follower {
            name: name.to_owned(),
            of: part(table, name, "of", of),
            time: part(table, name, "time", time),
            order,
        };
        let mut curves = Vec::new();
        for (name, table) in self.tables.iter() {
            let place = TextPlace { key: format!("tables.{name}"), offset: None };
            curves.push(CurvePoints { name: name.to_owned(), place, ..points(table) }.in_si()?);
        }
        Ok(Description {
            states: entries("states", &self.states),
            inputs: entries("inputs", &self.inputs),
            // What cannot be read of an uncertainty was refused before.
            parameters: (self.parameters.iter())
                .map(|(name, number)| {
                    NamedText::new("parameters", name, &number.nominal().unwrap_or_default())
                })
                .collect(),
            lets: entries("let", &self.lets),
            functions: entries("functions", &self.functions),
            derivative: entries("derivative", &self.derivative),
            measure: entries("measure", &self.measure),
            quantities: entries("quantities", &self.quantities),
            noise: entries("noise", &self.noise),
            tables: curves,
            events: entries("events", &self.events),
            when: self.when.iter().map(|(name, reset)| reset.text(name)).collect(),
            cyclic: entries("cyclic", &self.cyclic),
            lag: self.lag.iter().map(|(name, lag)| follower("lag", name, [&lag.of, &lag.time], 1)).collect(),
            delay: self
                .delay
                .iter()
                .map(|(name, delay)| follower("delay", name, [&delay.of, &delay.time], delay.order))
                .collect(),
            energy: self.energy.as_deref().map(|text| NamedText {
                name: "energy".to_owned(),
                text: text.to_owned(),
                place: TextPlace { key: "energy".to_owned(), offset: None },
            }),
        })
    }
}

/// Where in the device's table an error is: a function's name may have dots and commas of its own.
fn key_of(error: &EquationError) -> Key {
    let place = &error.place().key;
    let at = Key::from("device").child(EquationsTable::NAME);
    match place.split_once('.') {
        Some(("functions", name)) => at.child("functions").child(name),
        _ => place.split('.').fold(at, Key::child),
    }
}

/// What is wrong, without the place, which the error of the file has itself.
fn message(error: &EquationError) -> String {
    let whole = error.to_string();
    whole.strip_prefix(&format!("{}: ", error.place())).map_or_else(|| whole.clone(), str::to_owned)
}

/// An error of the equations as one of the file.
pub fn refused(experiment: &Experiment, error: &EquationError) -> ConfigError {
    experiment.error(key_of(error), ConfigFault::Value { why: message(error) })
}
